"""Probes: a sparse set of pixels, traced twice, that tell how far the warped pixels are off beyond noise.

With w the warped value of a pixel and a, b two independent traces of it, all after tone mapping,

    error  = (w - a)(w - b)      has the mean   bias^2 + var(w),
    noise  = (a - b)^2 / 2       has the mean   var(a), the variance of one traced pixel,
    excess = error - noise       is what tracing the pixel would save: negative where the warp is the less noisy.

A plain render of the whole eye differs from another by 2 var(a). So, with W the warped pixels,

    noise ratio^2 = 1 + sum over W of excess / sum over all of 2 noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .metrics import tone

RESAMPLES = 1000
OPTIMISM_RESAMPLES = 40
CONFIDENCE = 0.95

LOUDEST = 25.0
"""How many times the others' mean noise a probe's may be. One firefly in one trace is more than that of a whole frame:
taken as it is, nothing would seem wrong beside it."""

AIM = 0.8
"""Share of the promised excess that refinement leaves: the rest is for what a sparse set of probes cannot tell."""


@dataclass(frozen=True)
class Probes:
    """Where the probes are: one in each tile of `spacing` pixels that has a warped pixel.

    rows, columns (N,) are in the order in which a mask of the probes would name them.
    """

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    spacing: int
    shape: tuple[int, int]

    @property
    def mask(self) -> NDArray[np.bool_]:
        result = np.zeros(self.shape, bool)
        result[self.rows, self.columns] = True
        return result

    @property
    def tiles(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Row and column (N,) of each probe's tile."""
        return self.rows // self.spacing, self.columns // self.spacing


