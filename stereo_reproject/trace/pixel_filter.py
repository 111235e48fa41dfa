"""Cycles' pixel filters as it samples them: the inverse of each filter's cumulative distribution.

Source: Cycles, `scene/film.cpp` and `util/math_cdf.cpp`; the table is built in the same steps, so that the packed
camera's filtering differs from a plain camera's by rounding alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

TABLE_ENTRIES = 1024
"""Entries of Cycles' own table (FILTER_TABLE_SIZE)."""


def filter_support(kind: str, width: float) -> float:
    """Return the whole width, in pixels, over which a filter gathers samples.

    kind is 'BOX', 'GAUSSIAN' or 'BLACKMAN_HARRIS', width Blender's `filter_width`.
    """
    return {"BOX": 1.0, "GAUSSIAN": 3.0 * width, "BLACKMAN_HARRIS": 2.0 * width}[kind]


def sample_offsets(kind: str, width: float) -> NDArray[np.float32]:
    """Return (1024,) places at which Cycles samples a pixel, for evenly spaced random numbers from 0 to 1.

    They are in pixels from the pixel's left or lower edge, and may lie outside it. kind is 'BOX', 'GAUSSIAN' or
    'BLACKMAN_HARRIS', width Blender's `filter_width`.
    """
    support = filter_support(kind, width)
    steps = TABLE_ENTRIES - 1
    x = 0.5 * support * np.arange(steps) / (steps - 1)
    density = np.abs(_profile(kind, x, support))
    cumulative = np.concatenate([[0.0], np.cumsum(density)])
    cumulative /= cumulative[-1]
    half = (TABLE_ENTRIES - 1) // 2
    u = np.arange(half + 1) / half
    index = np.searchsorted(cumulative, u, side="right")
    last = cumulative.size - 1
    inner = np.minimum(index, last - 1)
    t = np.where(index < last, (u - cumulative[inner]) / (cumulative[inner + 1] - cumulative[inner]), 0.0)
    distance = (np.minimum(index, last) + t) / steps * support
    table = np.zeros(TABLE_ENTRIES)
    table[half : 2 * half + 1] = 0.5 * (1.0 + distance)
    table[half::-1] = 0.5 * (1.0 - distance)
    # Cycles leaves the last entry out, which costs it one sample in a thousand; here it ends where it should.
    table[-1] = table[-2]
    return table.astype(np.float32)


def _profile(kind: str, x: NDArray, support: float) -> NDArray:
    """Return the filter's weight at distances x (N,), in pixels, from the pixel's centre; the weights have no common
    scale.

    support is the whole width of the filter, in pixels.
    """
    if kind == "BOX":
        return np.ones_like(x)
    if kind == "GAUSSIAN":
        return np.exp(-2.0 * (6.0 * x / support) ** 2)
    phase = 2.0 * np.pi * (x / support + 0.5)
    return 0.35875 - 0.48829 * np.cos(phase) + 0.14128 * np.cos(2.0 * phase) - 0.01168 * np.cos(3.0 * phase)
