"""Motion vectors of a target: how far the point that a pixel shows moves between frames, as the target sees it.

A vector (x, y, z, w) is in pixels, y upwards: (x, y) leads from where the point is to where it was in the previous
frame, (z, w) from where it will be in the next frame to where it is. Source: Cycles, `camera_motion_vector`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..images.lookup import lookup
from ..views.camera import PerspectiveCamera, target_px_from_source_px
from ..views.motion import Moving
from .forward import Warp
from .panorama_motion import moves_as_camera, warp_camera_motion


def warp_motion(
    vector: NDArray[np.float32],
    depth: NDArray[np.float32],
    warp: Warp,
    source: Moving,
    target: Moving,
    target_depth: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Return the target's motion vectors (H, W, 4), in pixels, from those of the nearest source samples; 0 where
    nothing landed.

    vector (H, W, 4) and depth (H, W, 1) are the source's, target_depth (H, W) is the target's; source and target are
    the motions of both cameras. A point is taken to keep its depth, but for the change by the camera's own motion:
    exact for a point that stands still and for one that moves parallel to the picture. The cameras' motion changes
    vectors between the sample's place and the target pixel's, which is added. An eye of spherical stereo has the
    camera's own vectors (`panorama_motion`).
    """
    vectors = lookup(vector, warp.x, warp.y, interpolation="nearest").astype(np.float64)
    z = lookup(depth, warp.x, warp.y, interpolation="nearest")[..., 0].astype(np.float64)
    z = np.where(z > 0.0, z, np.inf)
    if moves_as_camera(target.now):
        return warp_camera_motion(vectors, z, warp, source, target, target_depth)
    x, y = np.floor(warp.x) + 0.5, np.floor(warp.y) + 0.5
    now = target_px_from_source_px(source.now, target.now, x, y, z)
    result = np.zeros_like(vectors)
    for at, sign, source_then, target_then in (
        (0, 1.0, source.before, target.before),
        (2, -1.0, source.after, target.after),
    ):
        _, _, then = target_px_from_source_px(source.now, source_then, x, y, z)
        then_x, then_y = x + sign * vectors[..., at], y - sign * vectors[..., at + 1]
        moved = target_px_from_source_px(source_then, target_then, then_x, then_y, then)
        result[..., at] = sign * (moved[0] - now[0])
        result[..., at + 1] = -sign * (moved[1] - now[1])
    if target.before is not target.now or target.after is not target.now:
        rows, columns = np.mgrid[0.5 : z.shape[0], 0.5 : z.shape[1]]
        here, there = _standing_still(target, columns, rows, target_depth), _standing_still(target, *now)
        # Of the sky Cycles has other vectors (see below).
        result += np.where(np.isfinite(z)[..., None], np.nan_to_num(here - there), 0.0)
    # A point behind a camera has no place in its picture.
    known = np.isfinite(result).all(axis=-1, keepdims=True)
    result = np.where(known, result, vectors)
    return np.where(warp.covered[..., None], result, 0.0).astype(np.float32)


def _standing_still(eye: Moving, x: NDArray, y: NDArray, depth: NDArray) -> NDArray:
    """Return the motion vectors (H, W, 4), in pixels, of points that stand still while the camera moves.

    The points are seen at places x, y and depths (H, W) in the rendered frame.
    """
    before, after = (target_px_from_source_px(eye.now, then, x, y, depth) for then in (eye.before, eye.after))
    return np.stack([before[0] - x, y - before[1], x - after[0], after[1] - y], axis=-1)


def motion_from_directions(
    turned: NDArray[np.float32],
    camera: PerspectiveCamera,
    x: NDArray,
    y: NDArray,
    *,
    sky: NDArray[np.bool_],
    corner: tuple[float, float],
) -> NDArray[np.float32]:
    """Return motion vectors (N, 4) in pixels, converted from what Cycles gives for a custom camera: differences of unit
    directions.

    turned (N, 4) are the x and y of these differences in camera space, at the pixel positions x, y (N,) of a camera
    whose lens does not change. sky (N,) are pixels of what is endlessly far: there Cycles leaves out the division by
    depth, or gives no vector at all (4.5), and positions count from the lower left corner of the whole frame, which
    lies at `corner` in this camera's pixels.
    """
    if np.any(sky & ~turned.any(axis=-1)):
        # What moves in a pixel of the sky is what else is in it.
        sky = np.zeros_like(sky)
    _, through = camera.ray_from_px(x, y)
    ahead = np.stack([np.broadcast_to(part, x.shape) for part in through], axis=-1)
    now = ahead / np.linalg.norm(ahead, axis=-1, keepdims=True)
    places = {
        0: now,
        1: _unit(now[:, :2] + turned[:, :2]),
        -1: _unit(now[:, :2] - turned[:, 2:]),
    }
    px = {when: _raster(camera, place, sky, corner) for when, place in places.items()}
    return np.concatenate([px[1] - px[0], px[0] - px[-1]], axis=-1).astype(np.float32)


def _unit(sideways: NDArray) -> NDArray:
    """Return unit directions (N, 3) that point ahead (z < 0), from their x and y (N, 2)."""
    ahead = np.sqrt(np.clip(1.0 - np.sum(sideways**2, axis=-1, keepdims=True), 0.0, 1.0))
    return np.concatenate([sideways, -ahead], axis=-1)


def _raster(
    camera: PerspectiveCamera, direction: NDArray, sky: NDArray[np.bool_], corner: tuple[float, float]
) -> NDArray:
    """Return positions (N, 2) in pixels, y upwards, counted from `corner`, at which directions (N, 3) are seen.

    In pixels of the sky (N,) they are multiplied by the depth of the unit direction, as Cycles has them.
    """
    dx, dy, dz = direction.T
    x, y, _ = camera.px_from_point((dx, dy, dz), np.ones_like(dx))
    weight = np.where(sky, -dz, 1.0)
    return np.stack([(x - corner[0]) * weight, (corner[1] - y) * weight], axis=-1)