def place_probes(warped: NDArray[np.bool_], *, spacing: int, seed: int) -> Probes:
    """One probe at a random warped pixel of each tile: stratified, so that no part of the picture is left out.

    warped (H, W): the pixels that are not traced anyway.
    """
    height, width = warped.shape
    rng = np.random.default_rng(seed)
    rows, columns = np.nonzero(warped)
    order = rng.permutation(rows.size)
    rows, columns = rows[order], columns[order]
    tile = (rows // spacing) * -(-width // spacing) + columns // spacing
    _, first = np.unique(tile, return_index=True)
    rows, columns = rows[first], columns[first]
    in_rows = np.lexsort((columns, rows))
    return Probes(rows[in_rows], columns[in_rows], spacing, (height, width))


@dataclass(frozen=True)
class Measured:
    """What the probes say, per probe (N,): excess and noise as above, and the warped pixels that each stands for."""

    probes: Probes
    excess: NDArray[np.float64]
    noise: NDArray[np.float64]
    weight: NDArray[np.float64]
    traced: int
    """Pixels of the frame that are traced anyway."""


def measure(probes: Probes, warped: NDArray[np.bool_], w: NDArray, a: NDArray, b: NDArray) -> Measured:
    """w, a, b (N, >= 3) are the scene-linear colours of the probes' pixels; warped (H, W) as in `place_probes`.

    A probe with a value that is no number says nothing: it counts as neither error nor noise.
    """
    known = np.isfinite(w).all(axis=-1) & np.isfinite(a).all(axis=-1) & np.isfinite(b).all(axis=-1)
    w, a, b = (tone(np.where(known[:, None], colour, 0.0)).astype(np.float64) for colour in (w, a, b))
    error = np.mean((w - a) * (w - b), axis=-1)
    noise = _capped(np.mean((a - b) ** 2, axis=-1) / 2.0)
    s = probes.spacing
    edges = [np.arange(0, size, s) for size in warped.shape]
    count = np.add.reduceat(np.add.reduceat(warped.astype(np.int64), edges[0], axis=0), edges[1], axis=1)
    return Measured(probes, error - noise, noise, count[probes.tiles].astype(np.float64), int((~warped).sum()))


def _capped(noise: NDArray[np.float64]) -> NDArray[np.float64]:
    others = (noise.sum() - noise) / max(noise.size - 1, 1)
    return np.where(others > 0.0, np.minimum(noise, LOUDEST * others), noise)


@dataclass(frozen=True)
class Estimate:
    """Noise ratio of the frame with its confidence interval, and the same as excess: noise ratio^2 - 1."""

    noise_ratio: float
    low: float
    high: float

    @property
    def excess(self) -> float:
        return self.noise_ratio**2 - 1.0


@dataclass(frozen=True)
class Choice:
    """Which probes' tiles are to be traced (N,), and the estimate of the frame's noise ratio when they are."""

    refined: NDArray[np.bool_]
    estimate: Estimate


def choose_refined(measured: Measured, promise: float, *, seed: int) -> Choice:
    """As few tiles as bring the noise ratio down to `promise`, worst first.

    A tile is judged by the mean excess of the 3 x 3 tiles around it. Choosing by what was measured flatters what
    remains: how much is learned from choices made on resampled probes and judged on the measured ones (the optimism of
    B. Efron, "Estimating the error rate of a prediction rule", 1983), and is added to the estimate.
    """
    if measured.excess.size == 0 or measured.noise.sum() <= 0.0:
        # Without noise there is no ratio to it: whatever is off at all is traced.
        return Choice(measured.excess > 0.0, Estimate(1.0, 1.0, 1.0))
    rng = np.random.default_rng(seed)
    scale = 2.0 * _total_noise(measured)
    order, remaining = _remaining(measured, np.ones(measured.excess.size))
    optimism = np.mean([_optimism(measured, rng) for _ in range(OPTIMISM_RESAMPLES)], axis=0)
    expected = (remaining + optimism) / scale
    count = 0
    if expected[0] > promise**2 - 1.0:
        aim = (1.0 + AIM * (promise - 1.0)) ** 2 - 1.0
        reached = np.nonzero(expected <= aim)[0]
        count = int(reached[0]) if reached.size else int(np.argmin(expected))
    refined = np.zeros(order.size, bool)
    refined[order[:count]] = True
    return Choice(refined, _estimate(measured, refined, float(expected[count]), rng))


def estimate(measured: Measured, *, seed: int) -> Estimate:
    """The frame's noise ratio with nothing refined."""
    nothing = np.zeros(measured.excess.size, bool)
    if measured.excess.size == 0 or measured.noise.sum() <= 0.0:
        return Estimate(1.0, 1.0, 1.0)
    expected = float((measured.weight * measured.excess).sum()) / (2.0 * _total_noise(measured))
    return _estimate(measured, nothing, expected, np.random.default_rng(seed))


def _estimate(measured: Measured, refined: NDArray, expected: float, rng: np.random.Generator) -> Estimate:
    """The interval is a bootstrap over the probes, around the expected excess."""
    share = (measured.traced + measured.weight.sum()) / measured.weight.sum()
    left = np.where(refined, 0.0, measured.weight * measured.excess)
    noise = 2.0 * share * measured.weight * measured.noise
    draws = rng.poisson(1.0, (RESAMPLES, left.size)).astype(np.float32)
    ratio = (draws @ left) / np.maximum(draws @ noise, 1e-30)
    ratio += expected - left.sum() / noise.sum()
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(ratio, [tail, 100.0 - tail])
    return Estimate(*(float(np.sqrt(max(1.0 + value, 0.0))) for value in (expected, low, high)))


def _remaining(measured: Measured, weights: NDArray) -> tuple[NDArray[np.intp], NDArray]:
    """Tiles worst first, and (N + 1,) the summed excess that remains when the first k of them are traced.

    weights (N,): how often each probe counts.
    """
    order = np.argsort(-_smoothed(measured, weights), kind="stable")
    own = measured.weight * measured.excess * weights
    return order, own.sum() - np.concatenate([[0.0], np.cumsum(own[order])])


def _optimism(measured: Measured, rng: np.random.Generator) -> NDArray:
    """(N + 1,): how much more excess remains in truth than the probes say that the choice was made by."""
    weights = rng.poisson(1.0, measured.excess.size).astype(np.float64)
    order, seen = _remaining(measured, weights)
    own = measured.weight * measured.excess
    true = own.sum() - np.concatenate([[0.0], np.cumsum(own[order])])
    # Without a choice there is no optimism: what is left of a resample's own chance is taken out. Of that chance the
    # tiles that remain have the share of their squares (Poisson weights), and none when nothing remains.
    squares = np.concatenate([[0.0], np.cumsum(own[order] ** 2)])
    share = 1.0 - squares / max(squares[-1], 1e-30)
    return (true - seen) - share * (true[0] - seen[0])


def _total_noise(measured: Measured) -> float:
    mean = np.average(measured.noise, weights=measured.weight)
    return float(mean * (measured.weight.sum() + measured.traced))


def _smoothed(measured: Measured, weights: NDArray) -> NDArray:
    """Mean excess (N,) of the 3 x 3 tiles around each probe's, its own included."""
    s = measured.probes.spacing
    shape = tuple(-(-size // s) for size in measured.probes.shape)
    total, count = np.zeros(shape), np.zeros(shape)
    tiles = measured.probes.tiles
    total[tiles], count[tiles] = measured.excess * weights, weights
    return _sum_3x3(total)[tiles] / np.maximum(_sum_3x3(count)[tiles], 1.0)


def _sum_3x3(values: NDArray) -> NDArray:
    padded = np.pad(values, 1)
    rows = padded[:-2] + padded[1:-1] + padded[2:]
    return rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]


def refined_pixels(measured: Measured, refined: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W): the pixels of the tiles of the probes that are set in `refined`."""
    s = measured.probes.spacing
    height, width = measured.probes.shape
    tiles = np.zeros((-(-height // s), -(-width // s)), bool)
    rows, columns = measured.probes.tiles
    tiles[rows[refined], columns[refined]] = True
    return np.repeat(np.repeat(tiles, s, axis=0), s, axis=1)[:height, :width]
