"""Silhouettes: a pixel's colour is filtered over a depth edge while its depth is not, so it cannot be warped.

Cycles' filter gathers samples from beyond the pixel; next to an edge it mixes both sides. What mixes in the source is
another background than what mixes in the target: the band is traced, in either eye, unless its sides look the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..images.bands import bands
from ..images.masks import dilate
from ..images.metrics import COLOUR_CHANNELS, judged, judged_channels
from ..warp.discontinuities import DepthDiscontinuities
from .tuning import TUNING

CHUNK_WINDOWS = 1 << 11
"""Windows that are compared together: their pixels stay in a processor's cache."""


def edge_band(steps: DepthDiscontinuities, *, threshold: float, radius: int) -> NDArray[np.bool_]:
    """Return (H, W) the pixels within `radius` pixels of a step in disparity above `threshold` pixels; none for a
    radius of 0."""
    if radius <= 0:
        return np.zeros((steps.right.shape[0], steps.down.shape[1]), bool)
    return dilate(steps.mask(threshold), radius - 1)


def differing(
    band: NDArray[np.bool_], disparity: NDArray, colour: NDArray, *, tolerance: float, unknown: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return (H, W) those pixels of `band` (H, W) around which the near and the far side of an edge differ in colour.

    The others look alike on both sides and need not be traced. Around each pixel a window of side_window_pixels (3)
    each way is compared. Its near side are the pixels whose disparity (H, W) is above the middle of the window's range.
    colour (H, W, C >= 3) is scene-linear, with alpha if it has a fourth channel. The sides differ if their mean colours
    and alphas, after tone mapping, are more than `tolerance` standard deviations apart, beyond chance: those of the
    single pixels of the side that varies less. With tolerance 0 all of band is returned. So are pixels that cannot be
    judged: a side is too small, or the window holds a pixel of `unknown` (H, W), whose depth or colour is not known.
    """
    if tolerance <= 0.0:
        return band
    result = band.copy()
    channels = judged_channels(colour, ~unknown)
    texels, depths, gaps = colour.reshape(band.size, -1), disparity.ravel(), unknown.ravel()
    for rows in bands(band.shape):
        pixels = np.flatnonzero(band[rows]) + rows.start * band.shape[1]
        for start in range(0, pixels.size, CHUNK_WINDOWS):
            chosen = pixels[start : start + CHUNK_WINDOWS]
            window = _window_around(chosen, band.shape)
            differs = gaps.take(window).any(axis=0)
            known = np.flatnonzero(~differs)
            window = window[:, known]
            differs[known] = _sides_differ(texels.take(window, axis=0)[..., :channels], depths.take(window), tolerance)
            result.ravel()[chosen] = differs
    return result


def _window_around(pixels: NDArray, shape: tuple[int, int]) -> NDArray:
    """Return (K, N) the indices, in a flattened (H, W) picture, of the K pixels of the window around each of N pixels.

    pixels (N,) are such indices too. Beyond the picture's border the indices are those of the border.
    """
    height, width = shape
    down, right = _window()
    rows, columns = np.divmod(pixels, width)
    return np.clip(rows + down[:, None], 0, height - 1) * width + np.clip(columns + right[:, None], 0, width - 1)


def _window() -> tuple[NDArray, NDArray]:
    """Return the offsets, down (K,) and right (K,), of the window's pixels: every other one, as on a chessboard, is
    enough."""
    span = np.arange(-TUNING.side_window_pixels, TUNING.side_window_pixels + 1)
    down, right = (offset.ravel() for offset in np.meshgrid(span, span, indexing="ij"))
    chosen = (down + right) % 2 == 0
    return down[chosen], right[chosen]


def _sides_differ(colour: NDArray, disparity: NDArray, tolerance: float) -> NDArray[np.bool_]:
    """Return (N,) the windows whose near and far side differ in colour, as `differing` says, or have too few pixels on
    a side.

    colour (K, N, C) and disparity (K, N) are those of N windows of K pixels; NumPy sums long rows fastest.
    """
    middle = 0.5 * (disparity.min(axis=0) + disparity.max(axis=0))
    near = (disparity > middle).astype(np.float32)
    far = 1.0 - near
    count_near, count_far = near.sum(axis=0), far.sum(axis=0)
    known = (count_near >= TUNING.least_side_pixels) & (count_far >= TUNING.least_side_pixels)
    of_near, of_far = np.maximum(count_near, 1.0), np.maximum(count_far, 1.0)
    difference, variance_near, variance_far = (np.zeros(near.shape[1], np.float32) for _ in range(3))
    for channel in np.moveaxis(judged(colour), -1, 0):
        mean_near, mean_far = (channel * near).sum(axis=0) / of_near, (channel * far).sum(axis=0) / of_far
        difference += (mean_near - mean_far) ** 2 / COLOUR_CHANNELS
        of_colour = float(COLOUR_CHANNELS)
        variance_near += ((channel - mean_near) ** 2 * near).sum(axis=0) / (of_colour * np.maximum(of_near - 1.0, 1.0))
        variance_far += ((channel - mean_far) ** 2 * far).sum(axis=0) / (of_colour * np.maximum(of_far - 1.0, 1.0))
    explained = variance_near / of_near + variance_far / of_far
    allowed = np.maximum(tolerance**2 * np.minimum(variance_near, variance_far), TUNING.unseen_difference**2)
    return (difference - explained > allowed) | ~known
