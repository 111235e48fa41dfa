"""Expected excess: how wrong each tile is likely to be, by all evidence but its own probe.

An excess is counted by the pixels' weight: where a picture is oversampled, as beside a pole, a pixel has less of it for
the same error, and is traced later. A tile is judged by the probes around it, and by those of its materials wherever
they are, but not by its own. So the probes of the tiles that stay warped are as good as drawn after the choice was
made: nothing was picked because it looked good.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..images.metrics import WRONG_TILE_RATIO
from ..images.tuning import TUNING as IMAGES_TUNING
from ..settings.accuracy import DISPLAY_STEP, ROUNDING_VARIANCE
from .evidence import TileEvidence

CONFIDENCE_95_SIGMAS = 1.96
"""Standard errors on either side that hold 95 %."""

Uncertain = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Values, and the standard error of each."""


def expected_excess(evidence: TileEvidence, reach: int) -> Uncertain:
    """Return the expected excess (N,) of a pixel of each tile, with its standard error (N,), by all evidence but its
    own probe.

    It is told by the tiles within `reach` and by those of the same materials.
    """
    return with_materials(evidence, neighbours_excess(evidence, reach))


def neighbours_excess(evidence: TileEvidence, reach: int) -> Uncertain:
    """Return the excess (N,) of a pixel of each tile, with its standard error (N,), by the probes of the tiles within
    `reach`.

    A tile's own probe is left out. The excess is taken to be in proportion to contrast; a tile has no more of it than
    all its neighbours together.
    """
    probes = evidence.probes
    around = probes.neighbour_sum(evidence.excess, reach)
    contrast = np.maximum(probes.neighbour_sum(evidence.contrast, reach), evidence.contrast)
    # The excess of a refined tile is known; that of each other by one probe.
    chance = probes.neighbour_sum(np.where(evidence.refined, 0.0, evidence.excess) ** 2, reach)
    per_pixel = evidence.contrast / contrast / evidence.pixels
    return around * per_pixel, np.sqrt(np.maximum(chance, 0.0)) * per_pixel


def with_materials(evidence: TileEvidence, nearby: Uncertain) -> Uncertain:
    """Return the excess (N,) of a pixel of each tile, with its standard error (N,), by its neighbours and its materials
    together.

    nearby is what `neighbours_excess` returned; it is returned as it is where the materials are not known.
    """
    if evidence.materials is None:
        return nearby
    excess, error = nearby
    expected, more = evidence.materials.expected(excess * evidence.pixels)
    return expected / evidence.pixels, np.hypot(error, more / evidence.pixels)


def of_one_pixel(evidence: TileEvidence, expected: Uncertain) -> Uncertain:
    """Return the excess (N,) of a pixel of each tile, with its standard error (N,), as if each pixel counted alike.

    expected is counted by the pixels' weight, as in the rest of this module: right for a share of the frame, but a
    single tile is seen to be wrong whatever its weight is.
    """
    excess, error = expected
    of_one = evidence.pixels / evidence.area
    return of_one * excess, of_one * error


def is_wrong(excess: NDArray[np.float64], noise: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return whether tiles (...) are wrong as `metrics.wrong_tiles` counts them, by the excess of a pixel of each and
    the variance of its noise."""
    render = 2.0 * noise
    return (excess + render > WRONG_TILE_RATIO**2 * render) & (excess + render > DISPLAY_STEP**2)


def remaining_excess(evidence: TileEvidence, order: NDArray[np.intp]) -> Uncertain:
    """Return the excess of the whole frame, as a share of its noise, after tracing more and more tiles, and its
    standard error.

    Both are (K + 1,): entry k is for the first k of the tiles `order` (K,) traced, entry 0 for none of them. order has
    indices of tiles. Tiles that are refined already count as the evidence has them. The error is that of a ratio of two
    sums over the same probes (linearized), each tile a stratum; where the noise is that of rounding, it is known, and
    has no part in the error. That of a denoised picture has a relative error of its own.
    """
    noise, weight = evidence.frame_noise, evidence.probes.weight
    measured_by_probes = evidence.whole_noise is None and evidence.mean_noise > ROUNDING_VARIANCE
    off = evidence.noise - evidence.mean_noise if measured_by_probes else np.zeros_like(weight)
    gone = np.concatenate([[0.0], np.cumsum(evidence.remaining[order])])
    excess = (evidence.remaining.sum() - gone) / noise
    share = 2.0 * evidence.frame_area * weight * off / weight.sum() / noise
    own = evidence.remaining / noise
    # sum over all of (own - excess share)^2, without `own` for the tiles that are traced
    taken = own[order]
    squares = np.sum(own**2) - np.concatenate([[0.0], np.cumsum(taken**2)])
    products = np.sum(own * share) - np.concatenate([[0.0], np.cumsum(taken * share[order])])
    variance = squares - 2.0 * excess * products + excess**2 * np.sum(share**2)
    if evidence.whole_noise is not None and evidence.whole_noise > ROUNDING_VARIANCE:
        variance += (IMAGES_TUNING.residual_noise_relative_error * excess) ** 2
    return excess, np.sqrt(np.maximum(variance, 0.0))


def local_noise(evidence: TileEvidence) -> NDArray[np.float64]:
    """Return the variance (N,) that one pixel of the delivered picture has in each tile.

    The probes around tell it, but beside something noisy they tell too much. The warped picture's own noise tells it
    too, but too much where there is a fine texture. So the smaller of both is taken, the latter scaled to agree with
    the former over the frame.
    """
    told, seen = evidence.neighbourhood_noise, evidence.seen_noise
    known = seen > 0.0
    own = evidence.probes.weight * evidence.noise
    if not own[known].any():
        return told
    # Each probe counts by its own noise: beside noise there may be more texture than quiet, which tells no scale.
    scale = _weighted_median(told[known] / seen[known], own[known])
    return np.where(known, np.minimum(told, scale * seen), told)


def _weighted_median(values: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    """Return the value, of `values`, up to which half of the weights lie."""
    order = np.argsort(values)
    upto = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(upto, 0.5 * upto[-1])])
