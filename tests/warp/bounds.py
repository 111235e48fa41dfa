"""How far off a warped pixel may be, as docs/numerics.md has it, in float64 and by plain projection."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter

from stereo_reproject.views.camera import OrthographicCamera, PerspectiveCamera, disparity_per_nearness
from stereo_reproject.views.parallax import ARC_MINUTE
from stereo_reproject.warp.grid import CELL_QUADS
from stereo_reproject.warp.tuning import TUNING as WARP_TUNING
from tests.warp.exact import where_they_go

ROUNDINGS = 4.0
"""Roundings to float32 on the way to a position, each by half a unit in the last place of the largest number in it:
depth, nearness, how far it moves, where that is."""

THIRD_DIFFERENCES = 1.5
"""How much more than in the middle of a cell its perspective may be off elsewhere: a lens of 8 mm on 200 pixels changes
by a quarter over one."""


def px_per_slope(eye) -> float:
    """Pixels across per unit of x / depth, or of x for an orthographic camera."""
    return eye.width / (eye.plane.right - eye.plane.left)


def per_nearness_allowed(threshold, source, target, near, far):
    """How far the nearness in a coarse cell whose depths are in near..far may reach; see docs/numerics.md.

    threshold in arc minutes; for perspective cameras.
    """
    ipd = np.linalg.norm(source.world_from_camera[:3, 3] - target.world_from_camera[:3, 3])
    with np.errstate(over="ignore", divide="ignore"):
        saturated = 1.0 + (0.5 * ipd / near) * (0.5 * ipd / far)
        return 2.0 * np.tan(0.5 * threshold * ARC_MINUTE) / ipd * saturated


def most_in_a_cell(threshold, source, target, near, far, *, most):
    """Pixels by which a coarse cell of a rectified pair, with depths in near..far, may be off; see docs/numerics.md."""
    ipd = np.linalg.norm(source.world_from_camera[:3, 3] - target.world_from_camera[:3, 3])
    return min(px_per_slope(target) * ipd * per_nearness_allowed(threshold, source, target, near, far), most)


def spread(image, reach):
    """(H, W): the largest within `reach` pixels; NaN is none."""
    return maximum_filter(np.nan_to_num(image), size=2 * reach + 1, mode="nearest")


def bent(moved, index):
    """(H, W) pixels: how far two neighbouring pixels and a straight line between them miss a surface that bends.

    moved (H, W) target positions. An eighth of the second difference along the longest line in a quad, its diagonal:
    d² = xx + 2 xy + yy; the largest around each pixel.
    """
    total = np.zeros(moved.shape)
    for axis in (0, 1):
        if moved.shape[axis] < 3:
            continue
        along, which = np.moveaxis(moved, axis, 0), np.moveaxis(index, axis, 0)
        one = (which[2:] == which[1:-1]) & (which[:-2] == which[1:-1])
        second = np.zeros(along.shape)
        second[1:-1] = np.where(one, np.abs(along[2:] - 2.0 * along[1:-1] + along[:-2]), 0.0)
        # The frame's own is not known; towards an edge it grows.
        second[0], second[-1] = 2.0 * second[1], 2.0 * second[-2]
        total += np.moveaxis(second, 0, axis)
    if min(moved.shape) > 1:
        one = (
            (np.diff(index, axis=0) == 0)[:, 1:]
            & (np.diff(index, axis=1) == 0)[1:]
            & (np.diff(index, axis=0) == 0)[:, :-1]
        )
        total[:-1, :-1] += 2.0 * np.where(one, np.abs(np.diff(np.diff(moved, axis=0), axis=1)), 0.0)
    return 0.125 * spread(total, 2)


@dataclass(frozen=True)
class Limits:
    """(H, W) of the source: by how many pixels of the target what is seen there may land beside its place, by cause.

    native: between its pixels a surface is straight to the warp; within half a pixel of the frame, level. steps: a step
    in disparity that is no edge yet. coarse: what the grid's threshold lets a coarse cell miss, with the perspective
    within one where the image planes do not coincide. stretch: target pixels per source pixel, the least around.
    """

    native: np.ndarray
    steps: np.ndarray
    coarse: np.ndarray
    rounding: np.ndarray
    stretch: np.ndarray

    @property
    def total(self):
        return self.native + self.steps + self.coarse + self.rounding


def limits(depth, index, source, target, grid, *, threshold, step) -> Limits:
    """What docs/numerics.md promises of the warp of a depth map (H, W) that shows the surfaces `index` (H, W)."""
    x, y = where_they_go(source, target, depth)
    native = bent(x, index) + bent(y, index)
    slope = np.zeros(depth.shape)
    stretch = np.ones(depth.shape)
    edge = np.zeros(depth.shape, bool)
    for axis, along in enumerate((y, x)):
        one = np.diff(index, axis=axis) == 0
        # Where a pixel's point would be at its neighbour's depth.
        next_x, next_y = where_they_go(source, target, np.roll(depth, -1, axis=axis))
        change = np.hypot(next_x - x, next_y - y)
        between = np.delete(np.nan_to_num(change), -1, axis=axis)
        slope += beside(np.where(one, between, 0.0), axis, np.maximum, 0.0)
        run = np.nan_to_num(np.diff(along, axis=axis), nan=1.0)
        stretch = np.minimum(stretch, beside(np.where(one, run, 1.0), axis, np.minimum, 1.0))
        edge |= beside(~one, axis, np.logical_or, False)
    ring = np.ones(depth.shape, bool)
    ring[1:-1, 1:-1] = False
    # Half a pixel of the slope, and of what that grows by: eight times an eighth of the second difference.
    native = native + np.where(ring, 0.5 * (slope + 8.0 * native), 0.0)
    steps = np.where(spread(edge.astype(float), 2) > 0, step, 0.0)
    coarse = coarse_misses(depth, x, y, source, target, grid, threshold)
    size = max(source.width, target.width, source.height, target.height)
    reach = np.nan_to_num(np.abs(x)) + np.nan_to_num(np.abs(y)) + size
    shift = shift_terms(depth, source, target)
    rounding = ROUNDINGS * np.finfo(np.float32).eps * (reach + shift)
    return Limits(native, steps, coarse, rounding, -spread(-stretch, 2))


def beside(between, axis, extreme, none):
    """(H, W): of what is between neighbours along an axis, the extreme of a pixel's two."""
    pads = [(0, 0), (0, 0)]
    pads[axis] = (1, 1)
    padded = np.moveaxis(np.pad(between, pads, constant_values=none), axis, 0)
    return np.moveaxis(extreme(padded[1:], padded[:-1]), 0, axis)


