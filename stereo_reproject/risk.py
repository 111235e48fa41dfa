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
    toned, mean = tone(colour), mean_of(colour, known)
    weight = known.astype(np.float32)
    pixels = (2 * SMOOTHED + 1) ** 2
    noise = _mean(np.mean((toned - mean) ** 2, axis=-1) * pixels / (pixels - 1.0), weight, REACH)
    variance = np.mean(_mean(mean**2, weight, REACH) - _mean(mean, weight, REACH) ** 2, axis=-1)
    return Contrast(np.maximum(variance - noise / pixels, 0.0) * weight, noise)


def mean_of(colour: NDArray, known: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(H, W, 3): the mean of the known pixels in the 3 x 3 around each, after `tone`."""
    return _mean(tone(colour), known.astype(np.float32), (SMOOTHED, SMOOTHED))


def gradient_of(colour: NDArray, known: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(H, W) change of colour from a pixel to the next in its row, after `tone`, with the noise averaged.

    0 where a neighbour is not known.
    """
    mean = mean_of(colour, known)
    result = np.zeros(mean.shape[:2], np.float32)
    both = known[:, 2:] & known[:, :-2] & known[:, 1:-1]
    difference = np.sqrt(np.mean((mean[:, 2:] - mean[:, :-2]) ** 2, axis=-1)) / 2.0
    result[:, 1:-1] = np.where(both, difference, 0.0)
    return result


def _mean(image: NDArray, weight: NDArray[np.float32], reach: tuple[int, int]) -> NDArray[np.float32]:
    """Mean of (H, W) or (H, W, C) over the pixels within `reach` that have weight; 0 where there are none."""
    weights = weight if image.ndim == 2 else weight[..., None]
    count = box_sum(weights, reach)
    return (box_sum(image * weights, reach) / np.maximum(count, 1e-6)).astype(np.float32)


def box_sum(image: NDArray, reach: tuple[int, int]) -> NDArray[np.float64]:
    """Sum of (H, W[, C]) over the pixels within `reach` of each, down and across; nothing lies beyond the border."""
    result = np.asarray(image, np.float64)
    for axis in (0, 1):
        size = result.shape[axis]
        border = np.zeros_like(result.take([0], axis)) if size else result
        total = np.concatenate([border, np.cumsum(result, axis=axis)], axis=axis)
        place = np.arange(size)
        high, low = np.minimum(place + reach[axis] + 1, size), np.maximum(place - reach[axis], 0)
        result = total.take(high, axis) - total.take(low, axis)
    return result
