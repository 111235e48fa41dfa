"""Silhouettes: a pixel's colour is filtered over a depth edge while its depth is not, so it cannot be warped.

Cycles' filter gathers samples from beyond the pixel; next to an edge it mixes both sides. What mixes in the source is
another background than what mixes in the target. Most pixels beside an edge hardly mix: in the source, a pixel's own
colour tells (`mixed_and_contrasting`). In the target, the colours of the two sides must do (`differing`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..images.bands import over_bands
from ..images.masks import dilate
from ..images.metrics import COLOUR_CHANNELS, judged, judged_channels
from ..warp.discontinuities import DepthDiscontinuities
from .tuning import TUNING

CHUNK_WINDOWS = 1 << 11
"""Windows that are compared together: their pixels stay in a processor's cache."""

CHESSBOARD_STEP = 2
"""Pixels of a window of odd width, counted row by row, from one field of a chessboard's colour to the next."""


def edge_band(steps: DepthDiscontinuities, *, threshold: float, radius: int) -> NDArray[np.bool_]:
    """Return (H, W) the pixels within `radius` pixels of a step in disparity above `threshold` pixels; none for a
    radius of 0."""
    if radius <= 0:
        return np.zeros((steps.right.shape[0], steps.down.shape[1]), bool)
    return dilate(steps.mask(threshold), radius - 1)


