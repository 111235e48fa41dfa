"""The honest ratio and the noise ratio of a finished frame: its error over that of a plain render, by its probes.

A plain render of the whole view differs from another by 2 var(a). So, with W the pixels that stay warped, excess their
squared bias, and c the share of a pixel's variance that the lookup kept,

    honest ratio^2 = 1 + sum over W of excess / sum over all of 2 noise = 1 + bias^2 / 2,
    noise ratio^2  = honest ratio^2 - sum over W of (1 - c) noise / sum over all of 2 noise,

with the frame's bias in standard deviations of one plain render's noise. Where the mean of the noise over all is below
that of rounding for a display (`ROUNDING_VARIANCE`), both are held against the latter. Promises are of the honest
ratio: a warp between pixels smooths noise, and by the noise ratio a frame could be wrong by as much as that saves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..images.metrics import TILE_PX, bias_sigmas, tile_means, weighted_mean, weighted_percentile
from .evidence import TileEvidence
from .expected_excess import (
    CONFIDENCE_95_SIGMAS,
    expected_excess,
    is_wrong,
    local_noise,
    of_one_pixel,
    remaining_excess,
)
from .tuning import TUNING


@dataclass(frozen=True)
class Estimate:
    """Noise ratio and honest ratio of a frame, estimated from its probes, each with the ends of its 95 % confidence
    interval.

    low and high belong to the noise ratio, honest_low and honest_high to the honest one; they are NaN where the
    interval is not known.
    """

    noise_ratio: float
    low: float
    high: float
    honest_ratio: float
    honest_low: float
    honest_high: float

    @property
    def excess(self) -> float:
        """Squared error beyond noise, as a share of noise: noise_ratio^2 - 1. It is negative for a frame better than a
        render."""
        return self.noise_ratio**2 - 1.0

    @property
    def bias(self) -> float:
        """Root mean square error of the frame apart from its noise, in standard deviations of one plain render's
        noise."""
        return bias_sigmas(self.honest_ratio)


AS_RENDERED = Estimate(*2 * (1.0, float("nan"), float("nan")))
"""The estimate of a view that was rendered whole and of whose noise nothing is known, or that has none."""


def estimate(evidence: TileEvidence) -> Estimate:
    """Return the frame's two ratios with their intervals; tiles that were refined count as traced."""
    if not evidence.frame_noise:
        return AS_RENDERED
    chance = _own_noise(evidence, evidence.refined)
    beyond_render = replace(evidence, remaining=evidence.remaining_beyond_render)
    return Estimate(*(end for told in (beyond_render, evidence) for end in _ratio(told, chance)))


def _ratio(evidence: TileEvidence, chance: float) -> tuple[float, ...]:
    """Return 1 + the frame's remaining excess as a ratio, with the ends of its 95 % interval; chance is the variance
    that the noise of traced pixels adds."""
    excess, error = remaining_excess(evidence, np.zeros(0, np.intp))
    return _interval(float(excess[-1]), float(error[-1]) ** 2 + chance)


def as_rendered(evidence: TileEvidence | None) -> Estimate:
    """Return the estimate of a frame that is traced throughout: 1, with the interval that chance gives any one render.

    evidence tells the noise; without it (None, or no noise at all) the ends of the interval are NaN.
    """
    if evidence is None or not evidence.frame_noise:
        return AS_RENDERED
    return Estimate(*2 * _interval(0.0, _own_noise(evidence, np.ones_like(evidence.refined))))


def _own_noise(evidence: TileEvidence, traced: NDArray[np.bool_]) -> float:
    """Return the variance that the noise of the traced pixels adds to the frame's excess.

    Traced are the tiles set in `traced` (N,), and all pixels of the frame that are in no tile's warped part. Where
    pixels have unequal weights it is a little too large, as the sum of their squares is smaller than theirs.
    """
    area = evidence.frame_area - evidence.area[~traced].sum()
    weight = evidence.probes.weight
    square = np.average(evidence.noise**2, weights=weight) if evidence.whole_noise is None else evidence.whole_noise**2
    return float(area * square / evidence.frame_noise**2)


def _interval(excess: float, variance: float) -> tuple[float, ...]:
    """Return a ratio and the low and high end of its 95 % interval, by the frame's excess and the variance of that
    excess."""
    reach = CONFIDENCE_95_SIGMAS * np.sqrt(variance)
    return tuple(float(np.sqrt(max(1.0 + value, 0.0))) for value in (excess, excess - reach, excess + reach))


