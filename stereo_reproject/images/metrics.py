"""Differences between two pictures, and between a picture and a plain render of the same view.

`weight` is that of each pixel (`views.solid_angle`): in a panorama a pixel counts by the solid angle that it shows.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..settings.accuracy import DISPLAY_STEP, ROUNDING_VARIANCE
from ..views.solid_angle import PixelWeight

COLOUR_CHANNELS = 3
"""Channels of light in a colour, which come first; the next one, if there is one, is alpha."""

TILE_PX = 16
"""Side of a tile in `worst_tiles` and `wrong_tiles`, in pixels: part of what the metric is, and so never tuned."""

WRONG_TILE_RATIO = 2.0
"""Noise ratio above which a tile is wrong: part of what `wrong_tiles` is, and so never tuned."""

MIN_DISTANCE_FROM_WHITE = 1e-6
"""Least distance from 1, where `tone` has infinitely bright colours, that `untone` takes a colour to have."""


def tone(colour: NDArray) -> NDArray[np.float32]:
    """Return a scene-linear colour (..., C >= 3) tone-mapped to the range 0 to 1: x / (1 + x), (..., 3).

    Errors are measured after it, so that a few bright pixels do not outweigh all others. Alpha is left out (`judged`
    keeps it), and negative light counts as 0.
    """
    positive = np.maximum(np.asarray(colour, np.float32)[..., :3], 0.0)
    # numpy's stubs take the sum of a float32 array and 1.0 for float64.
    return positive / (1.0 + positive)  # pyright: ignore[reportReturnType]


def judged(colour: NDArray) -> NDArray[np.float32]:
    """Return the channels by which a scene-linear colour (..., C >= 3) is judged: its tone-mapped light and its alpha,
    (..., 4), or (..., 3) where it has no alpha.

    Alpha is held within 0 and 1. The colour is premultiplied by it, as Blender has it, so that both are of one scale.
    """
    if colour.shape[-1] < COLOUR_CHANNELS + 1:
        return tone(colour)
    # All channels at once: NumPy takes ten times as long for three of four.
    result = np.maximum(np.asarray(colour[..., : COLOUR_CHANNELS + 1], np.float32), np.float32(0.0))
    alpha = np.minimum(result[..., COLOUR_CHANNELS], np.float32(1.0))
    result[..., COLOUR_CHANNELS] = 0.0
    result /= np.float32(1.0) + result
    result[..., COLOUR_CHANNELS] = alpha
    return result


def judged_channel(colour: NDArray, channel: int) -> NDArray[np.float32]:
    """Return one channel (...) of `judged` of a scene-linear colour (..., C >= 3): of its tone-mapped light, or its
    alpha."""
    if channel == COLOUR_CHANNELS:
        return np.clip(np.asarray(colour[..., channel], np.float32), 0.0, 1.0)
    positive = np.maximum(np.asarray(colour[..., channel], np.float32), 0.0)
    return positive / (1.0 + positive)  # pyright: ignore[reportReturnType] - as in `tone`


def judged_channels(colour: NDArray, known: NDArray[np.bool_]) -> int:
    """Return the number of channels of a colour (H, W, >= 3) that tell its pixels apart: 4 where alpha differs among
    the pixels set in known (H, W), else 3."""
    if colour.shape[-1] < COLOUR_CHANNELS + 1:
        return COLOUR_CHANNELS
    alpha = colour[..., COLOUR_CHANNELS]
    lowest = np.min(alpha, where=known, initial=np.inf)
    return COLOUR_CHANNELS + int(np.max(alpha, where=known, initial=-np.inf) > lowest)


def channel_mean(values: NDArray) -> NDArray:
    """Return the sum of the judged channels (..., 3 or 4) of a square or a product, divided by the three of light: a
    mean over channels that alpha, where it is the same, leaves as it is."""
    return channel_sum(values) / COLOUR_CHANNELS


def channel_sum(values: NDArray) -> NDArray:
    """Return the sum (...) of the few channels of values (..., C), added from the first to the last; 0 without any.

    NumPy's own sum along so short an axis gives the same, and takes ten times as long.
    """
    total = np.zeros(values.shape[:-1], values.dtype)
    for channel in range(values.shape[-1]):
        total += values[..., channel]
    return total


def untone(toned: NDArray) -> NDArray:
    """Return the scene-linear colour (..., 3) of a colour after `tone`: the inverse of `tone`.

    A value that is 1 or nearly so becomes a very bright one, not an infinite one.
    """
    return toned / np.maximum(1.0 - toned, MIN_DISTANCE_FROM_WHITE)


def squared_error(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    """Return the squared difference (..., ) of two scene-linear colours (..., >= 3) after `tone`, as the
    `channel_mean`. That of alpha is among it where both have alpha."""
    channels = min(a.shape[-1], b.shape[-1])
    return channel_mean((judged(a[..., :channels]).astype(np.float64) - judged(b[..., :channels])) ** 2)


def weighted_mean(values: NDArray, weight: PixelWeight | NDArray) -> float:
    """Return the mean of values (...), each by its weight (...), one for all or one for each."""
    if not isinstance(weight, np.ndarray):
        return float(np.mean(values))
    return float(np.sum(values * weight, dtype=np.float64) / np.sum(weight, dtype=np.float64))


def weighted_percentile(values: NDArray, percent: float, weight: NDArray) -> float:
    """Return the value of values (...) below which `percent` of their weight (...) lies, interpolated between two of
    them: that of `numpy.percentile` where all weigh the same. Infinite ones are not interpolated."""
    method = "linear" if np.isfinite(values).all() else "higher"
    if np.all(weight == weight.flat[0]):
        return float(np.percentile(values, percent, method=method))
    order = np.argsort(values, axis=None)
    values, weight = values.ravel()[order], weight.ravel()[order].astype(np.float64)
    place = np.concatenate([[0.0], np.cumsum(0.5 * (weight[1:] + weight[:-1]))])
    wanted = 0.01 * percent * place[-1]
    if method == "higher":
        return float(values[np.searchsorted(place, wanted)])
    return float(np.interp(wanted, place, values))


def rmse(a: NDArray, b: NDArray, weight: PixelWeight = 1.0) -> float:
    """Return the root mean square of the difference of two scene-linear pictures (H, W, >= 3) after `tone`."""
    return float(np.sqrt(weighted_mean(squared_error(a, b), weight)))


def tile_rmse(a: NDArray, b: NDArray, weight: PixelWeight = 1.0) -> NDArray[np.float64]:
    """Return `rmse` of each tile of `TILE_PX` x `TILE_PX` pixels, (R, C) by rows and columns of tiles.

    Tiles at the right and bottom may be smaller.
    """
    error = squared_error(a, b)
    if not isinstance(weight, np.ndarray):
        return np.sqrt(tile_means(error))
    return np.sqrt(tile_means(error * weight) / tile_means(weight))


def tile_means(image: NDArray, side: int = TILE_PX) -> NDArray[np.float64]:
    """Return the mean of an image (H, W) over each tile of side x side pixels, (R, C) by rows and columns of tiles."""
    rows, columns = np.arange(0, image.shape[0], side), np.arange(0, image.shape[1], side)
    total = np.add.reduceat(np.add.reduceat(image, rows, axis=0, dtype=np.float64), columns, axis=1)
    count = np.diff([*rows, image.shape[0]])[:, None] * np.diff([*columns, image.shape[1]])[None, :]
    return total / count


def tile_weights(weight: PixelWeight, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return the mean weight (R, C) of the pixels of each tile of a picture of this shape (H, W, ...)."""
    return tile_means(np.broadcast_to(weight, shape[:2]))


