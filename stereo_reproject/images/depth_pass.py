"""Blender's Depth pass of views: the depth of their own cameras from it, and it from that, some rows at a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..views.camera import Array, Camera, is_planar
from ..views.panorama import PanoramicCamera
from .bands import bands
from .passes import DEPTH_PASS, Passes


def with_depth(passes: Passes, camera: Camera) -> Passes:
    """Return a view's passes (H, W, C) with depth as its camera has it, not as Blender's Depth pass has."""
    if DEPTH_PASS not in passes or is_planar(camera):
        return passes
    return {**passes, DEPTH_PASS: _by_rows(camera.depth_from_pass, passes[DEPTH_PASS][..., 0])[..., None]}


def with_depth_at(passes: Passes, camera: Camera, places: NDArray[np.intp]) -> Passes:
    """Return what `with_depth` does for the passes (N, C) of the pixels at places (N, 2), their rows and columns."""
    if DEPTH_PASS not in passes or is_planar(camera):
        return passes
    y, x = places.T + 0.5
    depth = camera.depth_from_pass(x, y, passes[DEPTH_PASS][..., 0])
    return {**passes, DEPTH_PASS: depth[..., None].astype(np.float32)}


def with_depth_pass(passes: Passes, camera: Camera) -> Passes:
    """Return passes (H, W, C) whose depth is that of Blender's Depth pass, from the camera's own."""
    if DEPTH_PASS not in passes or is_planar(camera):
        return passes
    return {**passes, DEPTH_PASS: _by_rows(camera.pass_from_depth, passes[DEPTH_PASS][..., 0])[..., None]}


def distances(camera: PanoramicCamera, depth_pass: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the distances (H, W) from the camera's own place, from a panorama's Depth pass (H, W), which has them, or
    from that of a perspective camera with spherical stereo, which has the depth along the axis."""
    if not camera.around_world:
        return depth_pass

    def distance(x: Array, y: Array, value: Array) -> Array:
        return camera.distance_from_depth(x, y, camera.depth_from_pass(x, y, value))

    return _by_rows(distance, depth_pass)


def _by_rows(convert: Callable[[Array, Array, Array], Array], values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return what `convert` makes of the pixel positions x, y of some rows and the values (H, W) there."""
    result = np.empty(values.shape, np.float32)
    x = np.arange(values.shape[1]) + 0.5
    for rows in bands(values.shape):
        result[rows] = convert(x, np.arange(rows.start, rows.stop)[:, None] + 0.5, values[rows])
    return result
