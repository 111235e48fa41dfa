"""Light that gloss has reflected or a surface has let through, by the light passes of a render.

It is the part of a picture that looks different from each eye. A surface that a Transparent BSDF makes transparent
leaves no trace in these passes: it shows as alpha, and only where the film is transparent.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .contrast import box_sums
from .metrics import COLOUR_CHANNELS, channel_mean, tone, untone
from .passes import COLOUR_PASS, VIEW_DEPENDENT_PASS, Passes
from .tuning import TUNING

LIGHT_PASS_PREFIXES = {
    "glossy": ("Gloss", "Glossy "),
    "transmission": ("Trans", "Transmission "),
}
"""Beginnings of the passes' names by kind of light: up to Blender 4.5, and from 5.0 on."""

MAX_TONE = 0.999
"""Greatest tone-mapped light of a part of a picture: 1 would be infinite light."""

BESIDE = tuple((down, right) for down in (-1, 0, 1) for right in (-1, 0, 1) if (down, right) != (0, 0))
"""Steps, down and across, from a pixel to the eight beside it."""

LIGHT_PASS_SUFFIXES = {"direct": ("Dir", "Direct"), "indirect": ("Ind", "Indirect"), "color": ("Col", "Color")}
"""Ends of those names by part of the light: up to Blender 4.5, and from 5.0 on."""


def light_pass_names(kind: str, part: str) -> tuple[str, ...]:
    """Return the names that a light pass has in the supported versions of Blender, the older version's first.

    kind is a key of LIGHT_PASS_PREFIXES, part one of LIGHT_PASS_SUFFIXES.
    """
    return tuple(start + end for start, end in zip(LIGHT_PASS_PREFIXES[kind], LIGHT_PASS_SUFFIXES[part], strict=True))


def reflected_light(passes: Passes) -> NDArray[np.float32]:
    """Return the light (..., 3) that gloss has reflected or a surface has let through: the sum of the direct and the
    indirect light of both kinds, times its colour, scene-linear.

    passes (..., C) are those of a render. Where they have VIEW_DEPENDENT_PASS already, that is returned. Raises
    KeyError where they lack a light pass.
    """
    if VIEW_DEPENDENT_PASS in passes:
        return passes[VIEW_DEPENDENT_PASS]
    total = np.zeros((*passes[COLOUR_PASS].shape[:-1], 3), np.float32)
    for kind in LIGHT_PASS_PREFIXES:
        direct, indirect, tint = (_light_pass(passes, kind, part)[..., :3] for part in LIGHT_PASS_SUFFIXES)
        total += tint * (direct + indirect)
    return total


def without_sparks(light: NDArray[np.float32], *, wraps: bool = False) -> NDArray[np.float32]:
    """Return scene-linear light (H, W, 3) in which each spark has the mean of the pixels beside it, and what it loses
    is spread over the pixels around, so that their mean stays what it was, after `metrics.tone`. Light without any
    spark is returned as it is.

    A spark is a single pixel that is brighter, after `metrics.tone`, than the brightest pixel beside it by at least
    `min_spark_sigmas` standard deviations of the pixels around. It is chance: one sample in thousands that has met a
    lamp. An error that is seen has more pixels. wraps: True where the picture's right side goes on at its left.
    """
    if wraps:
        # A pixel gets light of a spark, the window of that spark is counted, and pixels around it are judged.
        ahead = 2 * TUNING.spark_loss_reach_px + TUNING.spark_reach_px + 1
        around = light[:, np.arange(-ahead, light.shape[1] + ahead) % light.shape[1]]
        cleaned = without_sparks(around)
        return light if cleaned is around else cleaned[:, ahead:-ahead].copy()
    toned = tone(light)
    brightness = channel_mean(toned)
    above = brightness - _brightest_beside(brightness)
    down, across = np.nonzero((above > 0.0) & (above > TUNING.min_spark_sigmas * _spread_around(brightness)))
    if not down.size:
        return light
    sparks = down, across
    del brightness, above
    beside, reach = _mean_beside(toned, sparks), TUNING.spark_loss_reach_px
    for channel in range(COLOUR_CHANNELS):
        lost = np.zeros(toned.shape[:2], np.float32)
        lost[sparks] = (toned[..., channel][sparks] - beside[:, channel]) / _window_pixels(sparks, reach, lost.shape)
        toned[..., channel][sparks] = beside[:, channel]
        for rows, spread in box_sums(lost.__getitem__, lost.shape, (reach, reach)):
            changed = untone(np.minimum(toned[rows, :, channel] + spread, MAX_TONE))
            toned[rows, :, channel] = np.where(spread > 0.0, changed, light[rows, :, channel])
    return toned


