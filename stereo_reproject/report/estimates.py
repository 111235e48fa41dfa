"""The parts of a report about effects and about the estimate, and a map of the estimate by tiles."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..estimate.noise_ratio import Estimate, tile_estimates, worst_tiles, wrong_tiles
from ..estimate.tracing import Refinement
from ..images.effects import Effect, EffectsPlan, Finding
from ..pipeline.effect_costs import EffectCost
from ..settings.accuracy import Accuracy
from .frame_report import EffectReport, EstimateReport, NoEstimateReport


def effect_reports(plan: EffectsPlan, accounts: Mapping[Effect, EffectCost]) -> tuple[EffectReport, ...]:
    """Return the part of the report about each effect of the plan: how it is handled, and its cost in the frame from
    `accounts`. An effect without an entry there has cost nothing."""
    return tuple(_effect_report(finding, accounts.get(finding.effect)) for finding in plan.findings)


def _effect_report(finding: Finding, cost: EffectCost | None) -> EffectReport:
    """Return the report of one effect, from its finding in the plan and its cost (None for no cost)."""
    excess, low, high = _excess(cost)
    return EffectReport(
        effect=finding.effect.label,
        called_for=finding.called_for,
        by=finding.by,
        handling=finding.handling,
        fraction=0.0 if cost is None else cost.fraction,
        seconds=0.0 if cost is None else cost.seconds,
        excess=excess,
        excess_low=low,
        excess_high=high,
    )


def _excess(cost: EffectCost | None) -> tuple[float | None, float | None, float | None]:
    """Return the excess of an effect and the low and high end of its 95 % interval; three times None where it is not
    known."""
    return (None, None, None) if cost is None or cost.excess is None else cost.excess


def estimate_report(refinement: Refinement, accuracy: Accuracy) -> EstimateReport | NoEstimateReport:
    """Return the part of the report about the target's quality: the estimate beside the accuracy's promise. Where there
    is no estimate, return a `NoEstimateReport` with the reason."""
    estimate, evidence = refinement.estimate, refinement.evidence
    if estimate is None:
        return NoEstimateReport(promise=accuracy.promise, from_=refinement.no_estimate)
    probed = None if refinement.whole else evidence
    worst = 1.0 if probed is None else worst_tiles(probed)
    promised = accuracy.tile_limit if accuracy.promises_worst_tiles else None
    kept = _kept(estimate, accuracy.promise, sure=probed is None or probed.told_noise is None)
    return EstimateReport(
        noise_ratio=estimate.noise_ratio,
        low=_finite(estimate.low),
        high=_finite(estimate.high),
        excess=estimate.excess,
        bias=estimate.bias,
        honest_ratio=estimate.honest_ratio,
        honest_low=_finite(estimate.honest_low),
        honest_high=_finite(estimate.honest_high),
        promise=accuracy.promise,
        worst_tiles=worst,
        worst_tiles_promise=promised,
        wrong_tiles=0.0 if probed is None else wrong_tiles(probed),
        kept=False if promised is not None and worst > promised else kept,
        probes=0 if probed is None else int((~probed.refined).sum()),
        tile_size=None if evidence is None else evidence.probes.spacing,
        from_="rendered whole" if probed is None else "probes",
    )


def _finite(end: float) -> float | None:
    """Return `end`, one end of a 95 % interval, or None if it is not finite. It is infinite for an eye that was
    rendered whole, if nothing is known of its noise."""
    return end if math.isfinite(end) else None


def _kept(estimate: Estimate, promise: float | None, *, sure: bool) -> bool | None:
    """Return True or False for a promise (a greatest honest ratio) that is kept or broken; True where nothing is
    promised.

    With `sure`, the estimate itself decides. Without, its 95 % interval does, and the result is None where the promise
    lies within it.
    """
    if promise is None:
        return True
    if sure:
        return estimate.honest_ratio <= promise
    return True if estimate.honest_high <= promise else False if estimate.honest_low > promise else None


def estimate_map(refinement: Refinement, traced: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return (H, W, 3) for each pixel: the estimated honest ratio of its tile, and the low and high end of its 95 %
    interval. All three are 1 where the pixel was traced (`traced`, (H, W)), and NaN where no probe tells."""
    result = np.full((*traced.shape, 3), np.nan, np.float32)
    evidence = refinement.evidence
    if evidence is not None:
        result = evidence.probes.over_pixels(tile_estimates(evidence).astype(np.float32), np.nan)
    result[traced] = 1.0
    return result
