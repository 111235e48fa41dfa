"""Where a warped picture would be wrong if what it shows had moved: what probes are placed by and tiles are judged by.

A reflection, a refraction or a highlight stands elsewhere for the other eye than its surface. However far it has
moved, the error is no larger than the picture's own contrast there: the inside of a highlight may move unseen, its rim
may not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .metrics import tone

SMOOTHED = 1
"""Pixels each way over which noise is averaged before contrast is looked at."""

REACH = (2, 5)
"""Pixels, down and across, over which contrast is gathered: eyes stand side by side, so most moves are across."""


@dataclass(frozen=True)
class Contrast:
    """Variance (H, W) around each pixel, after `tone`: of what the picture shows, and of its noise."""

    signal: NDArray[np.float32]
    noise: NDArray[np.float32]


def contrast_of(colour: NDArray, known: NDArray[np.bool_]) -> Contrast:
    """Of the scene-linear colour (H, W, >= 3), looking only at pixels where known (H, W) is set.

    The noise is told by how far a pixel is from its 3 x 3 mean; what of it that mean still has is taken out of the
    signal.
    """
    toned = tone(colour)
    near, far = _Window(known, (SMOOTHED, SMOOTHED)), _Window(known, REACH)
    pixels = (2 * SMOOTHED + 1) ** 2
    noise, variance = (np.zeros(known.shape, np.float32) for _ in range(2))
    for channel in range(3):
        mean = near.mean(toned[..., channel])
        noise += far.mean((toned[..., channel] - mean) ** 2) * pixels / (pixels - 1.0) / 3.0
        variance += (far.mean(mean**2) - far.mean(mean) ** 2) / 3.0
    return Contrast(np.maximum(variance - noise / pixels, 0.0) * known, noise)


def gradient_of(colour: NDArray, known: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(H, W) change of colour from a pixel to the next in its row, after `tone`, with the noise averaged.

    0 where a neighbour is not known.
    """
    toned, near = tone(colour), _Window(known, (SMOOTHED, SMOOTHED))
    squared = np.zeros((known.shape[0], max(known.shape[1] - 2, 0)), np.float32)
    for channel in range(3):
        mean = near.mean(toned[..., channel])
        squared += (mean[:, 2:] - mean[:, :-2]) ** 2 / 3.0
    result = np.zeros(known.shape, np.float32)
    result[:, 1:-1] = np.where(known[:, 2:] & known[:, :-2] & known[:, 1:-1], np.sqrt(squared) / 2.0, 0.0)
    return result


class _Window:
    """Means over the pixels within `reach`, down and across, that are known (H, W)."""

    def __init__(self, known: NDArray[np.bool_], reach: tuple[int, int]) -> None:
        self._weight, self._reach = known.astype(np.float32), reach
        self._count = np.maximum(box_sum(self._weight, reach), 1e-6)

    def mean(self, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """Of (H, W), around each pixel; 0 where none is known."""
        return (box_sum(image * self._weight, self._reach) / self._count).astype(np.float32)


def box_sum(image: NDArray, reach: tuple[int, int]) -> NDArray[np.float64]:
    """Sum of (H, W) over the pixels within `reach` of each, down and across; nothing lies beyond the border."""
    result = np.asarray(image, np.float64)
    for axis, running_sums in enumerate((_running_sums_down, _running_sums_across)):
        total, size = running_sums(result), result.shape[axis]
        place = np.arange(size)
        high, low = np.minimum(place + reach[axis] + 1, size), np.maximum(place - reach[axis], 0)
        result = total.take(high, axis) - total.take(low, axis)
    return result


def _running_sums_down(image: NDArray[np.float64]) -> NDArray[np.float64]:
    """(H + 1, W): the sums of the rows above each, row by row: numpy's own, which goes down columns, takes eight times
    as long."""
    total = np.zeros((image.shape[0] + 1, image.shape[1]))
    for row in range(image.shape[0]):
        np.add(total[row], image[row], out=total[row + 1])
    return total


def _running_sums_across(image: NDArray[np.float64]) -> NDArray[np.float64]:
    """(H, W + 1): the sums of what is to the left of each in its row."""
    total = np.zeros((image.shape[0], image.shape[1] + 1))
    np.cumsum(image, axis=1, out=total[:, 1:])
    return total