def border_step(picture: NDArray, holes: NDArray[np.bool_]) -> float:
    """Return the mean difference, after `tone`, of neighbours across the borders of `holes` (H, W), to see whether
    seams show.

    picture (H, W, >= 3) is scene-linear. Where a seam shows, the result is above that of a plain render at these
    places, which has edges there too. It is 0 where the holes have no border.
    """
    toned = judged(picture)
    steps = [np.abs(np.diff(toned, axis=axis))[np.diff(holes, axis=axis)] for axis in (0, 1)]
    found = np.concatenate([channel_mean(step) for step in steps])
    return float(found.mean()) if found.size else 0.0


def noise_ratio(ours: NDArray, reference: NDArray, again: NDArray, weight: PixelWeight = 1.0) -> float:
    """Return the noise ratio of a picture: rmse(ours, reference) / rmse(again, reference). 1 is as good as a render.

    All are scene-linear, (H, W, >= 3). reference and again are two plain renders that differ only in their seed.
    Infinite where they are equal and ours differs from them.
    """
    ours_rmse, noise = rmse(ours, reference, weight), rmse(again, reference, weight)
    if noise == 0.0:
        return 1.0 if ours_rmse == 0.0 else float("inf")
    return ours_rmse / noise


def worst_tiles(ours: NDArray, reference: NDArray, again: NDArray, weight: PixelWeight = 1.0) -> float:
    """Return the noise ratio of the worst tiles of a picture: 1 is as good as a render.

    It is the 99th percentile, over tiles, of tile_rmse(ours, reference) / noise; noise is tile_rmse(again, reference),
    but at least its median over all tiles. reference and again are two plain renders that differ only in their seed.
    """
    noise = tile_rmse(again, reference, weight)
    floor = np.maximum(noise, np.median(noise))
    error = tile_rmse(ours, reference, weight)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(floor > 0.0, error / floor, np.where(error > 0.0, np.inf, 1.0))
    return weighted_percentile(ratio, 99.0, tile_weights(weight, ours.shape))


