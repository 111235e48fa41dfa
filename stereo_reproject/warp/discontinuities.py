"""Depth discontinuities between neighbouring pixels, measured by what they do to the target.

A step is the difference in disparity, in pixels, between two neighbours, beyond what the slope of the surface on either
side explains. Disparity is linear over the picture on any plane, so a floor that recedes to the horizon has no step at
all, however steep its depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..images.bands import bands
from ..images.masks import dilate
from ..views.camera import Camera, disparity_per_nearness
from .scanline import LARGEST_NEARNESS
from .tuning import TUNING


@dataclass(frozen=True)
class DepthDiscontinuities:
    """Steps in disparity between neighbouring pixels, in pixels, 0 or more.

    right (H, W - 1) are those to the next pixel in the row, down (H - 1, W) those to the one below.
    """

    right: NDArray[np.float32]
    down: NDArray[np.float32]

    def torn(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return the pairs of neighbours between which a surface is torn and not stretched: right (H, W - 1) and down
        (H - 1, W)."""
        return self.right > TUNING.tear_pixels, self.down > TUNING.tear_pixels

    def mask(self, threshold: float) -> NDArray[np.bool_]:
        """Return (H, W) the pixels at an edge of depth: all of every 2 x 2 block that a step above `threshold` pixels
        runs through.

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
    """Return (H, W) the disparity between `camera` and `other`, in pixels, of what `camera` sees at depth (H, W).

    It is known up to a constant, and is larger for what is nearer.
    """
    return disparity_of_nearness(camera.nearness_from_depth(depth), camera, other)


def disparity_of_nearness(nearness: NDArray, camera: Camera, other: Camera) -> NDArray[np.float32]:
    """Return (H, W) the disparity between `camera` and `other`, in pixels, of what `camera` sees at nearness (H, W).

    It is known up to a constant, and is larger for what is nearer.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        disparity = np.asarray(nearness, np.float32) * np.float32(disparity_per_nearness(camera, other))
    return np.clip(disparity, -LARGEST_NEARNESS, LARGEST_NEARNESS, out=disparity)


def disparity_steps(disparity: NDArray) -> DepthDiscontinuities:
    """Return the steps of a disparity (H, W), in pixels, beyond what the slope of the surface on either side explains.

    Beside NaN, which is an unknown disparity, there is no step. The paper has a Sobel magnitude here, which any slanted
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
    return DepthDiscontinuities(right, down)


def _steps_down(disparity: NDArray) -> NDArray[np.float32]:
    """Return (h - 1, w) the steps between each pixel of a disparity (h, w) and the one below it, as `disparity_steps`
    says."""
    with np.errstate(invalid="ignore", over="ignore"):
        slope = disparity[1:] - disparity[:-1]
        bend = np.abs(slope[1:] - slope[:-1])
        step = np.abs(slope)
        # A bend that cannot be told (at the border, or beside a pixel without an answer) explains nothing away.
        np.fmin(step[1:], bend, out=step[1:])
        np.fmin(step[:-1], bend, out=step[:-1])
    np.copyto(step, 0.0, where=~(step < np.inf))
    return step
