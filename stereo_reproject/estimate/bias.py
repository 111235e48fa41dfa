"""Slow errors of the warped colours: told by many probes together, and taken away.

A reflection on a floor stands elsewhere for the other eye. Beside the noise of a denoised picture that shows, though it
is a fraction of the noise of the probes that tell it; and in a noisy picture it shows where some tiles are traced and
others, as far off, are not. But its sign is the same over many probes: with m the mean of their residuals, m is off by
their noise over the root of their number, and what is left of m beyond that is the bias. Where it is beyond doubt the
warped pixels are corrected by it, and need not be traced.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..images.bands import bands
from ..images.masks import dilate
from .evidence import ProbeTraces
from .probes import Probes
from .tuning import TUNING


@dataclass(frozen=True)
class SourceNoise:
    """Effect of noise on single pixels around each of N probes, after `tone`.

    shift (N, 3) is how much noise changes the mean brightness. It is negative: most samples of a dim corner are black
    and a few are bright, of which `tone` makes little. variance (N,) is that of one noisy pixel. in_warp is the share
    of this variance that the warped pixels have themselves: 0 in a denoised picture, 1 in a noisy one.
    """

    shift: NDArray[np.float64]
    variance: NDArray[np.float64]
    in_warp: NDArray[np.float64] | float = 0.0

    @classmethod
    def of_noisy(cls, variance: NDArray[np.float64]) -> SourceNoise:
        """Return the noise of a picture that is not denoised, by the variance (N,) of its pixels.

        Warped pixels are as noisy as traced ones, so that noise shifts both alike: the shift is 0 and in_warp is 1.
        """
        return cls(np.zeros((variance.size, 3)), variance, in_warp=1.0)


@dataclass(frozen=True)
class Bias:
    """Slow errors of the warped colours, as a correction for each of N tiles.

    added (N, 3) is what is to be added after `tone`. without_own (N, 3) is the same correction as the other tiles'
    probes tell it, to judge a tile by; they may have heard a little of its own within wider reaches, which makes an
    excess too large and never too small. shown (N,) is the number of the material at each tile's probe.
    """

    probes: Probes
    added: NDArray[np.float64]
    without_own: NDArray[np.float64]
    shown: NDArray[np.integer]

    def agreed(self, other: Bias) -> Bias:
        """Return the correction on which two of them agree: the smaller one, and none where one is for darker and one
        for brighter.

        Both must have the same probes.
        """
        return replace(
            self,
            added=_smaller(self.added, other.added),
            without_own=_smaller(self.without_own, other.without_own),
        )

    def at_probes(self, colour: NDArray[np.float32], *, without_own: bool = False) -> NDArray[np.float32]:
        """Return the scene-linear colours (N, C) of the probes' pixels, corrected; colour (N, C >= 3) is not.

        Alpha stays as it is. without_own: True to correct each by what the other tiles' probes tell.
        """
        factor = _factor(colour[..., :3], self.without_own if without_own else self.added)
        return np.concatenate([colour[..., :3] * factor, colour[..., 3:]], axis=-1)

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Pixels (H, W) of the tiles that have a correction and of those around them: nothing else is corrected."""
        corrected = self.probes.on_grid(self.added.any(axis=-1), False)
        return self.probes.over_pixels(dilate(corrected, 1, wraps=self.probes.wraps)[self.probes.tiles], False)

    def correct(
        self,
        light: Sequence[NDArray[np.float32]],
        colour: NDArray[np.float32],
        pixels: NDArray[np.bool_],
        shown: NDArray[np.integer],
    ) -> None:
        """Correct the set `pixels` (H, W) in parts of a picture's light, each (H, W, >= 3), in place: all parts by the
        factors that correct its scene-linear colour (H, W, >= 3), which may be one of them.

        shown (H, W) is the number of the material of each pixel. Between the tiles' middles the correction is
        interpolated, among the tiles that show the same material as the pixel.
        """
        if not self.added.any():
            return
        # Mostly a tenth of the picture, which takes a tenth of the time.
        pixels = pixels & self.reached
        for rows in bands(pixels.shape):
            here, columns = np.nonzero(pixels[rows])
            place = here + rows.start, columns
            factor = _factor(colour[place][:, :3], self._at(*place, shown[place]))
            for image in light:
                image[rows][pixels[rows], :3] *= factor

    def _at(self, rows: NDArray, columns: NDArray, own: NDArray) -> NDArray[np.float64]:
        """Return the correction (P, 3), after `tone`, at P pixels; 0 where no tile around shows the same material.

        rows, columns and own (P,) are their places and the materials that they show.
        """
        height, width = self.probes.tile_grid
        numbers = self.probes.on_grid(np.arange(self.probes.rows.size), -1)
        place_y, place_x = ((p + 0.5) / self.probes.spacing - 0.5 for p in (rows, columns))
        top, left = np.floor(place_y).astype(np.intp), np.floor(place_x).astype(np.intp)
        total, weights = np.zeros((rows.size, 3)), np.zeros(rows.size)
        for down in (0, 1):
            for right in (0, 1):
                y, x = np.clip(top + down, 0, height - 1), left + right
                x = x % width if self.probes.wraps else np.clip(x, 0, width - 1)
                tile = numbers[y, x]
                weight = np.abs(1 - down - (place_y - top)) * np.abs(1 - right - (place_x - left))
                weight *= (tile >= 0) & (self.shown[tile] == own)
                total += weight[:, None] * self.added[tile]
                weights += weight
        return total / np.maximum(weights, 1e-9)[:, None]


