"""The cost of the next better accuracy, predicted from a frame that is finished."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..estimate.refinement import choose_tiles
from ..estimate.tracing import Refinement
from ..holes.reprojection import Reprojection
from ..settings.accuracy import SETTINGS, Accuracy, for_denoised, for_size
from ..trace.fill import FillChoice
from ..trace.planner import FillPlanner

WHOLE = "full"
"""Name of what is beyond the best of the settings: the target rendered whole."""


@dataclass(frozen=True)
class NextAccuracy:
    """Predicted cost of the next better accuracy for a frame that is finished.

    accuracy is its name. seconds are those of the whole frame at it, more_seconds those beyond this frame's; traced is
    the share of the target that would be traced. complete: whether the tiles that probes would ask for are counted.
    more_seconds is None where nothing better can be had, because the target was rendered whole.
    """

    accuracy: str
    seconds: float
    more_seconds: float | None
    traced: float
    complete: bool


@dataclass(frozen=True)
class FinishedTarget:
    """A completed target, as far as the prediction of another accuracy's cost needs it.

    better_holes (H, W) are those of the next better accuracy, None where that is `WHOLE`; fill is how the holes were
    traced, planner tells how others would be. refinement is the tracing that probes asked for. needs_probes: whether an
    accuracy that promises something would trace probes here. is_whole: whether all of the target was traced.
    """

    better_holes: NDArray[np.bool_] | None
    planner: FillPlanner
    fill: FillChoice
    refinement: Refinement
    needs_probes: bool
    is_whole: bool


def next_better(accuracy: Accuracy) -> str:
    """Return the name of the setting that promises the next smaller honest ratio; `WHOLE`, a full render, after the
    best one."""
    promise = accuracy.promise or np.inf
    better = [name for name, other in SETTINGS.items() if other.promise is not None and other.promise < promise]
    return better[0] if better else WHOLE


def holes_of(name: str, reprojection: Reprojection, *, denoised: bool) -> NDArray[np.bool_] | None:
    """Return the holes (H, W) of a warped target at the accuracy called `name`; None for `WHOLE`."""
    if name == WHOLE:
        return None
    return reprojection.reasons_at(_accuracy_called(name, reprojection.reasons.size, denoised=denoised)) > 0


def _accuracy_called(name: str, pixels: int, *, denoised: bool) -> Accuracy:
    """Return the accuracy of this name for a picture of so many pixels, denoised or not."""
    accuracy = for_size(SETTINGS[name], pixels)
    return for_denoised(accuracy) if denoised else accuracy


def cost_of(name: str, target: FinishedTarget, seconds: Mapping[str, float]) -> NextAccuracy:
    """Return the predicted cost of this frame at the accuracy called `name`, or rendered whole where that is `WHOLE`.

    seconds are those of this frame's stages, and in total. Predicted seconds of tracing are scaled by how this frame's
    own tracing compared with its prediction. The cost is no less than this frame's.
    """
    total, planner = seconds["total"], target.planner
    if target.is_whole:
        return NextAccuracy(WHOLE, total, None, 1.0, complete=True)
    spent = seconds.get("fill", 0.0) + seconds.get("refine", 0.0)
    apart = total - spent
    holes = target.better_holes
    if name == WHOLE or holes is None:
        again = planner.cost.fixed(planner.costs) + planner.cost.per_frame
        more = max(apart - seconds.get("pilot", 0.0) + again - total, 0.0)
        return NextAccuracy(name, total + more, more, 1.0, complete=True)
    predicted = sum(choice.predicted_seconds for choice in (target.fill, target.refinement.fill) if choice)
    pace = spent / predicted if predicted > 0.0 else 1.0
    accuracy = _accuracy_called(name, holes.size, denoised=bool(planner.cost.denoise_seconds))
    to_trace, share = _tracing(accuracy, holes, target)
    more = max(apart + pace * to_trace - total, 0.0)
    complete = target.refinement.evidence is not None or not target.needs_probes
    return NextAccuracy(name, total + more, more, share, complete)


def _tracing(accuracy: Accuracy, holes: NDArray[np.bool_], target: FinishedTarget) -> tuple[float, float]:
    """Return the predicted seconds of fill and refinement at this accuracy, whose holes (H, W) are given, and the share
    of the target that would be traced."""
    spacing, planner = accuracy.probe_spacing, target.planner
    fill = planner.plan(float(np.mean(holes)), spacing=spacing if target.needs_probes else None)
    if fill.method == "full":
        return fill.predicted_seconds, 1.0
    probes = 1.0 / planner.spacing(fill.method, spacing) ** 2 if target.needs_probes else 0.0
    evidence = target.refinement.evidence
    if evidence is None or accuracy.promise is None:
        return fill.predicted_seconds, min(float(np.mean(holes)) + probes, 1.0)
    worst, unseen = accuracy.tile_limit, accuracy.unseen
    chosen = choose_tiles(evidence, accuracy.promise, worst=worst, unseen=unseen) | evidence.refined
    pixels = evidence.probes.pixels_of(chosen) & ~holes
    refining = planner.plan(float(np.mean(pixels))).predicted_seconds if pixels.any() else 0.0
    return fill.predicted_seconds + refining, min(float(np.mean(holes | pixels)) + probes, 1.0)
