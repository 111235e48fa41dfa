"""Sharpness of a lookup: the cubic kernel where the picture stands above its noise, the linear one where noise rules.

Between pixels a linear lookup blurs what is fine and evens out what is noise; a cubic one keeps more of both. With l
and c the two values, d = c - l, s² the variance of a source pixel's noise, and <a, b> the sum of the products of two
lookups' weights, the mean square error of l + k d against the scene itself is smallest for

    k = (D - s² <l, d>) / (D + s² <d, d>),    D = the mean of d² around the pixel, less s² <d, d>,

if what is left of d² without the noise is what the linear lookup has lost (a Wiener filter between the two).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .bands import bands
from .contrast import box_sums
from .lookup import lookup, variance_share, weight_product
from .metrics import squared_error, tone
from .sides import mend_sides
from .tuning import TUNING


@dataclass(frozen=True)
class Sharpness:
    """Sharpness of a picture that was looked up between its pixels. All arrays are (h, w), by target pixel.

    cubic is the share, 0 to 1, of the cubic lookup in the best mixture of it and the linear one. lost is the detail
    that a lookup may lose: the mean square of the difference between both, after `metrics.tone` and without what noise
    explains of it, over 3 x 3 pixels. noise is the variance that noise gives a single pixel of the source there, after
    `metrics.tone`. single are the pixels that a single pixel of the source was taken for (`images.grain`), None where
    that was not asked for.
    """

    cubic: NDArray[np.float32]
    lost: NDArray[np.float32]
    noise: NDArray[np.float32]
    single: NDArray[np.bool_] | None = None

    def of_columns(self, columns: NDArray[np.intp]) -> Sharpness:
        """Return the sharpness of some columns of the picture, whose indices are given."""
        single = None if self.single is None else self.single[:, columns]
        cubic, lost, noise = (image[:, columns] for image in (self.cubic, self.lost, self.noise))
        return Sharpness(cubic, lost, noise, single)


def sharpness_of(
    source_noise: NDArray[np.float32],
    linear: NDArray[np.float32],
    cubic: NDArray[np.float32],
    x: NDArray[np.float32],
    y: NDArray[np.float32],
    *,
    wraps: bool = False,
) -> Sharpness:
    """Return the sharpness of a picture that was looked up at the positions x, y (h, w), in pixels.

    source_noise (H, W) is the `pixel_noise` of the picture; linear and cubic (h, w, >= 3) are its scene-linear colours
    at these positions. wraps: True where what was looked up goes on at its left beyond its right side.
    Where a position is NaN nothing is lost, and the cubic share is 0, as it is where both lookups are equal all around.
    """
    known = ~(np.isnan(x) | np.isnan(y))
    variance = lookup(source_noise[..., None], x, y, interpolation="nearest")[..., 0]
    # Variances of noise in the difference of both lookups, and how much less than in a linear lookup it is.
    of_difference, less_noise = (np.empty(known.shape, np.float32) for _ in range(2))
    beyond_noise = np.empty(known.shape)
    for rows in bands(known.shape):
        linear_alone, between = (weight_product(x[rows], y[rows], "linear", other) for other in ("linear", "cubic"))
        of_difference[rows] = variance_share(x[rows], y[rows], interpolation="cubic") - 2.0 * between + linear_alone
        less_noise[rows] = between - linear_alone
        explained = variance[rows] * of_difference[rows]
        beyond_noise[rows] = np.where(known[rows], squared_error(cubic[rows], linear[rows]) - explained, 0.0)

    def lost_within(reach: tuple[int, int]) -> Iterator[tuple[slice, NDArray[np.float64]]]:
        """Yield, for bands of rows, their slice and the mean (h, w) of what is beyond noise over the known pixels of a
        window, `reach` pixels each way."""
        pixels = box_sums(known.__getitem__, known.shape, reach)
        for (rows, total), (_, count) in zip(
            box_sums(beyond_noise.__getitem__, known.shape, reach), pixels, strict=True
        ):
            yield rows, np.maximum(total / np.maximum(count, 1.0), 0.0)

    share, near = (np.empty(known.shape, np.float32) for _ in range(2))
    for rows, lost in lost_within(TUNING.sharpness_reach_px):
        whole = lost + variance[rows] * of_difference[rows]
        best = (lost - variance[rows] * less_noise[rows]) / np.where(whole > 0.0, whole, 1.0)
        share[rows] = np.where(known[rows] & (whole > 0.0), np.clip(best, 0.0, 1.0), 0.0)
    for rows, lost in lost_within(TUNING.detail_reach_px):
        near[rows] = np.where(known[rows], lost, 0.0)

    def of_columns(columns: NDArray[np.intp]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        strip = sharpness_of(source_noise, *(image[:, columns] for image in (linear, cubic, x, y)))
        return strip.cubic, strip.lost

    mend_sides((share, near), of_columns, wraps=wraps)
    return Sharpness(share, near, variance)


def pixel_noise(colour: NDArray[np.float32], *, wraps: bool = False) -> NDArray[np.float32]:
    """Return (H, W) the variance that noise gives a single pixel of a scene-linear colour (H, W, >= 3), after
    `metrics.tone`, as the mean over a small window around it. One that wraps goes on at its left beyond its right side.

    It is that of the second difference down of the second difference across (Immerkaer 1996, Fast Noise Variance
    Estimation), which is 0 for everything that is straight along either axis: of a picture's detail much less is taken
    for noise than by the variance around a mean. A picture of fewer than three rows or columns has none.
    """
    squared = np.zeros(colour.shape[:2], np.float32)
    if min(squared.shape) < 3:
        return squared
    inner = np.zeros(squared.shape, bool)
    inner[1:-1, 1:-1] = True
    for rows in bands(squared.shape):
        first, last = max(rows.start, 1), min(rows.stop, len(squared) - 1)
        toned = tone(colour[first - 1 : last + 1])
        across = toned[:, 2:] - 2.0 * toned[:, 1:-1] + toned[:, :-2]
        both = across[2:] - 2.0 * across[1:-1] + across[:-2]
        # The squares of the nine weights add up to 36.
        squared[first:last, 1:-1] = np.mean(both**2, axis=-1) / 36.0
    result, reach = np.empty_like(squared), TUNING.sharpness_reach_px
    totals, counts = (box_sums(image.__getitem__, squared.shape, reach) for image in (squared, inner))
    for (rows, total), (_, count) in zip(totals, counts, strict=True):
        result[rows] = total / np.maximum(count, 1.0)
    mend_sides([result], lambda columns: [pixel_noise(colour[:, columns])], wraps=wraps)
    return result


def mixed_variance_share(x: NDArray, y: NDArray, cubic: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (h, w) the share of a pixel's variance that a mixture of a linear and a cubic lookup keeps, as
    `lookup.variance_share` does for one of them.

    x, y (h, w) are the positions in pixels; cubic (h, w), 0 to 1, is the share of the cubic lookup.
    """
    result = np.empty(x.shape, np.float32)
    for rows in bands(x.shape):
        alone, between, other = (
            weight_product(x[rows], y[rows], *pair)
            for pair in (("linear", "linear"), ("linear", "cubic"), ("cubic", "cubic"))
        )
        share = cubic[rows]
        linear = np.float32(1.0) - share
        result[rows] = linear**2 * alone + np.float32(2.0) * linear * share * between + share**2 * other
    return result
