"""The packed fill: one small render whose pixels are wanted pixels of views, side by side."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

import bpy

from ...errors import BadInputError
from ...images.passes import Passes
from ...trace.packing import pack
from ...views.camera import Camera
from ..scene.effects import has_grease_pencil, is_animated, uses_output
from ..scene.motion import vector_pass_asked_for
from ..scene.readers import what_reads
from ..scene.rig import frame_region
from ..scene.working import evaluated
from .hole_camera import OSL_CAMERA, missing_osl_cameras
from .packed_camera import PACKED_RENDER_SETTINGS, UNSHARED_NOISE, PackedCamera, PackedTask
from .packed_views import PackedPixels, switch_on_positions, without_added_positions
from .portal_camera import PORTAL_CAMERA
from .render import Rendered, render_views

CAMERAS = {camera.name: camera for camera in (OSL_CAMERA, PORTAL_CAMERA)}
"""Packed cameras by name."""

PACKED_SETTINGS = frozenset(
    (*(f"render.{name}" for name in PACKED_RENDER_SETTINGS), *(f"cycles.{name}" for name in UNSHARED_NOISE))
)
"""Paths from the scene of the settings that every packed render changes, as drivers name them."""


def packed_camera(scene: bpy.types.Scene, asked: str = "auto") -> PackedCamera:
    """Return the camera of packed renders of a scene: the one asked for, "osl" or "portal"; with "auto" the OSL camera,
    and the portal where Cycles has none or the scene's camera is orthographic. Raises BadInputError for an OSL camera
    where there is none.
    """
    missing = missing_osl_cameras(scene)
    if asked == "auto":
        return CAMERAS["portal" if missing is not None or scene.camera.data.type == "ORTHO" else "osl"]
    if asked == "osl" and missing is not None:
        raise BadInputError(f"--packed-by osl is not possible: {missing}; use --packed-by auto")
    return CAMERAS[asked]


def packed_blocker(
    scene: bpy.types.Scene, eyes: Iterable[Camera], deepest: float, *, by: PackedCamera | None = None
) -> str | None:
    """Return why pixels of these views cannot be traced packed, in words; None if they can. deepest is the greatest
    finite depth that a view has shown, in scene units. by is the packed camera, that of `packed_camera` by default.
    """
    by = by or packed_camera(scene)
    checks = {
        "rolling shutter needs the frame's own rows": scene.render.use_motion_blur
        and scene.cycles.rolling_shutter_type != "NONE",
        "the lens is animated and motion blur is on": scene.render.use_motion_blur and is_animated(scene.camera.data),
        "the lens is animated and the Vector pass is on": vector_pass_asked_for(scene)
        and is_animated(scene.camera.data),
        "adaptive subdivision follows the camera": _uses_adaptive_subdivision(scene),
        "camera culling follows the camera": scene.render.use_simplify
        and (scene.cycles.use_camera_cull or scene.cycles.use_distance_cull),
        "a material uses Window coordinates": uses_output("ShaderNodeTexCoord", "Window"),
        "Grease Pencil is drawn over the finished render": has_grease_pencil(scene),
    }
    reason = next((reason for reason, blocks in checks.items() if blocks), None)
    return reason or by.blocker(scene, eyes, deepest) or what_reads(scene, PACKED_SETTINGS | by.settings)


class PackedBlockers:
    """Reasons why pixels of a scene's views cannot be traced packed. Each is found out once, since all instances of the
    scene are looked at; the scene must not change meanwhile.
    """

    def __init__(self, scene: bpy.types.Scene, eyes: Iterable[Camera], by: PackedCamera) -> None:
        self._scene, self._eyes, self._by = scene, tuple(eyes), by
        self._found: dict[float, str | None] = {}

    def at(self, deepest: float) -> str | None:
        """Return what `packed_blocker` returns for this greatest depth."""
        key = deepest if self._by.clips_by_distance else 0.0
        if key not in self._found:
            self._found[key] = packed_blocker(self._scene, self._eyes, deepest, by=self._by)
        return self._found[key]


def _uses_adaptive_subdivision(scene: bpy.types.Scene) -> bool:
    """Return whether adaptive subdivision is on for any object of the scene."""
    for item in scene.objects:
        settings = getattr(item, "cycles", None)
        if getattr(settings, "use_adaptive_subdivision", False):
            return True
        if any(getattr(modifier, "use_adaptive_subdivision", False) for modifier in item.modifiers):
            return True
    return False


def trace_packed(
    scene: bpy.types.Scene,
    view: str,
    rendered: Camera,
    views: Sequence[PackedPixels],
    folder: Path,
    *,
    seed: int,
    by: PackedCamera | None = None,
) -> tuple[Rendered, list[Passes]]:
    """Trace pixels of any number of views in one render. Return the render, and the passes (N, C) of each view's
    pixels.

    view is the view of the scene that Blender renders, and `rendered` its camera; each of `views` has either that very
    camera or any other. If there are several, their cameras must keep their places to each other while the shutter is
    open, and nothing in the scene may depend on where Cycles' camera is: see `why_apart`. folder is private. by is the
    packed camera, that of `packed_camera` by default.
    """
    packing = pack([pixels.places for pixels in views])
    clip_start = evaluated(scene.camera, scene).data.clip_start
    task = PackedTask(view, rendered, clip_start, views, packing, frame_region(scene.render))
    by = by or packed_camera(scene)
    if task.others:
        switch_on_positions(scene)
    with tempfile.TemporaryDirectory(dir=folder) as tables, by.in_place(scene, task, Path(tables)):
        result = render_views(scene, (view,), folder, seed=seed)
    flat = {name: image.reshape(-1, image.shape[2]) for name, image in result.views[view].items()}
    traced: list[Passes] = []
    for index, at in enumerate(packing.at):
        passes = by.as_plain({name: image[at] for name, image in flat.items()}, task, index)
        traced.append(without_added_positions(scene, passes))
    return result, traced
