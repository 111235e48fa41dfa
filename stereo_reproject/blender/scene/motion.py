"""Cameras of both eyes in the frames around the rendered one, against which motion vectors are measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import bpy
import numpy as np

from ...views.camera import Camera
from ...views.motion import Moving, moving
from .rig import stereo_cameras
from .working import evaluated, rendered_layer, stand_at

Seen = TypeVar("Seen")

BLUR_SETTINGS = ("use_motion_blur", "motion_steps")
"""Properties of an object's Cycles settings that say how it moves while the shutter is open. What must move with the
camera has the camera's."""


def vector_pass_asked_for(scene: bpy.types.Scene) -> bool:
    """Return whether a working scene's layer renders the Vector pass. With motion blur Blender renders none."""
    return rendered_layer(scene).use_pass_vector and not scene.render.use_motion_blur


def eyes_in_motion(scene: bpy.types.Scene, now: Mapping[str, Camera]) -> dict[str, Moving]:
    """Return the motion of both eyes of a working scene, by view name; `now` are their cameras in its present frame.

    The scene is set to the frames before and after, as Cycles does for the Vector pass itself, and then to its own
    again.
    """
    frame, subframe = scene.frame_current, scene.frame_subframe
    try:
        before, after = (_cameras_at(scene, frame + step, subframe) for step in (-1, 1))
    finally:
        scene.frame_set(frame, subframe=subframe)
    return {view: moving(now[view], before[view], after[view]) for view in now}


def while_open(scene: bpy.types.Scene, shares: Sequence[float], look: Callable[[], Seen]) -> list[Seen]:
    """Return what `look` returns at several times while the shutter is open, in their order. shares, 0 to 1, are those
    of the shutter's time that have passed.

    The scene is set to each time, and to its own frame again afterwards, also after an error.
    """
    render = scene.render
    opens = {"START": 0.0, "CENTER": -0.5, "END": -1.0}[render.motion_blur_position] * render.motion_blur_shutter
    frame, subframe = scene.frame_current, scene.frame_subframe
    seen: list[Seen] = []
    try:
        for share in shares:
            time = frame + subframe + opens + share * render.motion_blur_shutter
            scene.frame_set(int(np.floor(time)), subframe=float(time - np.floor(time)))
            seen.append(look())
    finally:
        stand_at(scene, frame, subframe)
    return seen


def _cameras_at(scene: bpy.types.Scene, frame: int, subframe: float) -> dict[str, Camera]:
    """Set the scene to a frame, and return its eyes' cameras there."""
    scene.frame_set(frame, subframe=subframe)
    return stereo_cameras(evaluated(scene.camera, scene), scene.render)
