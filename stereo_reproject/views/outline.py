"""Pixels that triangles cover, at least: where things are in a picture that is not rendered yet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .camera import Camera

SMALL_SIDE_PX = 4
"""Pixels that a triangle may be wide and high for all of the rectangle around it to count as covered."""

NEAREST_DEPTH_SHARE = 1e-4
"""Depth at which triangles are cut off that reach behind the camera, as a share of the depth of the farthest corner."""


def covered_pixels(points: NDArray[np.floating], triangles: NDArray[np.integer], camera: Camera) -> NDArray[np.bool_]:
    """Return (H, W) the pixels of which triangles cover any part, and some right beside those.

    points (N, 3) are corners in the world, and triangles (M, 3) their indices. What hides a triangle is not looked at.
    Of one that is partly behind the camera, the rectangle around what is ahead counts.
    """
    transform = np.linalg.inv(camera.world_from_camera)
    local = points @ transform[:3, :3].T + transform[:3, 3]
    corners = local[triangles]
    ahead = -corners[..., 2]
    nearest = NEAREST_DEPTH_SHARE * max(float(ahead.max(initial=0.0)), 0.0)
    whole = (ahead > nearest).all(axis=1) & (nearest > 0.0)
    partly = (ahead > nearest).any(axis=1) & ~whole
    x, y = _projected(corners[whole], camera)
    box_x, box_y = _projected(_cut_off(corners[partly], nearest), camera)
    covered = _rectangles(box_x, box_y, camera)
    small = (np.ptp(x, axis=1) <= SMALL_SIDE_PX) & (np.ptp(y, axis=1) <= SMALL_SIDE_PX)
    covered |= _rectangles(x[small], y[small], camera)
    for corner_x, corner_y in zip(x[~small], y[~small], strict=True):
        _draw(covered, corner_x, corner_y)
    return covered


def _projected(corners: NDArray[np.floating], camera: Camera) -> tuple[NDArray, NDArray]:
    """Return pixel positions x, y (M, K) of points (M, K, 3) in camera space."""
    x, y, _ = camera.px_from_point(tuple(np.moveaxis(corners, -1, 0)), np.ones(corners.shape[:-1]))  # pyright: ignore[reportArgumentType] - three parts
    return x, y


def _cut_off(corners: NDArray[np.floating], nearest: float) -> NDArray[np.floating]:
    """Return the points (M, 6, 3) at which the sides of triangles (M, 3, 3) begin and end ahead of this depth."""
    ends = []
    for first in range(3):
        one, other = corners[:, first], corners[:, (first + 1) % 3]
        depth, far = -one[:, 2], -other[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.clip((nearest - depth) / (far - depth), 0.0, 1.0)
        crossing = one + np.nan_to_num(share)[:, None] * (other - one)
        crossing[:, 2] = np.minimum(crossing[:, 2], -nearest)
        ends += [
            np.where((depth > nearest)[:, None], one, crossing),
            np.where((far > nearest)[:, None], other, crossing),
        ]
    # A side that is behind as a whole has two ends that stand for nothing; those of another side take their place.
    found = np.stack(ends, axis=1)
    behind = np.stack(
        [(corners[:, k, 2] >= -nearest) & (corners[:, (k + 1) % 3, 2] >= -nearest) for k in range(3)], axis=1
    )
    valid = ~np.repeat(behind, 2, axis=1)
    substitute = found[np.arange(len(found)), valid.argmax(axis=1)]
    return np.where(valid[..., None], found, substitute[:, None])


def _rectangles(x: NDArray, y: NDArray, camera: Camera) -> NDArray[np.bool_]:
    """Return (H, W) the pixels that the rectangles around points x, y (M, K) reach."""
    count = np.zeros((camera.height + 1, camera.width + 1), np.int32)
    if x.size:
        left, right = (
            np.clip(each, 0, camera.width).astype(int) for each in (np.floor(x.min(1)), np.floor(x.max(1)) + 1)
        )
        top, below = (
            np.clip(each, 0, camera.height).astype(int) for each in (np.floor(y.min(1)), np.floor(y.max(1)) + 1)
        )
        for rows, columns, sign in ((top, left, 1), (top, right, -1), (below, left, -1), (below, right, 1)):
            np.add.at(count, (rows, columns), sign)
    return count.cumsum(axis=0).cumsum(axis=1)[:-1, :-1] > 0


def _pixels_reached(at: NDArray, size: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first pixel that positions (..., K) along one axis reach, and the one after the last, within a picture
    of this size."""
    first, last = np.floor(at.min(axis=-1)), np.floor(at.max(axis=-1)) + 1.0
    return np.clip(first, 0, size).astype(np.intp), np.clip(last, 0, size).astype(np.intp)


def _draw(covered: NDArray[np.bool_], x: NDArray, y: NDArray) -> None:
    """Set the pixels of a mask (H, W) of which a triangle with corners x, y (3,) covers any part, and some right beside
    its corners."""
    height, width = covered.shape
    left, right = _pixels_reached(x, width)
    top, below = _pixels_reached(y, height)
    rows, columns = np.mgrid[top + 0.5 : below, left + 0.5 : right]
    inside = np.ones(rows.shape, bool)
    turn = np.sign((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])) or 1.0
    for first in range(3):
        step_x, step_y = x[(first + 1) % 3] - x[first], y[(first + 1) % 3] - y[first]
        side = turn * (step_x * (rows - y[first]) - step_y * (columns - x[first]))
        # A pixel reaches half of its width and height beyond its centre.
        inside &= side >= -0.5 * (abs(step_x) + abs(step_y))
    covered[top:below, left:right] |= inside
