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

from .camera import Camera, disparity_per_nearness, target_px_from_source_px
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
        """(H, W): the pixels on either side of a step above `threshold`."""
        height, width = self.right.shape[0], self.down.shape[1]
        result = np.zeros((height, width), bool)
        right, down = self.right > threshold, self.down > threshold
        result[:, :-1] |= right
        result[:, 1:] |= right
        result[:-1] |= down
        result[1:] |= down
        return result


def disparity_steps(nearness: NDArray, per_nearness: float) -> Steps:
    """Steps in disparity between neighbours, with the slope of either side taken out.

    nearness (H, W) as a camera's `nearness_from_depth` gives it, -inf or NaN where there is no answer (no step is
    seen there); per_nearness as `camera.disparity_per_nearness` gives it. In place of the paper's Sobel magnitude,
    which any slanted floor exceeds.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        disparity = (nearness * per_nearness).astype(np.float32)
    return Steps(_steps_along_rows(disparity), _steps_along_rows(disparity.T).T)


def _steps_along_rows(disparity: NDArray) -> NDArray[np.float32]:
    with np.errstate(invalid="ignore"):
        slope = np.diff(disparity, axis=1)
        bend = np.abs(np.diff(slope, axis=1))
    step = np.abs(slope)
    # A bend that cannot be told (at the border, or beside a pixel without an answer) explains nothing away.
    before = np.nan_to_num(bend, nan=np.inf, posinf=np.inf)
    step[:, 1:] = np.minimum(step[:, 1:], before)
    step[:, :-1] = np.minimum(step[:, :-1], before)
    return np.nan_to_num(step, nan=0.0, posinf=0.0)


def dilate(mask: NDArray[np.bool_], radius: int) -> NDArray[np.bool_]:
    """The mask and what lies within `radius` pixels of it, in the square sense that a separable pixel filter has."""
    result = mask
    for axis in (0, 1):
        grown = result.copy()
        for shift in range(1, radius + 1):
            ahead = [slice(None), slice(None)]
            behind = [slice(None), slice(None)]
            ahead[axis], behind[axis] = slice(shift, None), slice(None, -shift)
            grown[tuple(ahead)] |= result[tuple(behind)]
            grown[tuple(behind)] |= result[tuple(ahead)]
        result = grown
    return result


def empty_reasons(warp: Warp, source: Camera, target: Camera) -> NDArray[np.uint16]:
    """(H, W) flags for the target pixels on which nothing landed: outside the source's frame, or disoccluded.

    What an empty pixel shows is unknown, but it lies behind its surroundings: the farther of the nearest answers to
    its left and right in the row stands in for its depth, and tells whether the source could have seen it.
    """
    flags = np.zeros(warp.x.shape, np.uint16)
    rows, columns = np.nonzero(~warp.covered)
    if rows.size == 0:
        return flags
    behind = _farther_neighbour(warp.nearness)[rows, columns]
    depth = target.depth_from_nearness(np.where(np.isfinite(behind), behind, 0.0).astype(np.float64))
    x, y, _ = target_px_from_source_px(target, source, columns + 0.5, rows + 0.5, depth)
    with np.errstate(invalid="ignore"):
        seen = (x > 0) & (x < source.width) & (y > 0) & (y < source.height)
    flags[rows, columns] = np.where(seen, Reason.DISOCCLUDED.bit, Reason.OUTSIDE.bit)
    return flags


def _farther_neighbour(nearness: NDArray) -> NDArray:
    """(H, W): the smaller of the last answer to the left and the first to the right, NaN where a row has none."""
    answered = nearness > -np.inf
    width = nearness.shape[1]
    index = np.where(answered, np.arange(width), -1)
    left = np.maximum.accumulate(index, axis=1)
    index = np.where(answered, np.arange(width), width)
    right = np.minimum.accumulate(index[:, ::-1], axis=1)[:, ::-1]
    rows = np.arange(nearness.shape[0])[:, None]
    from_left = np.where(left >= 0, nearness[rows, np.maximum(left, 0)], np.nan)
    from_right = np.where(right < width, nearness[rows, np.minimum(right, width - 1)], np.nan)
    return np.fmin(from_left, from_right)


def source_silhouettes(steps: Steps, *, threshold: float, radius: int) -> NDArray[np.bool_]:
    """(H, W) source pixels whose colour is filtered over a step in disparity above `threshold` pixels."""
    return dilate(steps.beside(threshold), radius - 1) if radius > 0 else np.zeros_like(steps.beside(threshold))


def target_silhouettes(
    warp: Warp, empty: NDArray[np.uint16], target: Camera, source: Camera, *, threshold: float, radius: int
) -> NDArray[np.bool_]:
    """(H, W) target pixels that a plain render would filter over a step in disparity, judged by the warped depth."""
    if radius <= 0:
        return np.zeros(warp.x.shape, bool)
    steps = disparity_steps(warp.nearness, disparity_per_nearness(target, source))
    beside = steps.beside(threshold) | ((empty & Reason.DISOCCLUDED.bit) > 0)
    beside = dilate(beside, 1) if np.any(empty) and radius == 1 else beside
    return dilate(beside, radius - 1) if radius > 1 else beside
