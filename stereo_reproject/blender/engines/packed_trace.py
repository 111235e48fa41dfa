"""The packed fill: one small render whose pixels are wanted pixels of views, side by side."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

import bpy

from ...errors import BadInputError
from ...images.passes import Passes
from ...trace.packing import pack
from ...views.camera import Camera, is_planar
from ...words import Words
from ..scene.effects import has_grease_pencil, is_animated, uses_output
from ..scene.motion import vector_pass_asked_for
from ..scene.readers import what_reads
from ..scene.rig import frame_region
from ..scene.working import evaluated
from .hole_camera import OSL_CAMERA, missing_osl_cameras
from .packed_camera import PACKED_RENDER_SETTINGS, UNSHARED_NOISE, PackedCamera, PackedTask
from .packed_views import PackedPixels, switch_on_positions, without_added_positions
from .portal_camera import PANORAMA_PORTAL_CAMERA, PORTAL_CAMERA
from .ray_camera import RAY_CAMERA
from .render import Rendered, render_views

CAMERAS = {camera.name: camera for camera in (OSL_CAMERA, PORTAL_CAMERA)}
"""Packed cameras by name, the preferred ones first: there are fewer cases that the OSL camera cannot trace."""

PANORAMA_CAMERAS = {camera.name: camera for camera in (RAY_CAMERA, PANORAMA_PORTAL_CAMERA)}
"""Packed cameras of panoramas, as `CAMERAS`."""

PACKED_SETTINGS = frozenset(
    (*(f"render.{name}" for name in PACKED_RENDER_SETTINGS), *(f"cycles.{name}" for name in UNSHARED_NOISE))
)
"""Paths from the scene of the settings that every packed render changes, as drivers name them."""


def check_packed_by(scene: bpy.types.Scene, asked: str) -> None:
    """Raise BadInputError where the OSL camera is asked for by its name, "osl", and Cycles has none here. Of the scene
    its device alone counts.
    """
    missing = missing_osl_cameras(scene) if asked == OSL_CAMERA.name else None
    if missing is not None:
        raise BadInputError(Words("--packed-by osl is not possible: {missing}; use --packed-by auto", missing=missing))


def packed_blocker(scene: bpy.types.Scene, eyes: Iterable[Camera], deepest: float, by: PackedCamera) -> str | None:
    """Return why pixels of these views cannot be traced packed by this camera, in words; None if they can. deepest is
    the greatest finite depth that a view has shown, in scene units.
    """
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


class PackedCameras:
    """The packed cameras that may trace a scene's views, in the order in which they are preferred, and the reasons why
    they cannot.

    asked is the name of a packed camera, or "auto" for the first of `CAMERAS` that can. Each reason is found out once,
    since all instances of the scene are looked at; the scene must not change meanwhile.
    """

    def __init__(self, asked: str, eyes: Iterable[Camera]) -> None:
        self._eyes = tuple(eyes)
        cameras = CAMERAS if all(map(is_planar, self._eyes)) else PANORAMA_CAMERAS
        self._candidates = tuple(cameras.values()) if asked == "auto" else (cameras[asked],)
        self._found: dict[tuple[str, float], str | None] = {}

    def chosen(self, scene: bpy.types.Scene, deepest: float) -> PackedCamera:
        """Return the first camera that can trace the scene's views, the last one where none can. scene is the one that
        Cycles renders; deepest is as for `packed_blocker`.
        """
        *preferred, last = self._candidates
        return next((camera for camera in preferred if self._reason(camera, scene, deepest) is None), last)

    def blocker(self, scene: bpy.types.Scene, deepest: float) -> str | None:
        """Return why no camera can trace the scene's views, in one line; None if one can. The arguments are those of
        `chosen`.
        """
        reasons: dict[str, str] = {}
        for camera in self._candidates:
            reason = self._reason(camera, scene, deepest)
            if reason is None:
                return None
            reasons[camera.label] = reason
        if len(set(reasons.values())) == 1:
            return next(iter(reasons.values()))
        return "; ".join(f"{label}: {reason}" for label, reason in reasons.items())

    def _reason(self, camera: PackedCamera, scene: bpy.types.Scene, deepest: float) -> str | None:
        """Return what `packed_blocker` returns for one camera."""
        key = camera.name, deepest if camera.clips_by_distance else 0.0
        if key not in self._found:
            self._found[key] = packed_blocker(scene, self._eyes, deepest, camera)
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
    by: PackedCamera,
) -> tuple[Rendered, list[Passes]]:
    """Trace pixels of any number of views in one render. Return the render, and the passes (N, C) of each view's
    pixels.

    view is the view of the scene that Blender renders, and `rendered` its camera; each of `views` has either that very
    camera or any other. If there are several, their cameras must keep their places to each other while the shutter is
    open, and nothing in the scene may depend on where Cycles' camera is: see `why_apart`. folder is private. by is the
    packed camera.
    """
    packing = pack([pixels.places for pixels in views])
    clip_start = evaluated(scene.camera, scene).data.clip_start
    pixel_filter = scene.cycles.pixel_filter_type, scene.cycles.filter_width
    task = PackedTask(view, rendered, clip_start, views, packing, frame_region(scene.render), pixel_filter)
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
