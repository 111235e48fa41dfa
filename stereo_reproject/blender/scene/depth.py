"""Depths of a scene by ray casts through its camera's frame, without a render."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from ...errors import BadInputError
from ...views.camera import Camera, OrthographicCamera
from ...views.depth_range import FAR_EYE, EdgeHit, FramePixels, edge_positions, grid_positions, typical_range
from .rig import FrameRegion, frame_region, stereo_cameras

GRID_COLUMNS, GRID_ROWS = 48, 27
"""Ray casts across and down the frame: 1296 of them take some hundredths of a second, and a thing of a fiftieth of the
frame's width meets one."""

EDGE_ROWS = 24
"""Ray casts along each edge of the frame."""

MAX_PASSED_SURFACES = 16
"""Surfaces that the camera does not see, such as those of hidden lights, that one ray passes through at most."""

PASSED_SHARE = 1e-5
"""Share of its distance by which a ray goes on behind a surface that it passes through: above the rounding of the
single-precision numbers in which Blender casts rays."""


def frame_pixels(region: FrameRegion) -> FramePixels:
    """Return the whole frame in the pixel positions of cameras that show this region of it."""
    return FramePixels(-region.left, -region.top, region.full_width, region.full_height)


def measure_depth(
    scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph
) -> tuple[tuple[float, float], tuple[EdgeHit, ...]]:
    """Return the nearest and farthest depth that the scene's camera sees now, and what is seen at the frame's edges.

    The depsgraph is that of the scene. Hair, volumes and displacement are not seen. Raises BadInputError where nothing
    is in front of the camera.
    """
    eyes, frame, clip = _seen_through(scene, depsgraph)
    hits = cast_rays(scene, depsgraph, eyes["left"], grid_positions(frame, GRID_COLUMNS, GRID_ROWS), clip)
    depth = np.array([hit_depth for hit_depth, _ in hits])
    # The sky of parallel rays has no place on the screen where the eyes are turned.
    shows_sky = not scene.render.film_transparent and not isinstance(eyes["left"], OrthographicCamera)
    if not shows_sky and np.isfinite(depth).any():
        depth = depth[np.isfinite(depth)]
    found = typical_range(depth)
    if found is None:
        raise BadInputError("the camera sees nothing whose depth can be measured: point it at the scene")
    return found, edge_hits(scene, depsgraph)


def edge_hits(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> tuple[EdgeHit, ...]:
    """Return what the scene's camera sees at the frame's edges now; parameters and limits as for `measure_depth`."""
    eyes, frame, clip = _seen_through(scene, depsgraph)
    return tuple(
        EdgeHit(side, name, hit_depth)
        for side, eye in FAR_EYE.items()
        for hit_depth, name in cast_rays(scene, depsgraph, eyes[eye], edge_positions(frame, side, EDGE_ROWS), clip)
        if np.isfinite(hit_depth)
    )


def _seen_through(
    scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph
) -> tuple[Mapping[str, Camera], FramePixels, tuple[float, float]]:
    """Return both eyes of the scene's camera, by "left" and "right", its whole frame, and the depths between which it
    sees, in scene units.
    """
    camera = scene.camera.evaluated_get(depsgraph)
    clip = camera.data.clip_start, camera.data.clip_end
    return stereo_cameras(camera, scene.render), frame_pixels(frame_region(scene.render)), clip


def cast_rays(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    camera: Camera,
    positions: tuple[NDArray, NDArray],
    clip: tuple[float, float],
) -> Iterator[tuple[float, str]]:
    """Yield depth and object's name of the first surface that the camera sees at each pixel position; +inf and "" where
    there is none. positions are x and y, (N,) each; clip is the depth between which the camera sees.
    """
    origin, direction = camera.ray_from_px(*positions)
    shape = positions[0].shape
    turn, place = camera.world_from_camera[:3, :3], camera.world_from_camera[:3, 3]
    origins, directions = (
        np.stack([np.broadcast_to(part, shape) for part in parts], axis=1) @ turn.T for parts in (origin, direction)
    )
    for start, along in zip(origins + place, directions, strict=True):
        yield first_seen(scene, depsgraph, Vector(start), Vector(along), clip)


def first_seen(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    origin: Vector,
    direction: Vector,
    clip: tuple[float, float],
) -> tuple[float, str]:
    """Return the distance along a ray, in lengths of `direction`, of the first surface that a render shows, and the
    name of its object; +inf and "" where there is none. clip has the distances between which it is looked for.
    """
    length = direction.length
    start, end = clip
    for _ in range(MAX_PASSED_SURFACES):
        if start >= end:
            break
        found, place, _, _, item, _ = scene.ray_cast(
            depsgraph, origin + start * direction, direction / length, distance=(end - start) * length
        )
        if not found:
            break
        distance = (place - origin).dot(direction) / length**2
        if item.visible_camera and not item.hide_render:
            return distance, item.name
        start = max(distance, start) * (1.0 + PASSED_SHARE)
    return float("inf"), ""
