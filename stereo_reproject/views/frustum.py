"""The space that a camera may see, as half spaces: tells which boxes are in view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .camera import Camera, OrthographicCamera, PlanarCamera, is_planar
from .panorama import PanoramicCamera
from .tuning import TUNING

LEAST_DEPTH = 1e-6
"""Depth up to which a corner counts as behind the camera: its place in the picture cannot be told."""


@dataclass(frozen=True)
class Lens:
    """The lens of a camera, in scene units.

    near and far are the depths between which it sees. aperture is its radius, 0 for a pinhole; focus is the depth that
    is in focus. Both serve depth of field alone.
    """

    near: float = 0.0
    far: float = float("inf")
    aperture: float = 0.0
    focus: float = float("inf")


class Frustum:
    """The space that one camera may see, as half spaces in the world; tells which boxes may be in its picture.

    It is widened by the radius of the lens and by a few pixels beyond the frame. A panorama may see everything but what
    is nearer than the near clip of each of its rays.
    """

    def __init__(self, camera: Camera, lens: Lens) -> None:
        sides = _sides(camera, lens) if is_planar(camera) else []
        self._normals = np.array([side[:3] for side in sides]).reshape(-1, 3)
        self._limits = np.array([side[3] for side in sides])
        self._nearest = -1.0 if is_planar(camera) else _nearest(camera, lens)
        self._camera_from_world = np.linalg.inv(np.asarray(camera.world_from_camera, np.float64))

    def may_meet(self, corners: NDArray) -> NDArray[np.bool_]:
        """Return (...) whether convex bodies may be in view; each is given by its N corners in the world, (..., N, 3).

        It is False where all corners of a body lie beyond one side of the frustum, or are too near. So False is
        certain, and True is not.
        """
        local = corners @ self._camera_from_world[:3, :3].T + self._camera_from_world[:3, 3]
        outside = local @ self._normals.T > self._limits
        too_near = (np.linalg.norm(local, axis=-1) < self._nearest).all(axis=-1)
        return ~outside.all(axis=-2).any(axis=-1) & ~too_near


def _nearest(camera: Camera, lens: Lens) -> float:
    """Return the distance from a panorama's own place, in scene units, up to which its rays certainly meet nothing.

    They begin at the near clip, counted from an eye on the circle of spherical stereo, and look past the camera.
    """
    stereo = camera.stereo if isinstance(camera, PanoramicCamera) else None
    offset = 0.0 if stereo is None else abs(stereo.offset)
    # Beside the eye the camera lies across a ray, or a little ahead of it where rays converge.
    ahead = 0.0 if stereo is None or offset == 0.0 else offset**2 / np.hypot(stereo.convergence, offset)
    past_eye = float(np.sqrt(offset**2 - ahead**2 + max(lens.near - ahead, 0.0) ** 2))
    return min(lens.near, past_eye) - lens.aperture


def _sides(camera: PlanarCamera, lens: Lens) -> list[tuple[float, float, float, float]]:
    """Return the half spaces beyond the sides of what a camera may see, as normal and limit, in camera space."""
    plane = camera.plane
    beyond_x = TUNING.frame_margin_pixels * (plane.right - plane.left) / camera.width
    beyond_y = TUNING.frame_margin_pixels * (plane.top - plane.bottom) / camera.height
    radius = lens.aperture
    # A ray from the lens's rim through a point in focus is this much off its centre's ray, for each unit of depth.
    slope = radius / lens.focus if radius > 0.0 else 0.0
    edges = (
        ((1.0, 0.0), plane.right + beyond_x),
        ((-1.0, 0.0), -plane.left + beyond_x),
        ((0.0, 1.0), plane.top + beyond_y),
        ((0.0, -1.0), -plane.bottom + beyond_y),
    )
    # Outside of a side: n . (x, y) + w z > c, with z < 0 ahead; depth is -z.
    flat = isinstance(camera, OrthographicCamera)
    sides = [(*n, slope if flat else e + slope, radius + (e if flat else 0.0)) for n, e in edges]
    sides.append((0.0, 0.0, 1.0, -lens.near))
    if np.isfinite(lens.far):
        sides.append((0.0, 0.0, -1.0, lens.far))
    return sides


def covered_by(boxes: Sequence[NDArray], camera: Camera, lens: Lens) -> NDArray[np.bool_]:
    """Return (H, W) the pixels that boxes may cover: those in the rectangle around the corners of any of the boxes; in
    a panorama, all of them.

    A box has its corners (8, 3) in the world, in the order of Blender's `bound_box`. One that is in view and reaches
    behind the camera covers all pixels. One that is infinite, or that has a perspective camera inside, covers none,
    because it does not tell where in the picture anything is.
    """
    result = np.zeros((camera.height, camera.width), bool)
    frustum = Frustum(camera, lens)
    camera_from_world = np.linalg.inv(np.asarray(camera.world_from_camera, np.float64))
    for corners in boxes:
        if not np.isfinite(corners).all() or not frustum.may_meet(corners):
            continue
        local = corners @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
        if not isinstance(camera, OrthographicCamera) and _encloses_origin(local):
            continue
        if not is_planar(camera) or (local[:, 2] >= -LEAST_DEPTH).any():
            return np.ones_like(result)
        x, y, _ = camera.px_from_point(tuple(local.T), np.ones(len(local)))
        low, high = (np.array([bound(x), bound(y)]) for bound in (np.min, np.max))
        left, top = np.clip(low - TUNING.frame_margin_pixels, 0, result.shape[::-1]).astype(int)
        right, bottom = np.clip(high + TUNING.frame_margin_pixels, 0, result.shape[::-1]).astype(int)
        result[top:bottom, left:right] = True
    return result


def _encloses_origin(corners: NDArray) -> bool:
    """Return whether a camera stands in a box: whether the origin of camera space lies in it or on its surface.

    corners (8, 3) of the box are in camera space, in the order of Blender's `bound_box`. A flat box has no inside:
    False.
    """
    sides = (corners[[4, 3, 1]] - corners[0]).T
    if np.linalg.matrix_rank(sides) < 3:
        return False
    place = np.linalg.solve(sides, -corners[0])
    return bool(((place >= 0.0) & (place <= 1.0)).all())
