"""What is told of effects and of the estimate: plain values for report.json, and a map of the tiles."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..estimate.noise_ratio import Estimate, tile_estimates, worst_tiles
from ..estimate.tracing import Refinement
from ..images.effects import Effect, EffectsPlan
from ..pipeline.effect_costs import EffectCost
from ..settings.accuracy import Accuracy


def effects_fields(plan: EffectsPlan, accounts: Mapping[Effect, EffectCost]) -> list[dict[str, Any]]:
    """Per effect: called for or not, by what, how it is handled, and what of the frame is on its account."""
    rows = []
    for finding in plan.findings:
        account = accounts.get(finding.effect)
        rows.append(
            {
                **finding.fields(),
                "fraction": 0.0 if account is None else account.fraction,
                "seconds": 0.0 if account is None else account.seconds,
                **dict(zip(("excess", "excess_low", "excess_high"), _excess(account), strict=True)),
            }
        )
    return rows


def _excess(account: EffectCost | None) -> tuple[float | None, float | None, float | None]:
    return (None, None, None) if account is None or account.excess is None else account.excess


def estimate_fields(refinement: Refinement, accuracy: Accuracy) -> dict[str, Any]:
    """What the probes say of the finished target, and whether that is what was promised; null where none were traced.

    probes counts those of the tiles that stayed warped, from which the figures are; tile_size is in pixels.
    """
    estimate, evidence = refinement.estimate, refinement.evidence
    if estimate is None:
        return _no_estimate(refinement, accuracy)
    probed = None if refinement.whole else evidence
    worst = 1.0 if probed is None else worst_tiles(probed)
    promised = accuracy.tile_limit if accuracy.promises_worst_tiles else None
    kept = _kept(estimate, accuracy.promise, sure=probed is None or probed.selection is None)
    return {
        "noise_ratio": estimate.noise_ratio,
        **_interval(estimate),
        "excess": estimate.excess,
        "promise": accuracy.promise,
        "worst_tiles": worst,
        "worst_tiles_promise": promised,
        "kept": False if promised is not None and worst > promised else kept,
        "probes": 0 if probed is None else int((~probed.refined).sum()),
        "tile_size": None if evidence is None else evidence.probes.spacing,
        "from": "rendered whole" if probed is None else "probes",
    }


def _interval(estimate: Estimate) -> dict[str, float | None]:
    """The ends of the 95 % interval: null for an eye that was rendered whole, of whose noise nothing is known."""
    ends = {"low": estimate.low, "high": estimate.high}
    return {name: end if math.isfinite(end) else None for name, end in ends.items()}


def _kept(estimate: Estimate, promise: float | None, *, sure: bool) -> bool | None:
    """Whether the promise is kept; where the probes are not sure of the figure, only if its whole interval says so."""
    if promise is None:
        return True
    if sure:
        return estimate.noise_ratio <= promise
    return True if estimate.high <= promise else False if estimate.low > promise else None


def _no_estimate(refinement: Refinement, accuracy: Accuracy) -> dict[str, Any]:
    unknown = ("noise_ratio", "low", "high", "excess", "worst_tiles", "worst_tiles_promise", "kept", "tile_size")
    return {**dict.fromkeys(unknown), "promise": accuracy.promise, "probes": 0, "from": refinement.no_estimate}


def estimate_map(refinement: Refinement, traced: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(H, W, 3): the noise ratio of each pixel's tile, and the low and high end of its 95 % interval.

    1 where the pixel was traced (H, W), not a number where no probe tells.
    """
    result = np.full((*traced.shape, 3), np.nan, np.float32)
    evidence = refinement.evidence
    if evidence is not None:
        result = evidence.probes.over_pixels(tile_estimates(evidence).astype(np.float32), np.nan)
    result[traced] = 1.0
    return result