def shift_terms(depth, source, target):
    """(H, W) pixels: what a shift is the difference of, which float32 holds each of: by nearness, and of the frame."""
    scale = px_per_slope(target)
    baseline = np.linalg.norm(source.world_from_camera[:3, 3] - target.world_from_camera[:3, 3])
    frame = scale * abs(source.plane.left - target.plane.left)
    if isinstance(source, OrthographicCamera):
        return frame + scale * baseline
    with np.errstate(divide="ignore"):
        return frame + scale * baseline / depth


def coarse_misses(depth, x, y, source, target, grid, threshold):
    """(H, W) pixels: what may be missed in a coarse cell, 0 in the others."""
    height, width = depth.shape
    rows, columns = ((np.arange(size) + 1) // CELL_QUADS for size in (height, width))
    # A position half a pixel beside a centre may be the next cell's.
    coarse = ~grid.subdivided[np.ix_(rows, columns)]
    coarse = spread(coarse.astype(float), 1) > 0
    if not coarse.any():
        return np.zeros(depth.shape)
    known = depth[coarse]
    flat = np.full(depth.shape, np.inf if isinstance(source, PerspectiveCamera) else 1.0)
    sky = bent_within_cell(*where_they_go(source, target, flat))
    sky = np.minimum(sky, THIRD_DIFFERENCES * WARP_TUNING.bend_share * WARP_TUNING.tear_pixels)
    if isinstance(source, OrthographicCamera):
        minute = threshold * ARC_MINUTE / WARP_TUNING.orthographic_width_radians * source.width
        return np.where(coarse, min(minute, WARP_TUNING.tear_pixels) + sky, 0.0)
    step = 1e-4
    moved_x, moved_y = where_they_go(source, target, depth * (1.0 + step))
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.hypot(moved_x - x, moved_y - y) / (1.0 / depth - 1.0 / (depth * (1.0 + step)))
    per_nearness = max(np.nanmax(np.nan_to_num(change[coarse])), disparity_per_nearness(source, target))
    nearest = np.nanmin(known)
    reach = per_nearness_allowed(threshold, source, target, nearest, nearest)
    reach = min(reach, WARP_TUNING.tear_pixels / disparity_per_nearness(source, target)) if per_nearness > 0.0 else 0.0
    return np.where(coarse, per_nearness * reach + sky, 0.0)


def bent_within_cell(x, y):
    """(H, W) pixels by which the perspective of a coarse cell misses: that of a pixel, over CELL_QUADS of them."""
    one = np.zeros(x.shape, int)
    return CELL_QUADS**2 * spread(bent(x, one) + bent(y, one), CELL_QUADS)