def mixed_and_contrasting(
    band: NDArray[np.bool_], disparity: NDArray, colour: NDArray, *, tolerance: float, unknown: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return two masks (H, W) of pixels of `band` (H, W): those whose own colour is mixed of the two sides of the edge
    beside them, and those beside an edge of high contrast.

    Around each pixel a window of side_window_pixels (3) each way is divided into a near and a far side, at the middle
    of its range of disparity (H, W). The pixel is mixed if its colour is off from the mean colour of its own side
    towards that of the other side, by more than `tolerance` (`Accuracy.colour_tolerance`) standard deviations: those of
    single pixels' noise on the side that has less. The sides must differ by more than that too. Of high contrast is an
    edge whose sides differ by contrast_ratio times as much: moved within the pixel, it would show. Pixels of `band` are
    left out of the means, as they may be mixed themselves, unless the other side has no others.

    colour (H, W, C >= 3) is scene-linear, with alpha if it has a fourth channel; both are compared, after tone mapping.
    A pixel whose own side has too few pixels
    outside of the band, as on a wire, is judged by the two sides as in `differing`. Pixels whose window holds one of
    `unknown` (H, W), whose depth or colour is not known, are set in both masks. With tolerance 0 all of band is.
    """
    if tolerance <= 0.0:
        return band, band
    judge = partial(_own_is_mixed, tolerance=tolerance)
    mixed, contrasting = _judged_windows(_Picture(colour, disparity, unknown, band), _window(), judge, 2)
    return mixed, contrasting


def differing(
    band: NDArray[np.bool_], disparity: NDArray, colour: NDArray, *, tolerance: float, unknown: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return (H, W) those pixels of `band` (H, W) around which the near and the far side of an edge differ in colour.

    The others look alike on both sides and need not be traced. Around each pixel a window of side_window_pixels (3)
    each way is compared. Its near side are the pixels whose disparity (H, W) is above the middle of the window's range.
    colour (H, W, C >= 3) is scene-linear, with alpha if it has a fourth channel. The sides differ if their mean colours
    and alphas, after tone mapping, are more than indirect_tolerance_share (a quarter) of `tolerance`
    (`Accuracy.colour_tolerance`) standard deviations apart, beyond chance: those of the single pixels of the side that
    varies less. With tolerance 0 all of band is returned. So are pixels that cannot be judged: a side is too small, or
    the window holds a pixel of `unknown` (H, W), whose depth or colour is not known.
    """
    if tolerance <= 0.0:
        return band
    judge = partial(_sides_differ, tolerance=tolerance)
    return _judged_windows(_Picture(colour, disparity, unknown, band), _window()[:, ::CHESSBOARD_STEP], judge, 1)[0]


class _Picture(NamedTuple):
    """A picture whose pixels are judged: its scene-linear colour (H, W, >= 3), its disparity (H, W), the pixels (H, W)
    of which these are unknown, and the band (H, W) of those that are judged."""

    colour: NDArray
    disparity: NDArray
    unknown: NDArray[np.bool_]
    band: NDArray[np.bool_]


def _judged_windows(
    picture: _Picture, offsets: NDArray, judge: Callable[[NDArray, NDArray, NDArray], NDArray[np.bool_]], count: int
) -> list[NDArray[np.bool_]]:
    """Return as many masks (H, W) as `count` says of the pixels of the picture's band for which `judge` returns True,
    or whose window holds a pixel that is unknown.

    offsets (2, K), down and right, are those of a window's pixels. judge takes N windows: the colours (C, K, N) by
    which their pixels are judged (tone-mapped light, and alpha where that differs in the picture), the disparities (K,
    N) and the pixels (K, N) outside of the band; it returns (count, N). The picture is worked on by bands of rows.
    """
    band, width = picture.band, picture.band.shape[1]
    channels = judged_channels(picture.colour, ~picture.unknown)
    masks = [band.copy() for _ in range(count)]

    def judge_rows(rows: slice) -> None:
        top = max(rows.start - TUNING.side_window_pixels, 0)
        part = slice(top, rows.stop + TUNING.side_window_pixels)
        pixels = np.flatnonzero(band[rows]) + (rows.start - top) * width
        if not pixels.size:
            return
        colour = np.moveaxis(judged(picture.colour[part])[..., :channels], -1, 0).reshape(channels, -1)
        depths, gaps, borders = (image[part].ravel() for image in picture[1:])
        for start in range(0, pixels.size, CHUNK_WINDOWS):
            chosen = pixels[start : start + CHUNK_WINDOWS]
            window = _window_around(chosen, band[part].shape, offsets)
            known = np.flatnonzero(~gaps.take(window).any(axis=0))
            window = window[:, known]
            found = judge(colour.take(window, axis=1), depths.take(window), ~borders.take(window))
            for mask, flagged in zip(masks, found, strict=True):
                mask.ravel()[chosen[known] + top * width] = flagged

    over_bands(band.shape, judge_rows)
    return masks


def _window_around(pixels: NDArray, shape: tuple[int, int], offsets: NDArray) -> NDArray:
    """Return (K, N) the indices, in a flattened (H, W) picture, of the K pixels of the window around each of N pixels.

    pixels (N,) are such indices too; offsets (2, K) are as for `_judged_windows`. Beyond the picture's border the
    indices are those of the border.
    """
    height, width = shape
    down, right = offsets
    rows, columns = np.divmod(pixels, width)
    return np.clip(rows + down[:, None], 0, height - 1) * width + np.clip(columns + right[:, None], 0, width - 1)


def _window() -> NDArray:
    """Return the offsets (2, K), down and right, of a window's pixels, row by row; the pixel itself is in the middle.

    Every second of them, from the first one, lie as on a chessboard, the pixel itself among them.
    """
    span = np.arange(-TUNING.side_window_pixels, TUNING.side_window_pixels + 1)
    return np.stack([offset.ravel() for offset in np.meshgrid(span, span, indexing="ij")])


def _own_is_mixed(
    colour: NDArray, disparity: NDArray, clean: NDArray[np.bool_], *, tolerance: float
) -> NDArray[np.bool_]:
    """Return (2, N) the windows whose middle pixel is mixed, and those with an edge of high contrast, as
    `mixed_and_contrasting` says.

    colour (C, K, N), as it is judged, and disparity (K, N) are those of N windows of K pixels. clean (K, N) are the
    pixels outside of the band.
    """
    middle = len(disparity) // 2
    near = disparity > 0.5 * (disparity.min(axis=0) + disparity.max(axis=0))
    of_own = near == near[middle]
    own, other = of_own & clean, ~of_own & clean
    noise = _noise(colour, own, other)
    scarce = other.sum(axis=0) < TUNING.least_side_pixels
    own, other = own.astype(np.float32), np.where(scarce, ~of_own, other).astype(np.float32)
    count_own, count_other = own.sum(axis=0), other.sum(axis=0)
    difference, towards = (np.zeros(near.shape[1], np.float32) for _ in range(2))
    for channel in colour:
        mean_own = (channel * own).sum(axis=0) / np.maximum(count_own, 1.0)
        mean_other = (channel * other).sum(axis=0) / np.maximum(count_other, 1.0)
        difference += (mean_other - mean_own) ** 2 / COLOUR_CHANNELS
        towards += (channel[middle] - mean_own) * (mean_other - mean_own) / COLOUR_CHANNELS
    allowed = np.maximum(tolerance**2 * noise, TUNING.unseen_difference**2)
    beyond_chance = difference - noise / np.maximum(count_own, 1.0)
    mixed = (beyond_chance > allowed) & (towards > np.sqrt(allowed * difference))
    result = np.stack([mixed, beyond_chance > TUNING.contrast_ratio**2 * allowed])
    few = np.flatnonzero((count_own < TUNING.least_side_pixels) | (count_other == 0.0))
    chessboard = (image[..., ::CHESSBOARD_STEP, :].take(few, axis=-1) for image in (colour, disparity, clean))
    result[:, few] = _sides_differ(*chessboard, tolerance=tolerance)
    return result


def _noise(colour: NDArray, own: NDArray[np.bool_], other: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return (N,) the variance that noise gives a single pixel, on the side of N windows where it is smaller.

    colour (C, K, N), as it is judged, is that of windows of K pixels. own and other (K, N) are the pixels of either
    side that count; where `other` has few pairs of neighbours, `own` alone tells. It is half of the mean squared
    difference of neighbours, so that a shade or a texture, which changes little from a pixel to the next, is no noise.
    """
    side = round(colour.shape[1] ** 0.5)
    grid = colour.reshape(len(colour), side, side, -1)
    result = []
    for mask in (own.reshape(side, side, -1), other.reshape(side, side, -1)):
        squares, count = np.zeros(mask.shape[-1], np.float32), np.zeros(mask.shape[-1], np.float32)
        for here, there in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
            pairs = (mask[here] & mask[there]).astype(np.float32)
            count += pairs.sum(axis=(0, 1))
            for channel in grid:
                step = channel[here] - channel[there]
                squares += (step * step * pairs).sum(axis=(0, 1)) / (2.0 * COLOUR_CHANNELS)
        result.append((squares / np.maximum(count, 1.0), count))
    (of_own, _), (of_other, pairs_of_other) = result
    return np.where(pairs_of_other < TUNING.least_side_pixels, of_own, np.minimum(of_own, of_other))


def _sides_differ(
    colour: NDArray, disparity: NDArray, _clean: NDArray[np.bool_], *, tolerance: float
) -> NDArray[np.bool_]:
    """Return (1, N) the windows whose near and far side differ in colour, as `differing` says, or have too few pixels
    on a side.

    colour (C, K, N), as it is judged, and disparity (K, N) are those of N windows of K pixels; NumPy sums long rows
    fastest.
    """
    middle = 0.5 * (disparity.min(axis=0) + disparity.max(axis=0))
    near = (disparity > middle).astype(np.float32)
    far = 1.0 - near
    count_near, count_far = near.sum(axis=0), far.sum(axis=0)
    known = (count_near >= TUNING.least_side_pixels) & (count_far >= TUNING.least_side_pixels)
    difference, variance_near, variance_far = (np.zeros(near.shape[1], np.float32) for _ in range(3))
    for channel in colour:
        mean_near, varies_near = _mean_and_variance(channel, near, count_near)
        mean_far, varies_far = _mean_and_variance(channel, far, count_far)
        difference += (mean_near - mean_far) ** 2 / COLOUR_CHANNELS
        variance_near += varies_near / COLOUR_CHANNELS
        variance_far += varies_far / COLOUR_CHANNELS
    explained = variance_near / np.maximum(count_near, 1.0) + variance_far / np.maximum(count_far, 1.0)
    least = TUNING.indirect_tolerance_share * tolerance
    allowed = np.maximum(least**2 * np.minimum(variance_near, variance_far), TUNING.unseen_difference**2)
    return ((difference - explained > allowed) | ~known)[None]


def _mean_and_variance(channel: NDArray, side: NDArray[np.float32], count: NDArray) -> tuple[NDArray, NDArray]:
    """Return the mean (N,) and the variance of a single pixel (N,) over one side of each window.

    channel (K, N) is one channel of the colour. side (K, N) is 1 for the pixels that count, else 0; count (N,) is their
    number.
    """
    mean = (channel * side).sum(axis=0) / np.maximum(count, 1.0)
    return mean, ((channel - mean) ** 2 * side).sum(axis=0) / np.maximum(count - 1.0, 1.0)
