"""The costs of tracing on this machine: known from this user's earlier frames, and renewed by a frame that traced."""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from ...trace.costs import TraceCosts
from ...trace.costs_file import COSTS_FILE, CostsFile
from ...trace.fill import SourceCost
from ...trace.measuring import TraceRender, learned_costs
from ..scene.devices import device_name
from ..scene.user_folder import user_folder


def known_costs(scene: bpy.types.Scene, packed_by: str) -> TraceCosts:
    """Return the costs of tracing that this user has measured on the scene's device with this Blender and this packed
    camera, by `BlenderRenderer.packed_by`; those that are assumed where nothing was measured yet.
    """
    file = _file()
    return TraceCosts() if file is None else file.read(_key(scene, packed_by))


def learn_costs(scene: bpy.types.Scene, packed_by: str, source: SourceCost, renders: Iterable[TraceRender]) -> None:
    """Renew this user's costs of tracing by what one frame of the scene has measured.

    packed_by is as for `known_costs`; source is the cost of its source, whose scene Cycles synced anew;
    renders are those that traced pixels. Costs that cannot be kept are left as they were.
    """
    file = _file()
    if file is not None:
        file.renew(_key(scene, packed_by), lambda known: learned_costs(known, source, renders))


def _file() -> CostsFile | None:
    """Return the file of this user's costs; None where nothing is to be kept."""
    folder = user_folder()
    return None if folder is None else CostsFile(folder / COSTS_FILE)


def _key(scene: bpy.types.Scene, packed_by: str) -> str:
    """Return the key of the costs in the file: the scene's device, the version of Blender, and the packed camera."""
    version = ".".join(map(str, bpy.app.version[:2]))
    return f"{device_name(scene)} | Blender {version} | {packed_by}"
