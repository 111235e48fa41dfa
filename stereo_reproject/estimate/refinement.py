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
    expected_excess,
    is_wrong,
    local_noise,
    neighbours_excess,
    of_one_pixel,
    remaining_excess,
    with_materials,
)
from .tuning import TUNING


def tiles_to_trace(
    evidence: TileEvidence, promise: float, worst: float, *, unseen: float = 0.0, none_wrong: bool = False
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the tiles (N,) to be traced, by all rules, and those of them (N,) that their own probe helped to choose.

    With none_wrong, tiles that are likely to be wrong (`likely_wrong`) are among them, however little that adds to the
    frame's ratio. The other parameters are those of `choose_tiles`.
    """
    chosen = choose_tiles(evidence, promise, worst=worst, unseen=unseen)
    if none_wrong:
        chosen |= likely_wrong(evidence)
    by_own = outlier_tiles(evidence, worst, unseen=unseen) & ~chosen
    # That those around it are chosen is partly its own probe's doing.
    by_own |= enclosed_tiles(evidence, chosen | by_own)
    return chosen | by_own, by_own


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
        return free & (evidence.excess > HOLE_TUNING.unseen_difference**2 * evidence.area)
    margin = TUNING.promise_margin_sigmas if margin_sigmas is None else margin_sigmas
    expected = expected_excess(evidence, TUNING.frame_reach_tiles)[0]
    # Where no gain is expected, there is none: what a lone probe says of its own tile is for the estimate.
    candidates = np.nonzero(free & (expected > 0.0))[0]
    order = candidates[np.argsort(-expected[candidates], kind="stable")]
    excess, error = remaining_excess(evidence, order)
    bound = excess + margin * error
    reached = np.nonzero(bound <= promise**2 - 1.0)[0]
    count = int(reached[0]) if reached.size else int(np.argmin(bound))
    chosen = np.zeros(free.size, bool)
    chosen[order[:count]] = True
    if np.isfinite(worst):
        chosen |= free & _above_limit(evidence, worst, unseen)
    return chosen


def outlier_tiles(evidence: TileEvidence, worst: float, *, unseen: float = 0.0) -> NDArray[np.bool_]:
    """Return the tiles (N,) whose own probe alone says, far beyond chance, that their honest ratio is above `worst`.

    unseen is as for `choose_tiles`.
    """
    noise = np.maximum(local_noise(evidence), max(float(np.median(evidence.noise)), unseen**2))
    limit = 2.0 * (worst**2 - 1.0) * noise * evidence.area
    told = noise if evidence.told_noise is None else evidence.told_noise
    doubt = TUNING.tile_outlier_sigmas * told * evidence.probes.weight
    return ~evidence.refined & (evidence.excess > np.maximum(limit, doubt))


def likely_wrong(evidence: TileEvidence) -> NDArray[np.bool_]:
    """Return the tiles (N,) that are likely to be wrong as `metrics.wrong_tiles` counts them, by the tiles around
    alone: there, unlike in `worst_tiles`, a quiet tile's error is held against its own little noise.

    There are none without noise, where whatever is off is traced anyway.
    """
    if not evidence.frame_noise:
        return np.zeros_like(evidence.refined)
    nearby, doubt = of_one_pixel(evidence, neighbours_excess(evidence, TUNING.tile_reach_tiles))
    return ~evidence.refined & (nearby > doubt) & is_wrong(nearby, local_noise(evidence))


def enclosed_tiles(evidence: TileEvidence, chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the tiles (N,) that would stay warped among traced ones, where an error is seen as a square: those of
    whose 8 neighbours at least `enclosing_tiles` are traced, and at the picture's border as large a share of those that
    there are.

    Traced are those `chosen` (N,), those that were, and tiles without a warped pixel. There are none where nothing is
    chosen.
    """
    if not chosen.any():
        return np.zeros_like(chosen)
    traced = chosen | evidence.refined
    around = evidence.probes.neighbour_sum(traced.astype(np.float64), 1, elsewhere=1.0)
    present = evidence.probes.neighbour_sum(np.ones(traced.size), 1, elsewhere=1.0)
    return ~traced & (8.0 * around >= TUNING.enclosing_tiles * present)


def _above_limit(evidence: TileEvidence, worst: float, unseen: float) -> NDArray[np.bool_]:
    """Return the tiles (N,) that are expected to have an honest ratio above `worst`, as `metrics.worst_tiles` measures
    it.

    Those are among them of which the tiles around alone are sure, whatever its materials tell: a material may be wrong
    in one small place. unseen is as for `choose_tiles`.
    """
    noise = local_noise(evidence)
    allowed = (worst**2 - 1.0) * 2.0 * np.maximum(noise, max(float(np.median(noise)), unseen**2))
    around = neighbours_excess(evidence, TUNING.tile_reach_tiles)
    nearby, doubt = of_one_pixel(evidence, around)
    expected, error = of_one_pixel(evidence, with_materials(evidence, around))
    return ((expected > allowed) & (expected > error)) | ((nearby > allowed) & (nearby > CONFIDENCE_95_SIGMAS * doubt))
