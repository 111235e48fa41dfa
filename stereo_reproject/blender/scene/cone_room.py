"""The room that a cone of views needs: cameras far aside may stand behind a wall, or within a thing."""

from __future__ import annotations

import math
from collections.abc import Sequence

import bpy
from mathutils import Vector

from ...settings.views import view_names
from ...views.cone import cone_degrees
from ...words import Words
from .working import evaluated, rendered_layer

STEP_SHARE = 1e-4
"""Share of the way by which a ray goes on behind a thing that renders do not show."""

LOST_SHARE = 1e-6
"""Share of a coordinate that single precision may lose."""


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
        # Rounded down: views at the very place still stand within the thing.
        cone = math.floor(cone_degrees(2.0 * distance, focus_distance))
        warnings.append(Words(message, views=views, thing=repr(thing), cone=cone))
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
        gone = max((place - start).dot(direction), gone)
        if not thing.hide_render and thing.visible_camera and not _is_air(thing):
            return thing.name, gone
        # A step that single precision would lose far from the world's origin would meet the same thing for ever.
        gone += max(STEP_SHARE * reach, LOST_SHARE * max(map(abs, place)))
    return None


def _is_air(thing: bpy.types.Object) -> bool:
    """Return whether all materials of an object have a volume and no surface."""
    materials = [slot.material for slot in thing.material_slots if slot.material is not None]
    trees = [material.node_tree for material in materials]
    return bool(trees) and all(tree is not None and _has_no_surface(tree) for tree in trees)


def _has_no_surface(tree: bpy.types.ShaderNodeTree) -> bool:
    """Return whether what comes out of a material's nodes is a volume alone."""
    outputs = [node for node in tree.nodes if node.type == "OUTPUT_MATERIAL" and node.is_active_output]
    return bool(outputs) and all(
        out.inputs["Volume"].is_linked and not out.inputs["Surface"].is_linked for out in outputs
    )