def _window_pixels(
    place: tuple[NDArray[np.intp], NDArray[np.intp]], reach: int, shape: tuple[int, ...]
) -> NDArray[np.intp]:
    """Return how many pixels (N,) of a picture of this shape lie within `reach` pixels each way of N pixels, whose rows
    and columns (N,) are given."""
    down, across = (
        np.minimum(at + reach, size - 1) - np.maximum(at - reach, 0) + 1 for at, size in zip(place, shape, strict=True)
    )
    return down * across


def _brightest_beside(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the largest (H, W) of the up to eight values of an image (H, W) that are beside each pixel; the pixel's
    own where it has none beside it."""
    height, width = image.shape
    padded = np.pad(image, 1, constant_values=-np.inf)
    result = np.full_like(image, -np.inf)
    for down, right in BESIDE:
        np.maximum(result, padded[1 + down : 1 + down + height, 1 + right : 1 + right + width], out=result)
    return np.where(np.isinf(result), image, result)


def _spread_around(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the standard deviation (H, W) of the pixels of an image (H, W) around each pixel, its own left out."""
    result, reach = np.empty_like(image), (TUNING.spark_reach_px, TUNING.spark_reach_px)

    def squares(rows: slice) -> NDArray[np.float64]:
        return image[rows].astype(np.float64) ** 2

    ones = np.ones((1, image.shape[1]), np.uint8)
    counts = box_sums(lambda rows: ones.repeat(rows.stop - rows.start, axis=0), image.shape, reach)
    totals = (box_sums(values, image.shape, reach) for values in (image.__getitem__, squares))
    for (rows, count), (_, total), (_, squared) in zip(counts, *totals, strict=True):
        others = np.maximum(count - 1.0, 1.0)
        mean, square = (total - image[rows]) / others, (squared - squares(rows)) / others
        result[rows] = np.sqrt(np.maximum(square - mean**2, 0.0))
    return result


def _mean_beside(light: NDArray[np.float32], place: tuple[NDArray[np.intp], NDArray[np.intp]]) -> NDArray[np.floating]:
    """Return the mean (N, C) of the up to eight pixels of the light (H, W, C) that are beside each of N pixels, whose
    rows and columns (N,) are given."""
    total, count = np.zeros((place[0].size, light.shape[-1])), np.zeros((place[0].size, 1))
    for offsets in BESIDE:
        inside = np.ones(place[0].size, bool)
        for at, offset, size in zip(place, offsets, light.shape, strict=False):
            inside &= (at + offset >= 0) & (at + offset < size)
        total[inside] += light[tuple(at[inside] + offset for at, offset in zip(place, offsets, strict=True))]
        count[inside] += 1.0
    return total / np.maximum(count, 1.0)


def glossy_mask(source: Passes) -> NDArray[np.float32]:
    """Return a mask (H, W, 1) of pixels that show glossy or transmitted light, 1 there and 0 elsewhere: a plain guess
    at what looks different from each eye, for comparison only. `tradeoff` traces these pixels in place of those that
    probes find.

    A pixel counts where such light is more than `min_glossy_light_share` of its own, or its alpha is neither 0 nor 1.
    Raises KeyError when the source lacks a light pass.
    """
    colour = source[COLOUR_PASS]
    shiny = _brightness(reflected_light(source))
    partial = (colour[..., 3] > 0.0) & (colour[..., 3] < 1.0)
    masked = (shiny > TUNING.min_glossy_light_share * _brightness(colour)) | partial
    return masked[..., None].astype(np.float32)


def _light_pass(source: Passes, kind: str, part: str) -> NDArray[np.float32]:
    """Return a light pass (H, W, C) of the source, by whichever of its names the source has. Raises KeyError without
    it.

    kind and part are as for `light_pass_names`.
    """
    names = light_pass_names(kind, part)
    return source[next((name for name in names if name in source), names[0])]


def _brightness(light: NDArray) -> NDArray[np.float64]:
    """Return the sum (H, W) of the colour channels of light (H, W, >= 3); NaN and infinities count as 0."""
    return np.nan_to_num(light[..., :3].astype(np.float64), posinf=0.0, neginf=0.0).sum(axis=-1)
