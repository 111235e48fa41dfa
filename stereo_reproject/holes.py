"""Which target pixels the warp cannot answer for, and why.

A step in depth matters by what it does to the target: it is measured as the difference in disparity, in pixels, that
two neighbours show beyond what the slope of the surface on either side explains. Disparity is linear over the picture
on any plane, so a floor that recedes to the horizon has no step at all, however steep its depth.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from .bands import bands
from .camera import Camera, disparity_per_nearness, target_px_from_source_px
from .masks import dilate
from .rectified import LARGEST
from .warp import Warp

TEAR = 1.0
"""Step in disparity, in pixels, at which a surface is torn rather than stretched."""


class Reason(IntFlag):
    """Why a target pixel is traced; a pixel may have several reasons."""

    DISOCCLUDED = 1
    OUTSIDE = 2
    SILHOUETTE = 4
    TRANSPARENT = 8
    VIEW_DEPENDENT = 16
    VOLUME = 32
    DEFOCUS = 64
    MOTION = 128
    REFINED = 256
    PROBE = 512
    INVALID = 1024

    @property
    def bit(self) -> np.uint16:
        """The flag as what a mask is made of."""
        return np.uint16(self.value)

    @property
    def label(self) -> str:
        """The name that reports and legends use."""
        return str(self.name).lower().replace("_", "-")


@dataclass(frozen=True)
class Steps:
    """Step in disparity, in pixels: right (H, W - 1) to the next pixel in the row, down (H - 1, W) in the column."""

    right: NDArray[np.float32]
    down: NDArray[np.float32]

    def beside(self, threshold: float) -> NDArray[np.bool_]:
        """(H, W): the pixels of every 2 x 2 block that a step above `threshold` runs through.

        The edge itself lies up to a pixel beyond the last centre on the near side, so a diagonal neighbour is as close
        to it as the pixels on either side.
        """
        height, width = self.right.shape[0], self.down.shape[1]
        result = np.zeros((height, width), bool)
        right, down = self.right > threshold, self.down > threshold
        right, down = dilate(right, 1, axes=(0,)), dilate(down, 1, axes=(1,))
        result[:, :-1] |= right
        result[:, 1:] |= right
        result[:-1] |= down
        result[1:] |= down
        return result


def disparity_of(depth: NDArray[np.float32], camera: Camera, other: Camera) -> NDArray[np.float32]:
    """(H, W): how far, in pixels, the surface seen by `camera` moves in the other eye, but for a constant."""
    return disparity_of_nearness(camera.nearness_from_depth(depth), camera, other)


def disparity_of_nearness(nearness: NDArray, camera: Camera, other: Camera) -> NDArray[np.float32]:
    """The same of the nearness (H, W) that `camera` sees."""
    with np.errstate(over="ignore", invalid="ignore"):
        disparity = np.asarray(nearness, np.float32) * np.float32(disparity_per_nearness(camera, other))
    return np.clip(disparity, -LARGEST, LARGEST, out=disparity)


def disparity_steps(disparity: NDArray) -> Steps:
    """Steps in disparity (H, W), in pixels, between neighbours, with the slope of either side taken out.

    NaN where there is no answer: no step is seen there. In place of the paper's Sobel magnitude, which any slanted
    floor exceeds.
    """
    height, width = disparity.shape
    right = np.empty((height, max(width - 1, 0)), np.float32)
    down = np.empty((max(height - 1, 0), width), np.float32)
    for rows in bands(disparity.shape):
        right[rows] = _steps_down(disparity[rows].T).T
        # A row before and two after them tell how the slope bends.
        top, last = max(rows.start - 1, 0), min(rows.stop, height - 1)
        down[rows.start : last] = _steps_down(disparity[top : rows.stop + 2])[rows.start - top : last - top]
    return Steps(right, down)


def _steps_down(disparity: NDArray) -> NDArray[np.float32]:
    """(h - 1, w), of the disparity (h, w)."""
    with np.errstate(invalid="ignore", over="ignore"):
        slope = disparity[1:] - disparity[:-1]
        bend = np.abs(slope[1:] - slope[:-1])
        step = np.abs(slope)
        # A bend that cannot be told (at the border, or beside a pixel without an answer) explains nothing away.
        np.fmin(step[1:], bend, out=step[1:])
        np.fmin(step[:-1], bend, out=step[:-1])
    np.copyto(step, 0.0, where=~(step < np.inf))
    return step


def empty_reasons(warp: Warp, source: Camera, target: Camera) -> NDArray[np.uint16]:
    """(H, W) flags for the target pixels on which nothing landed: outside the source's frame, or disoccluded.

    The grid reaches half a pixel beyond the source's frame: what landed there is outside as well.

    What an empty pixel shows is unknown, but it lies behind its surroundings: the farther of the nearest answers to
    its left and right in the row stands in for its depth, and tells whether the source could have seen it. A row
    without any answer is outside.
    """
    flags = np.empty(warp.nearness.shape, np.uint16)
    for rows in bands(flags.shape):
        x, y, nearness = warp.x[rows], warp.y[rows], warp.nearness[rows]
        beyond = (x < 0) | (x > source.width) | (y < 0) | (y > source.height)
        np.multiply(beyond, Reason.OUTSIDE.bit, out=flags[rows])
        row, column, behind = _behind_empty(nearness)
        if row.size:
            seen = _is_within(source, target, row + rows.start, column, behind)
            flags[rows][row, column] = np.where(seen, Reason.DISOCCLUDED.bit, Reason.OUTSIDE.bit)
    return flags


def _is_within(source: Camera, target: Camera, rows: NDArray, columns: NDArray, nearness: NDArray) -> NDArray[np.bool_]:
    """(N,): whether the source's frame has what the target sees in these pixels; not where the nearness is unknown."""
    known = np.isfinite(nearness)
    sky = target.nearness_from_depth(np.array(np.inf))
    depth = target.depth_from_nearness(np.where(known, nearness, sky).astype(np.float64))
    x, y, _ = target_px_from_source_px(target, source, columns + 0.5, rows + 0.5, depth)
    return known & (x > 0) & (x < source.width) & (y > 0) & (y < source.height)


def _behind_empty(nearness: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """(N,) row and column of the empty pixels of (h, W), and what they have behind them: the smaller nearness of the
    last answer to the left and the first to the right in the row, NaN where there is none."""
    height, width = nearness.shape
    # With a column that is never empty between them, all rows are one.
    empty = np.zeros((height, width + 1), bool)
    np.equal(nearness, -np.inf, out=empty[:, :width])
    flat = empty.ravel()
    starts = np.flatnonzero(np.diff(flat, prepend=False) & flat)
    stops = np.flatnonzero(np.diff(flat, prepend=False) & ~flat)
    row, first = np.divmod(starts, width + 1)
    after = stops - row * (width + 1)
    from_left = np.where(first > 0, nearness[row, np.maximum(first - 1, 0)], np.nan)
    from_right = np.where(after < width, nearness[row, np.minimum(after, width - 1)], np.nan)
    length = after - first
    column = np.arange(length.sum()) - np.repeat(np.cumsum(length) - length - first, length)
    return np.repeat(row, length), column, np.repeat(np.fmin(from_left, from_right), length)
