"""Things of a working scene that move, as Blender evaluates them in a frame: their triangles in the world."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import cast

import bpy
import numpy as np
from numpy.typing import NDArray

from ...holes.moved import Box
from ...images.masks import dilate
from ...views.camera import Camera
from ...views.outline import covered_pixels
from .working import rendered_layer

FILTER_REACH_PX = 2
"""Pixels beside a thing that the pixel filter mixes it into, and one more for displaced and smoothed surfaces."""


@dataclass(frozen=True)
class Shape:
    """One instance of a thing: the corners (N, 3) of its triangles in the world, and their indices (M, 3)."""

    points: NDArray[np.float64]
    triangles: NDArray[np.int32]

    @property
    def box(self) -> Box:
        """The box around it."""
        return self.points.min(axis=0), self.points.max(axis=0)


def shapes_of(scene: bpy.types.Scene, names: Collection[str]) -> list[Shape] | None:
    """Return all instances, in the scene's present frame, of the objects of these names; None where one of them has no
    triangles that tell where it is: hair, particles, points and volumes."""
    layer = rendered_layer(scene)
    layer.update()
    found: list[Shape] = []
    for instance in layer.depsgraph.object_instances:
        evaluated = cast("bpy.types.Object", instance.object)
        thing = cast("bpy.types.Object", evaluated.original)
        if thing.name_full not in names or not (instance.show_self or instance.show_particles):
            continue
        if thing.type in ("CURVES", "POINTCLOUD", "VOLUME") or thing.particle_systems:
            return None
        if any(modifier.type == "FLUID" for modifier in thing.modifiers):
            return None
        shape = _shape(evaluated, np.array(instance.matrix_world, np.float64))
        if shape is not None:
            found.append(shape)
    return found


def _shape(evaluated: bpy.types.Object, matrix: NDArray[np.float64]) -> Shape | None:
    """Return the triangles of an evaluated object that stands by this matrix (4, 4); None without any."""
    mesh = evaluated.to_mesh()
    try:
        if mesh is None:
            return None
        mesh.calc_loop_triangles()
        if not mesh.loop_triangles:
            return None
        points = np.empty(3 * len(mesh.vertices), np.float32)
        triangles = np.empty(3 * len(mesh.loop_triangles), np.int32)
        mesh.vertices.foreach_get("co", points)
        mesh.loop_triangles.foreach_get("vertices", triangles)
    finally:
        evaluated.to_mesh_clear()
    placed = points.reshape(-1, 3).astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    return Shape(placed, triangles.reshape(-1, 3))


def pixels_of_shapes(shapes: Collection[Shape], camera: Camera) -> NDArray[np.bool_]:
    """Return (H, W) the pixels of a camera in which any of these shapes may be seen, if nothing hides it."""
    result = np.zeros((camera.height, camera.width), bool)
    for shape in shapes:
        result |= covered_pixels(shape.points, shape.triangles, camera)
    return dilate(result, FILTER_REACH_PX)
