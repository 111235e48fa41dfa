"""Motion vectors of a panorama: how far the direction from the camera's own place to a point turns between frames.

Blender has them of the camera itself, whichever eye sees the point. Source: Cycles, `camera_motion_vector`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..views.camera import Array
from ..views.panorama import PANORAMA_FROM_CAMERA, PanoramicCamera
from ..views.projections import Equirectangular


def motion_from_angles(
    turned: NDArray[np.float32], camera: PanoramicCamera, x: Array, y: Array, depth: Array, size: tuple[float, float]
) -> NDArray[np.float32]:
    """Return motion vectors (N, 4), in pixels, from changes (N, 4) of longitude, to the right, and of latitude.

    The changes are in radians. The points are seen at pixel positions x, y (N,) of an eye and at this depth (N,), +inf
    for the sky. size is width and height, in pixels, of the camera's whole picture.
    """
    projection = camera.projection
    if isinstance(projection, Equirectangular):
        (west, east), (south, north) = projection.longitudes, projection.latitudes
        per_radian = np.array([size[0] / (east - west), size[1] / (north - south)])
        return (turned * np.tile(per_radian, 2)).astype(np.float32)
    origin, direction = (np.stack(np.broadcast_arrays(*part, x)[:3], axis=-1) for part in camera.ray_from_px(x, y))
    nearness = camera.nearness_from_depth(np.asarray(depth, np.float64))[:, None]
    ahead, left, up = PANORAMA_FROM_CAMERA @ (direction + nearness * origin).T
    longitude, latitude = -np.arctan2(left, ahead), np.arctan2(up, np.hypot(ahead, left))

    def place(right: Array, upwards: Array) -> NDArray[np.floating]:
        turn, rise = longitude + right, latitude + upwards
        u, v = projection.uv_from_direction((np.cos(rise) * np.cos(turn), -np.cos(rise) * np.sin(turn), np.sin(rise)))
        return np.stack([size[0] * u, size[1] * v], axis=-1)

    now, before = place(np.zeros_like(longitude), np.zeros_like(latitude)), place(turned[:, 0], turned[:, 1])
    after = place(-turned[:, 2], -turned[:, 3])
    return np.concatenate([before - now, now - after], axis=-1).astype(np.float32)
