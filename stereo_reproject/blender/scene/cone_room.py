"""The room that a cone of views needs: cameras far aside may stand behind a wall, or within a thing."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
from mathutils import Vector

from ...settings.views import view_names
from ...views.cone import cone_degrees
from ...words import Words
from .working import evaluated, rendered_layer

STEP_SHARE = 1e-4
"""Share of the way by which a ray goes on behind a thing that renders do not show."""


def cone_warnings(working: bpy.types.Scene, offsets: Sequence[float], focus_distance: float) -> list[str]:
    """Return a line for each side of the scene's camera on which views stand behind something, or within it.

    offsets are the places of all views beside the camera of a working scene, in scene units, from the leftmost on.
    """
    names, warnings = view_names(len(offsets)), []
    for side in (-1.0, 1.0):
        reach = max(side * offset for offset in offsets)
        met = _first_thing(working, side, reach) if reach > 0.0 else None
        if met is None:
            continue
        thing, distance = met
        behind = [name for name, offset in zip(names, offsets, strict=True) if side * offset >= distance]
        message = "{views} stand behind {thing}, or within it: take a cone of at most {cone} degrees, or a nearer focus"
        if len(behind) == 1:
            message = (
                "{views} stands behind {thing}, or within it: take a cone of at most {cone} degrees, or a nearer focus"
            )
        views = behind[0] if len(behind) == 1 else f"{behind[0]} to {behind[-1]}"
        cone = cone_degrees(2.0 * distance, focus_distance)
        warnings.append(Words(message, views=views, thing=repr(thing), cone=f"{cone:.0f}"))
    return warnings


def _first_thing(working: bpy.types.Scene, side: float, reach: float) -> tuple[str, float] | None:
    """Return the name of the first thing that renders show beside the camera of a working scene, and its distance in
    scene units; None without any. side is 1 for the right and -1 for the left, reach the greatest distance that
    counts."""
    pose = evaluated(working.camera, working).matrix_world.normalized()
    start, direction = pose.translation.copy(), pose.to_3x3() @ Vector((side, 0.0, 0.0))
    gone = 0.0
    while gone < reach:
        origin = start + gone * direction
        hit, place, _, _, thing, _ = working.ray_cast(
            rendered_layer(working).depsgraph, origin, direction, distance=reach - gone
        )
        if not hit:
            return None
        gone = (place - start).dot(direction)
        if not thing.hide_render and thing.visible_camera:
            return thing.name, gone
        gone += STEP_SHARE * reach
    return None
