"""Sharpness of a lookup: the cubic kernel where the picture stands above its noise, the linear one where noise rules.

Between pixels a linear lookup blurs what is fine and evens out what is noise; a cubic one keeps more of both. With l
and c the two values, d = c - l, s² the variance of a source pixel's noise, and <a, b> the sum of the products of two
lookups' weights, the mean square error of l + k d against the scene itself is smallest for

    k = (D - s² <l, d>) / (D + s² <d, d>),    D = the mean of d² around the pixel, less s² <d, d>,

if what is left of d² without the noise is what the linear lookup has lost (a Wiener filter between the two).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .bands import by_bands, over_bands
from .contrast import box_sum
from .lookup import lookup, variance_share, weight_product
from .metrics import COLOUR_CHANNELS, channel_sum, judged, squared_error
from .tuning import TUNING


@dataclass(frozen=True)
class Sharpness:
    """Sharpness of a picture that was looked up between its pixels. All arrays are (h, w), by target pixel.

    cubic is the share, 0 to 1, of the cubic lookup in the best mixture of it and the linear one. lost is the detail
    that a lookup may lose: the mean square of the difference between both, after `metrics.tone` and without what noise
    explains of it, over 3 x 3 pixels. noise is the variance that noise gives a single pixel of the source there, after
    `metrics.tone`.
    """

    cubic: NDArray[np.float32]
    lost: NDArray[np.float32]
    noise: NDArray[np.float32]


def sharpness_of(
    colour: NDArray[np.float32],
    linear: NDArray[np.float32],
    cubic: NDArray[np.float32],
    x: NDArray[np.float32],
    y: NDArray[np.float32],
) -> Sharpness:
    """Return the sharpness of a picture that was looked up at the positions x, y (h, w), in pixels.

    colour (H, W, >= 3) is the scene-linear picture; linear and cubic (h, w, >= 3) are its values at these positions.
    Where a position is NaN nothing is lost, and the cubic share is 0, as it is where both lookups are equal all around.
    """
    known = ~(np.isnan(x) | np.isnan(y))
    variance = lookup(pixel_noise(colour)[..., None], x, y, interpolation="nearest")[..., 0]
    linear_alone, between = (weight_product(x, y, "linear", other) for other in ("linear", "cubic"))
    of_difference = variance_share(x, y, interpolation="cubic") - 2.0 * between + linear_alone
    beyond_noise = by_bands(_beyond_noise, cubic, linear, variance, of_difference, known)

    def sums_within(reach: tuple[int, int]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return box_sum(beyond_noise, reach), box_sum(known, reach)

    wide = sums_within(TUNING.sharpness_reach_px)
    share = by_bands(_best_share, *wide, variance, of_difference, between - linear_alone, known)
    return Sharpness(share, by_bands(_lost, *sums_within(TUNING.detail_reach_px), known), variance)


def _beyond_noise(
    cubic: NDArray, linear: NDArray, variance: NDArray, of_difference: NDArray, known: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return (h, w) the squared difference between two lookups (h, w, C) that noise does not explain; 0 where a pixel
    is not known.

    variance (h, w) is that of a pixel's noise, of_difference (h, w) the share of it that the difference has.
    """
    return np.where(known, squared_error(cubic, linear) - variance * of_difference, 0.0)


def _lost(total: NDArray, count: NDArray, known: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return (h, w) the mean of a sum over so many pixels, which is no less than 0; 0 where a pixel is not known."""
    return np.where(known, np.maximum(total / np.maximum(count, 1.0), 0.0), 0.0).astype(np.float32)


def _best_share(
    total: NDArray,
    count: NDArray,
    variance: NDArray,
    of_difference: NDArray,
    gained: NDArray,
    known: NDArray[np.bool_],
) -> NDArray[np.float32]:
    """Return (h, w) the share of the cubic lookup in the best mixture, by this module's formula.

    total is the sum of what is beyond noise over count pixels. variance is that of a pixel's noise; of_difference and
    gained are <d, d> and <l, d>. All are (h, w).
    """
    lost = np.maximum(total / np.maximum(count, 1.0), 0.0)
    whole = lost + variance * of_difference
    best = (lost - variance * gained) / np.where(whole > 0.0, whole, 1.0)
    return np.where(known & (whole > 0.0), np.clip(best, 0.0, 1.0), 0.0).astype(np.float32)


def pixel_noise(colour: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (H, W) the variance that noise gives a single pixel of a scene-linear colour (H, W, >= 3), after
    `metrics.tone`, as the mean over a small window around it.

    It is that of the second difference down of the second difference across (Immerkaer 1996, Fast Noise Variance
    Estimation), which is 0 for everything that is straight along either axis: of a picture's detail much less is taken
    for noise than by the variance around a mean. A picture of fewer than three rows or columns has none.
    """
    squared = np.zeros(colour.shape[:2], np.float32)
    if min(squared.shape) < 3:
        return squared

    def square(rows: slice) -> None:
        # A row before and one after them have a say.
        toned = judged(colour[rows.start : rows.stop + 2])
        across = toned[:, 2:] - 2.0 * toned[:, 1:-1] + toned[:, :-2]
        both = across[2:] - 2.0 * across[1:-1] + across[:-2]
        # The squares of the nine weights add up to 36.
        mean = channel_sum((both**2)[..., :COLOUR_CHANNELS]) / COLOUR_CHANNELS
        squared[1:-1, 1:-1][rows] = mean / 36.0

    over_bands(squared[1:-1].shape, square)
    inner = np.zeros_like(squared)
    inner[1:-1, 1:-1] = 1.0
    reach = TUNING.sharpness_reach_px
    return (box_sum(squared, reach) / np.maximum(box_sum(inner, reach), 1.0)).astype(np.float32)


def mixed_variance_share(x: NDArray, y: NDArray, cubic: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (h, w) the share of a pixel's variance that a mixture of a linear and a cubic lookup keeps, as
    `lookup.variance_share` does for one of them.

    x, y (h, w) are the positions in pixels; cubic (h, w), 0 to 1, is the share of the cubic lookup.
    """
    alone, between, other = (
        weight_product(x, y, *pair) for pair in (("linear", "linear"), ("linear", "cubic"), ("cubic", "cubic"))
    )
    linear = np.float32(1.0) - cubic
    return (linear**2 * alone + np.float32(2.0) * linear * cubic * between + cubic**2 * other).astype(np.float32)
