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

PACKED_BY_OSL = "osl"
"""Name of the way in which pixels are packed, as the keys of the file have it."""


def known_costs(scene: bpy.types.Scene) -> TraceCosts:
    """Return the costs of tracing that this user has measured on the scene's device with this Blender; those that are
    assumed where nothing was measured yet.
    """
    file = _file()
    return TraceCosts() if file is None else file.read(_key(scene))


def learn_costs(scene: bpy.types.Scene, source: SourceCost, renders: Iterable[TraceRender]) -> None:
    """Renew this user's costs of tracing by what one frame of the scene has measured.

    source is the cost of its source, whose scene Cycles synced anew; renders are those that traced pixels. Costs that
    cannot be kept are left as they were.
    """
    file = _file()
    if file is not None:
        file.renew(_key(scene), lambda known: learned_costs(known, source, renders))


def _file() -> CostsFile | None:
    """Return the file of this user's costs; None where nothing is to be kept."""
    folder = user_folder()
    return None if folder is None else CostsFile(folder / COSTS_FILE)


def _key(scene: bpy.types.Scene) -> str:
    """Return the key of the costs in the file: the scene's device, the version of Blender, and the way of packing."""
    version = ".".join(map(str, bpy.app.version[:2]))
    return f"{device_name(scene)} | Blender {version} | {PACKED_BY_OSL}"