def honest_ratio(
    ours: NDArray, reference: NDArray, again: NDArray, variance_share: NDArray, weight: PixelWeight = 1.0
) -> float:
    """Return the honest ratio of a picture: sqrt(1 + bias^2 / 2), bias in standard deviations of one plain render's
    noise.

    1 is as good as a render. It is the noise ratio that the picture would have if each pixel had all the noise of a
    plain render's: that a lookup has smoothed noise is no merit. variance_share (H, W) is the share of that noise's
    variance that each pixel of ours has. Pictures are scene-linear, (H, W, >= 3); reference and again are two plain
    renders that differ only in their seed. The result is below 1 by chance, and infinite where the two are equal and
    ours differs from them.
    """
    return float(np.sqrt(max(1.0 + 0.5 * _squared_bias(ours, reference, again, variance_share, weight), 0.0)))


def bias_sigmas(honest: float) -> float:
    """Return the bias of a picture with this honest ratio: its error apart from noise, as a root mean square after
    `tone`, in standard deviations of one plain render's noise.

    It is 0 where chance has brought the honest ratio below 1.
    """
    return float(np.sqrt(max(2.0 * (honest**2 - 1.0), 0.0)))


def _squared_bias(
    ours: NDArray, reference: NDArray, again: NDArray, variance_share: NDArray, weight: PixelWeight
) -> float:
    """Return the mean squared bias of a picture over the variance of one plain render's noise, which is taken to be
    ROUNDING_VARIANCE at least; parameters are as for `honest_ratio`.

    With ours w, the plain renders a and b and the share c, (w - a)(w - b) has the mean bias^2 + c var(a), and
    (a - b)^2 / 2 has the mean var(a).
    """
    w, a, b = (judged(colour).astype(np.float64) for colour in (ours, reference, again))
    noise = channel_mean((a - b) ** 2) / 2.0
    squared = weighted_mean(channel_mean((w - a) * (w - b)) - variance_share * noise, weight)
    if not noise.any():
        return 0.0 if squared == 0.0 else float("inf")
    return squared / max(weighted_mean(noise, weight), ROUNDING_VARIANCE)


def wrong_tiles(ours: NDArray, reference: NDArray, again: NDArray, weight: PixelWeight = 1.0) -> float:
    """Return the share, 0 to 1, of a picture's tiles, each by its weight, that are wrong so that it can be seen.

    A tile is if tile_rmse(ours, reference) is above `WRONG_TILE_RATIO` times tile_rmse(again, reference), and above one
    step of an 8-bit picture. reference and again are two plain renders that differ only in their seed.
    """
    error, noise = tile_rmse(ours, reference, weight), tile_rmse(again, reference, weight)
    wrong = (error > WRONG_TILE_RATIO * noise) & (error > DISPLAY_STEP)
    return weighted_mean(wrong, tile_weights(weight, ours.shape))