def worst_tiles(evidence: TileEvidence) -> float:
    """Return the honest ratio of the worst hundredth of the tiles: an estimate of `metrics.worst_tiles`, less what
    chance adds.

    For chance alone, a second plain render is above 1 in that metric. Each tile is judged by those around it and by its
    materials, so an error in one tile alone is told too low.
    """
    if not evidence.frame_noise:
        return 1.0
    # Tiles without a probe are traced throughout: nothing is off there.
    ratio = _block_means(evidence, np.maximum(_excess_over_noise(evidence)[0], 0.0), 0.0)
    return weighted_percentile(np.sqrt(1.0 + ratio), 99.0, _block_weights(evidence))


def wrong_tiles(evidence: TileEvidence) -> float:
    """Return an estimate of `metrics.wrong_tiles`, the share of tiles that are wrong so that it can be seen, less what
    chance adds.

    Tiles are judged as in `worst_tiles`; those that were refined count as right. It is 0 where there is no noise at
    all: there, whatever can be seen to be wrong was traced.
    """
    if not evidence.frame_noise:
        return 0.0
    expected = np.where(evidence.refined, 0.0, _expected(evidence)[0])
    excess = _block_means(evidence, np.maximum(expected, 0.0), 0.0)
    noise = _block_means(evidence, local_noise(evidence), evidence.mean_noise)
    return weighted_mean(is_wrong(excess, noise), _block_weights(evidence))


def _expected(evidence: TileEvidence) -> tuple[NDArray, NDArray]:
    """Return the expected excess (N,) of a pixel of each tile, and its standard error (N,), whatever its weight is."""
    return of_one_pixel(evidence, expected_excess(evidence, TUNING.tile_reach_tiles))


def _block_weights(evidence: TileEvidence) -> NDArray[np.float64]:
    """Return the mean weight (R, C) of the pixels of the blocks of `_block_means`."""
    probes = evidence.probes
    block = max(1, TILE_PX // probes.spacing) * probes.spacing
    return tile_means(np.broadcast_to(probes.of_pixels, probes.shape), block)


def _block_means(evidence: TileEvidence, values: NDArray[np.float64], elsewhere: float) -> NDArray[np.float64]:
    """Return the means (R, C) of values (N,) of the probes' tiles over blocks of tiles, about as large as the tiles of
    `metrics.worst_tiles`; tiles without a probe count as `elsewhere`."""
    grid = evidence.probes.on_grid(values, elsewhere)
    block = max(1, TILE_PX // evidence.probes.spacing)
    rows, columns = (np.arange(0, size, block) for size in grid.shape)
    sums, counts = (np.add.reduceat(np.add.reduceat(a, rows), columns, axis=1) for a in (grid, np.ones_like(grid)))
    return sums / counts


def tile_estimates(evidence: TileEvidence) -> NDArray[np.float64]:
    """Return (N, 3) the honest ratio of each tile, and the lower and upper end of its 95 % interval, judged as in
    `worst_tiles`.

    It is 1 for tiles that were refined; NaN where there is no noise at all.
    """
    if not evidence.frame_noise:
        return np.full((evidence.refined.size, 3), np.nan)
    excess, error = _excess_over_noise(evidence)
    ends = excess[:, None] + CONFIDENCE_95_SIGMAS * error[:, None] * np.array([0.0, -1.0, 1.0])
    return np.sqrt(np.maximum(1.0 + ends, 0.0))


def _excess_over_noise(evidence: TileEvidence) -> tuple[NDArray, NDArray]:
    """Return the expected excess (N,) of a pixel of each tile over the noise of two plain renders, and its standard
    error (N,).

    Both are 0 where the tile was refined. As in `metrics.worst_tiles`, a tile that is quieter than most counts as being
    as noisy as those; where most are without noise, as a hundredth of the mean at least.
    """
    noise = local_noise(evidence)
    floor = float(np.median(noise))
    if not floor:
        # Most of the frame is noiseless: black, or nothing but light.
        floor = float(np.median(noise[noise > 0.0])) if noise.any() else evidence.whole_frame_noise
    floor = max(floor, TUNING.min_noise_share * evidence.whole_frame_noise)
    per_noise = np.where(evidence.refined, 0.0, 0.5 / np.maximum(noise, floor))
    expected, error = _expected(evidence)
    return per_noise * expected, per_noise * error
