"""Motion vectors of a panorama: how far the direction from the camera's own place to a point turns between frames.

Blender has them of the camera itself, whichever eye sees the point. Source: Cycles, `camera_motion_vector`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..views.camera import Array, Camera, target_px_from_source_px
from ..views.motion import Moving
from ..views.panorama import PANORAMA_FROM_CAMERA, PanoramicCamera
from ..views.projections import Equirectangular
from .forward import Warp


def moves_as_camera(camera: Camera) -> bool:
    """Return whether a camera is an eye whose motion vectors are those of the camera between both eyes."""
    return isinstance(camera, PanoramicCamera) and camera.stereo is not None


def warp_camera_motion(
    vectors: NDArray[np.float64],
    z: NDArray[np.float64],
    warp: Warp,
    source: Moving,
    target: Moving,
    target_depth: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Return the motion vectors (H, W, 4) of an eye for which `moves_as_camera` holds, as `motion.warp_motion` says.

    vectors (H, W, 4), which are changed in place, and z (H, W) are those of the nearest source samples; z, the depth,
    is +inf for the sky. A point has the same vector in both eyes. Between the nearest sample's point and the target
    pixel's, it changes as that of a point that stands still.
    """
    if target.before is not target.now or target.after is not target.now:
        rows, columns = np.mgrid[0.5 : z.shape[0], 0.5 : z.shape[1]]
        here = _standing_still(target, columns, rows, target_depth)
        change = here - _standing_still(source, np.floor(warp.x) + 0.5, np.floor(warp.y) + 0.5, z)
        if np.isfinite(target.now.period_px):
            change[..., ::2] -= target.now.period_px * np.round(change[..., ::2] / target.now.period_px)
        # In some versions the sky has no vectors.
        vectors += np.where((np.isfinite(z) & np.isfinite(target_depth))[..., None], np.nan_to_num(change), 0.0)
    return np.where(warp.covered[..., None], vectors, 0.0).astype(np.float32)


def _standing_still(eye: Moving, x: Array, y: Array, depth: Array) -> NDArray[np.float64]:
    """Return the camera's motion vectors (H, W, 4), in pixels, of points that stand still while it moves. The eye sees
    them at pixel positions x, y and depths (H, W) in the rendered frame."""
    now, before, after = (
        np.stack(target_px_from_source_px(eye.now, _camera_of(camera), x, y, depth)[:2], axis=-1)
        for camera in (eye.now, eye.before, eye.after)
    )
    return np.concatenate([before - now, now - after], axis=-1) * np.array([1.0, -1.0, 1.0, -1.0])


def _camera_of(eye: Camera) -> PanoramicCamera:
    """Return the camera between both eyes."""
    assert isinstance(eye, PanoramicCamera)
    return replace(eye, stereo=None)


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
