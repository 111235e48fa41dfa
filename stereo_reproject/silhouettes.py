"""Silhouettes: a pixel's colour is filtered over a depth edge while its depth is not, so it cannot be warped.

Cycles' filter gathers samples from beyond the pixel; next to an edge it mixes both sides. What mixes in the source is
another background than what mixes in the target: the band is traced, in either eye, unless its sides look the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .holes import Steps
from .masks import dilate
from .metrics import tone

WINDOW = 3
"""Pixels around an edge pixel, each way, from which the colours of its two sides are taken."""

FEWEST = 4
"""Pixels that a side must have in the window for its colour to be known."""

CHUNK = 1 << 14

ALIKE = 1e-3
"""Difference after tone mapping that nobody sees, noise or not: a quarter of an 8-bit step."""


def edge_band(steps: Steps, *, threshold: float, radius: int) -> NDArray[np.bool_]:
    """(H, W): pixels within `radius` of a step in disparity above `threshold` pixels."""
    if radius <= 0:
        return np.zeros((steps.right.shape[0], steps.down.shape[1]), bool)
    return dilate(steps.beside(threshold), radius - 1)


def differing(
    band: NDArray[np.bool_], disparity: NDArray, colour: NDArray, *, tolerance: float, unknown: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """The pixels of `band` (H, W) around which the near and the far side differ in colour.

    disparity (H, W) tells the sides apart: what is nearer than the middle of the window's range is near. colour
    (H, W, 4) is scene-linear. tolerance is in standard deviations of a side's own pixels, which hold the noise; the
    error of the two means is taken out. Pixels whose window holds one of `unknown` (H, W) stay in.
    """
    if tolerance <= 0.0:
        return band
    result = band.copy()
    height, width = band.shape
    down, right = _window()
    rows, columns = np.nonzero(band)
    texels, depths, gaps = colour.reshape(height * width, -1), disparity.ravel(), unknown.ravel()
    for start in range(0, rows.size, CHUNK):
        i, j = rows[start : start + CHUNK], columns[start : start + CHUNK]
        window = np.clip(i[:, None] + down, 0, height - 1) * width + np.clip(j[:, None] + right, 0, width - 1)
        differs = gaps[window].any(axis=1)
        known = np.nonzero(~differs)[0]
        differs[known] = _sides_differ(tone(texels[window[known]]), depths[window[known]], tolerance)
        result[i, j] = differs
    return result


def _window() -> tuple[NDArray, NDArray]:
    """Offsets of every other pixel around the edge pixel, as on a chessboard: its two sides are well sampled."""
    span = np.arange(-WINDOW, WINDOW + 1)
    down, right = (offset.ravel() for offset in np.meshgrid(span, span, indexing="ij"))
    chosen = (down + right) % 2 == 0
    return down[chosen], right[chosen]


def _sides_differ(colour: NDArray, disparity: NDArray, tolerance: float) -> NDArray[np.bool_]:
    """colour (N, K, 3) and disparity (N, K) of N windows of K pixels."""
    middle = 0.5 * (disparity.min(axis=1) + disparity.max(axis=1))
    near = disparity > middle[:, None]
    mean_near, variance_near, count_near = _moments(colour, near)
    mean_far, variance_far, count_far = _moments(colour, ~near)
    variance = np.minimum(variance_near, variance_far)
    difference = np.mean((mean_near - mean_far) ** 2, axis=1)
    explained = variance_near / count_near + variance_far / count_far
    allowed = np.maximum(tolerance**2 * variance, ALIKE**2)
    return (difference - explained > allowed) | (count_near < FEWEST) | (count_far < FEWEST)


def _moments(colour: NDArray, chosen: NDArray[np.bool_]) -> tuple[NDArray, NDArray, NDArray]:
    """Mean (N, 3), variance over all channels (N,) and count (N,) of the chosen pixels of each window."""
    weight = chosen[..., None].astype(np.float32)
    count = np.maximum(chosen.sum(axis=1), 1).astype(np.float32)
    mean = (colour * weight).sum(axis=1) / count[:, None]
    spread = ((colour - mean[:, None, :]) ** 2 * weight).sum(axis=(1, 2)) / 3.0
    return mean, spread / np.maximum(count - 1.0, 1.0), count
