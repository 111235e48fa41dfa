"""Expected excess: how wrong each tile is likely to be, by all evidence but its own probe.

A tile is judged by the probes around it, and by those of its materials wherever they are, but not by its own. So the
probes of the tiles that stay warped are as good as drawn after the choice was made: nothing was picked because it
looked good.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .evidence import TileEvidence
from .tuning import TUNING

CONFIDENCE_95_SIGMAS = 1.96
"""Standard errors on either side that hold 95 %."""

Uncertain = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Values, and the standard error of each."""


def expected_excess(evidence: TileEvidence, reach: int) -> Uncertain:
    """Return the expected excess (N,) of a pixel of each tile, by the tiles within `reach` and by its materials."""
    if evidence.selection is not None:
        return denoised_excess(evidence, evidence.selection)
    return with_materials(evidence, neighbours_excess(evidence, reach))


def neighbours_excess(evidence: TileEvidence, reach: int) -> Uncertain:
    """Return the excess (N,) of a pixel of each tile by those within `reach` tiles, in proportion to its contrast."""
    probes, unmoved = evidence.probes, TUNING.unmoved_share
    around = probes.neighbour_sum(evidence.excess, reach)
    contrast = np.maximum(np.maximum(probes.neighbour_sum(evidence.contrast, reach), evidence.contrast), 1e-30)
    pixels = np.maximum(probes.neighbour_sum(evidence.pixels, reach), 1.0)
    # The excess of a refined tile is known; that of each other by one probe.
    chance = probes.neighbour_sum(np.where(evidence.refined, 0.0, evidence.excess) ** 2, reach)
    per_pixel = (1.0 - unmoved) * evidence.contrast / contrast / evidence.pixels + unmoved / pixels
    return around * per_pixel, np.sqrt(np.maximum(chance, 0.0)) * per_pixel


def with_materials(evidence: TileEvidence, nearby: Uncertain) -> Uncertain:
    """Return the excess (N,) of a pixel of each tile by its neighbours (`nearby`) and its materials together."""
    if evidence.materials is None:
        return nearby
    excess, error = nearby
    expected, more = evidence.materials.expected(excess * evidence.pixels)
    return expected / evidence.pixels, np.hypot(error, more / evidence.pixels)


def denoised_excess(evidence: TileEvidence, selection: NDArray[np.float64]) -> Uncertain:
    """Return the excess (N,) of a pixel of each tile of a denoised picture; selection (N,) is that of whole tiles.

    By the denoised probes, or by the others' traces where those tell of more beyond chance; in all no more than all
    traces together allow.
    """
    total, doubt = remaining_excess(evidence, np.zeros(0, np.intp))
    allowed = max(float(total[-1] + doubt[-1]), 0.0) * evidence.frame_noise
    scale = min(1.0, allowed / max(float(selection.sum()), 1e-30))
    expected = scale * selection / evidence.pixels
    tuning = TUNING
    for reach in (tuning.frame_reach_tiles, tuning.tile_reach_tiles):
        by_traces, error = with_materials(evidence, neighbours_excess(evidence, reach))
        expected = np.maximum(expected, np.where(by_traces > CONFIDENCE_95_SIGMAS * error, by_traces, 0.0))
    return expected, tuning.denoised_relative_error * expected


def remaining_excess(evidence: TileEvidence, order: NDArray[np.intp]) -> Uncertain:
    """Return the excess (K + 1,) of the frame over its noise once the first k tiles of `order` (K,) are traced too.

    Its standard error is that of a ratio of two sums over the same probes (linearized), each tile a stratum.
    """
    noise, weight = evidence.frame_noise, evidence.probes.weight
    gone = np.concatenate([[0.0], np.cumsum(evidence.left[order])])
    excess = (evidence.left.sum() - gone) / noise
    share = 2.0 * evidence.frame_pixels * weight * (evidence.noise - evidence.mean_noise) / weight.sum() / noise
    own = evidence.left / noise
    # sum over all of (own - excess share)^2, without `own` for the tiles that are traced
    taken = own[order]
    squares = np.sum(own**2) - np.concatenate([[0.0], np.cumsum(taken**2)])
    products = np.sum(own * share) - np.concatenate([[0.0], np.cumsum(taken * share[order])])
    variance = squares - 2.0 * excess * products + excess**2 * np.sum(share**2)
    return excess, np.sqrt(np.maximum(variance, 0.0))


def local_noise(evidence: TileEvidence) -> NDArray[np.float64]:
    """Return the variance (N,) of one traced pixel in each tile.

    Probes around tell it, but beside something noisy they tell too much; so does the picture's own noise where it has a
    fine texture. The smaller of both is taken, the latter at the scale that the former give it over the frame.
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
    """Return the value up to which half of the weights lie."""
    order = np.argsort(values)
    upto = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(upto, 0.5 * upto[-1])])
