"""Refinement: which tiles are traced so that the frame keeps its promise.

Tiles are chosen by their expected excess (see `expected_excess`), so that the sum over the probes of those that stay is
what is left, on average. Only tiles whose own probe stands out far beyond noise are traced for that alone, and of them
no more is taken off than was found (`evidence.with_refined`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..holes.tuning import TUNING as HOLE_TUNING
from .evidence import TileEvidence
from .expected_excess import (
    CONFIDENCE_95_SIGMAS,
    denoised_excess,
    expected_excess,
    local_noise,
    neighbours_excess,
    remaining_excess,
    with_materials,
)
from .tuning import TUNING


def choose_tiles(
    evidence: TileEvidence,
    promise: float,
    *,
    worst: float = np.inf,
    unseen: float = 0.0,
    margin_sigmas: float | None = None,
) -> NDArray[np.bool_]:
    """Return the tiles (N,) to be traced beyond those that were, so that the frame keeps its promise.

    They are as few, worst first, as bring the frame's honest ratio down to `promise`, with a margin of margin_sigmas
    standard errors (None: as tuned); and every tile whose own ratio is expected to be above `worst`. unseen is a
    standard deviation after tone mapping that nobody sees: noise below it counts as this much.
    """
    free = ~evidence.refined
    if not evidence.frame_noise:
        # Without noise there is no ratio to it: whatever is off so that it can be seen is traced.
        return free & (evidence.excess > HOLE_TUNING.unseen_difference**2 * evidence.pixels)
    margin = TUNING.promise_margin_sigmas if margin_sigmas is None else margin_sigmas
    expected = expected_excess(evidence, TUNING.frame_reach_tiles)[0]
    # Where no gain is expected, there is none: what a lone probe says of its own tile is for the estimate.
    candidates = np.nonzero(free & (expected > 0.0))[0]
    order = candidates[np.argsort(-expected[candidates], kind="stable")]
    bound = _excess_bound(evidence, order, expected, margin)
    reached = np.nonzero(bound <= promise**2 - 1.0)[0]
    count = int(reached[0]) if reached.size else int(np.argmin(bound))
    chosen = np.zeros(free.size, bool)
    chosen[order[:count]] = True
    if np.isfinite(worst):
        chosen |= free & _above_limit(evidence, worst, unseen)
    return chosen | (free & _on_mostly_traced_materials(evidence, chosen, unseen))


def outlier_tiles(evidence: TileEvidence, worst: float, *, unseen: float = 0.0) -> NDArray[np.bool_]:
    """Return the tiles (N,) whose own probe alone says, far beyond chance, that their honest ratio is above `worst`.

    None for a denoised picture, whose single traces tell too little. unseen is as for `choose_tiles`.
    """
    if evidence.selection is not None:
        return np.zeros_like(evidence.refined)
    noise = np.maximum(local_noise(evidence), max(float(np.median(evidence.noise)), unseen**2))
    limit = 2.0 * (worst**2 - 1.0) * noise * evidence.pixels
    doubt = TUNING.tile_outlier_sigmas * evidence.traced_noise * noise * evidence.probes.weight
    return ~evidence.refined & (evidence.excess > np.maximum(limit, doubt))


def _on_mostly_traced_materials(evidence: TileEvidence, chosen: NDArray[np.bool_], unseen: float) -> NDArray[np.bool_]:
    """Return the tiles (N,) of a denoised picture on whose material most tiles are chosen (N,), or were traced before.

    Tiles are left out where contrast, around there too, is less than `unseen`, so that nobody would see what has moved.
    None for a picture that is not denoised.
    """
    if evidence.selection is None or evidence.materials is None:
        return np.zeros_like(chosen)
    material, pixels, probes = evidence.materials.of_probe, evidence.pixels, evidence.probes
    traced = chosen | evidence.refined
    shown = np.bincount(material, weights=pixels)
    share = TUNING.mostly_traced_share
    mostly = np.bincount(material, weights=pixels * traced) >= share * np.maximum(shown, 1.0)
    contrast = probes.neighbourhood_mean(evidence.contrast)
    return mostly[material] & (contrast >= unseen**2 * probes.neighbourhood_mean(pixels))


def _excess_bound(
    evidence: TileEvidence, order: NDArray[np.intp], expected: NDArray, margin_sigmas: float
) -> NDArray[np.float64]:
    """Return (K + 1,) the excess that the frame is judged by once the first k tiles of `order` (K,) are traced, for
    each k.

    It is the frame's remaining excess plus a margin of margin_sigmas standard errors. Single traces of a denoised
    picture tell next to nothing but noise: there it is the sum of what the pixels of the tiles left are expected (N,)
    to have.
    """
    if evidence.selection is None:
        excess, error = remaining_excess(evidence, order)
        return excess + margin_sigmas * error
    left = np.where(evidence.refined, 0.0, expected * evidence.pixels)
    gone = np.concatenate([[0.0], np.cumsum(left[order])])
    return (left.sum() - gone) / evidence.frame_noise


def _above_limit(evidence: TileEvidence, worst: float, unseen: float) -> NDArray[np.bool_]:
    """Return the tiles (N,) that are expected to have an honest ratio above `worst`, as `metrics.worst_tiles` measures
    it.

    Those are among them of which the tiles around alone are sure, whatever its materials tell: a material may be wrong
    in one small place. unseen is as for `choose_tiles`.
    """
    noise = local_noise(evidence)
    allowed = (worst**2 - 1.0) * 2.0 * np.maximum(noise, max(float(np.median(noise)), unseen**2))
    if evidence.selection is not None:
        return denoised_excess(evidence, evidence.selection)[0] > allowed
    nearby, doubt = neighbours_excess(evidence, TUNING.tile_reach_tiles)
    expected, error = with_materials(evidence, (nearby, doubt))
    return ((expected > allowed) & (expected > error)) | ((nearby > allowed) & (nearby > CONFIDENCE_95_SIGMAS * doubt))
