"""Passes, looked up where a warp says: filtered for colours, nearest for what must not be mixed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .masks import dilate

BAND = 64
"""Rows looked up at a time, so that the temporaries stay in a processor's cache."""


def lookup(image: NDArray[np.float32], x: NDArray, y: NDArray, *, interpolation: str = "linear") -> NDArray[np.float32]:
    """`image` (H, W, C) at pixel positions x, y (h, w); NaN positions give 0. interpolation: linear, cubic, nearest.

    linear is bilinear, cubic the Catmull-Rom spline, which keeps more of the sharpness at the price of noise; it
    overshoots, and is held within the range of the pixels that it looks at, 4 x 4 of them. Outside the picture its
    border is repeated.
    """
    kernel = {"linear": _linear_taps, "cubic": _cubic_taps, "nearest": _nearest_taps}[interpolation]
    height, width, channels = image.shape
    texels = image.reshape(height * width, channels)
    result = np.empty((*x.shape, channels), np.float32)
    for start in range(0, x.shape[0], BAND):
        rows = slice(start, start + BAND)
        result[rows] = _lookup_band(texels, (height, width), x[rows], y[rows], kernel)
    return result


def touches(mask: NDArray[np.bool_], x: NDArray, y: NDArray, *, share: float) -> NDArray[np.bool_]:
    """(h, w): whether a bilinear lookup at x, y takes more than `share` of its weight from pixels of `mask` (H, W)."""
    result = np.zeros(x.shape, bool)
    rows, columns = np.nonzero(~np.isnan(x))
    at_x, at_y = x[rows, columns], y[rows, columns]
    height, width = mask.shape
    around = dilate(mask, 1)
    near = around[np.clip(at_y.astype(np.int32), 0, height - 1), np.clip(at_x.astype(np.int32), 0, width - 1)]
    rows, columns = rows[near], columns[near]
    if rows.size == 0:
        return result
    weight = lookup(mask[..., None].astype(np.float32), at_x[near][None], at_y[near][None])
    result[rows, columns] = weight[0, :, 0] > share
    return result


def _lookup_band(texels: NDArray, size: tuple[int, int], x: NDArray, y: NDArray, kernel) -> NDArray[np.float32]:
    height, width = size
    answered = ~(np.isnan(x) | np.isnan(y))
    columns, weights_x = kernel(np.where(answered, x, 0.5).ravel())
    rows, weights_y = kernel(np.where(answered, y, 0.5).ravel())
    total = np.zeros((columns[0].size, texels.shape[1]), np.float32)
    limits = (np.full_like(total, np.inf), np.full_like(total, -np.inf)) if kernel is _cubic_taps else None
    for row, weight_y in zip(rows, weights_y, strict=True):
        base = np.clip(row, 0, height - 1) * width
        for column, weight_x in zip(columns, weights_x, strict=True):
            weight = weight_x * weight_y
            if np.any(weight):
                taken = texels[base + np.clip(column, 0, width - 1)]
                if limits:
                    # A mask takes its time.
                    looked_at = True if weight.all() else (weight != 0.0)[:, None]
                    for limit, extreme in zip(limits, (np.minimum, np.maximum), strict=True):
                        extreme(limit, taken, out=limit, where=looked_at)
                total += taken * weight[:, None]
    if limits:
        np.clip(total, *limits, out=total)
    total[~answered.ravel()] = 0.0
    return total.reshape(*x.shape, -1)


def _linear_taps(position: NDArray) -> tuple[list[NDArray], list[NDArray]]:
    first, t = _split(position)
    return [first, first + 1], [1.0 - t, t]


def _cubic_taps(position: NDArray) -> tuple[list[NDArray], list[NDArray]]:
    first, t = _split(position)
    t2, t3 = t * t, t * t * t
    weights = [-0.5 * t3 + t2 - 0.5 * t, 1.5 * t3 - 2.5 * t2 + 1.0, -1.5 * t3 + 2.0 * t2 + 0.5 * t, 0.5 * t3 - 0.5 * t2]
    return [first - 1, first, first + 1, first + 2], weights


def _nearest_taps(position: NDArray) -> tuple[list[NDArray], list[NDArray]]:
    return [np.floor(position).astype(np.int64)], [np.ones_like(position)]


def _split(position: NDArray) -> tuple[NDArray, NDArray]:
    """Index of the pixel whose centre is at or before the position, and how far past it, 0..1."""
    shifted = position - np.float32(0.5)
    floor = np.floor(shifted)
    return floor.astype(np.int64), (shifted - floor).astype(np.float32)