def bias_of(
    probes: Probes,
    traces: ProbeTraces,
    contrast: NDArray[np.float32],
    shown: NDArray[np.integer],
    *,
    noise: SourceNoise,
) -> Bias:
    """Return the slow errors of the warped colours, as far as the probes' traces tell them beyond doubt.

    contrast (H, W) is the picture's (`contrast.Contrast.signal`); shown (H, W) is a number for the material of each
    pixel; noise is that of the source's own pixels around each probe. Warped colours that are noisy should be of single
    samples: a mean of two is brighter after `tone`, because it is less noisy.
    """
    known = traces.finite
    w, a, b = (toned[:, :3] for toned in traces.toned(known))
    numbers = shown[probes.rows, probes.columns]
    residual, variance = 0.5 * (a + b) - w - noise.shift, np.mean((a - b) ** 2, axis=-1) / 4.0
    alike = _Neighbours(probes, np.where(known, numbers, -1), known)
    nearby = alike.sum(variance, 2) / np.maximum(alike.sum(np.ones_like(variance), 2), 1.0)
    # A few probes may all have been spared what makes others bright, and seem to be sure that it is dark.
    nearby = np.maximum(nearby, 0.5 * noise.variance) * (1.0 + 2.0 * noise.in_warp)
    share = TUNING.bias_contrast_share
    weight = known / (nearby + share * contrast[probes.rows, probes.columns] + 1e-6)
    added, without_own = np.zeros_like(residual), np.zeros_like(residual)
    for reach in TUNING.bias_reaches_tiles:
        residuals = weight[:, None] * (residual - added)
        total, certainty = alike.sum(residuals, reach), alike.sum(weight, reach)
        without_own += _shrunk_mean(total - residuals, certainty - weight)
        added += _shrunk_mean(total, certainty)
    return Bias(probes, added, without_own, numbers)


def _shrunk_mean(total: NDArray, certainty: NDArray) -> NDArray[np.float64]:
    """Return the mean (N, 3) of residuals, made smaller by as much of it as may be chance (James and Stein).

    total (N, 3) is the residuals' weighted sum, certainty (N,) the sum of their weights. It is 0 where that is 0.
    """
    inverse = 1.0 / np.maximum(certainty, 1e-9)
    mean = total * inverse[:, None]
    size = np.maximum(np.mean(mean**2, axis=-1), 1e-12)
    doubt = TUNING.bias_doubt
    return np.where(certainty > 0.0, np.clip(1.0 - doubt * inverse / size, 0.0, 1.0), 0.0)[:, None] * mean


class _Neighbours:
    """Takes sums over the tiles around each tile, of those whose probes show the same material as its own.

    shown (N,) is the material at each probe; known (N,) are the probes whose traces are numbers.
    """

    def __init__(self, probes: Probes, shown: NDArray, known: NDArray[np.bool_]) -> None:
        self._probes = probes
        self._shown = probes.on_grid(np.where(known, shown, -1), -1)

    def sum(self, values: NDArray, reach: int) -> NDArray[np.float64]:
        """Return for each tile the sum (N, ...) of values (N, ...) over `reach` tiles each way that show its material,
        its own included."""
        probes = self._probes
        grid, shown = (probes.with_sides(tiles, reach) for tiles in (probes.on_grid(values, 0.0), self._shown))
        total = np.zeros_like(grid, np.float64)
        height, width = shown.shape
        far_down, far_right = min(reach, height - 1), min(reach, width - 1)
        for down in range(-far_down, far_down + 1):
            for right in range(-far_right, far_right + 1):
                here = np.s_[max(-down, 0) : height - max(down, 0), max(-right, 0) : width - max(right, 0)]
                there = np.s_[max(down, 0) : height + min(down, 0), max(right, 0) : width + min(right, 0)]
                same = shown[here] == shown[there]
                total[here] += grid[there] * same.reshape(*same.shape, *(1,) * (grid.ndim - 2))
        rows, columns = probes.tiles
        return total[rows, columns + probes.side_tiles(reach)]


def _smaller(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the one of two changes that is closer to 0, and 0 where their signs differ."""
    size = np.minimum(np.abs(one), np.abs(other))
    return np.where(one * other > 0.0, np.copysign(size, one), 0.0)


def _factor(colour: NDArray[np.float32], added: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the factors (P, 3) that change scene-linear colours (P, 3) by as much as adding `added` (P, 3) after
    `tone` would.

    It is 1 where there is no light. With c the colour and s = added (1 + c), tone(c) + added is the tone of (c + s) /
    (1 - s).
    """
    limit = TUNING.max_bias_factor
    light = (colour > 0.0) & (colour < float(np.finfo(np.float32).max) / limit)
    bright = np.where(light, colour, 1.0).astype(np.float64)
    step = added * (1.0 + bright)
    factor = np.where(step < 1.0, (1.0 + step / bright) / np.where(step < 1.0, 1.0 - step, 1.0), limit)
    return np.where(light, np.clip(factor, 1.0 / limit, limit), 1.0).astype(np.float32)
