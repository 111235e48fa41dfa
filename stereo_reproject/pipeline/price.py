"""What the next better accuracy would have cost, predicted from a frame that is finished."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..estimate.refinement import choose_tiles
from ..estimate.tracing import FillPlanner, Refinement
from ..holes.reprojection import Reprojection
from ..settings.accuracy import SETTINGS, Accuracy, for_denoised, for_size
from ..trace.fill import FillChoice

WHOLE = "full"
"""What is beyond the best of the settings: the target rendered whole."""


@dataclass(frozen=True)
class Price:
    """Of the next better accuracy: the seconds of the whole frame at it, how many more than now, and the share of the
    target that would be traced. complete: whether what probes would ask for is in it.

    more_seconds is None where nothing better can be had: the target was rendered whole.
    """

    accuracy: str
    seconds: float
    more_seconds: float | None
    traced: float
    complete: bool


def next_better(accuracy: Accuracy) -> str:
    """The name of the setting that promises next more."""
    promise = accuracy.promise or np.inf
    better = [name for name, other in SETTINGS.items() if other.promise is not None and other.promise < promise]
    return better[0] if better else WHOLE


def price_of(
    name: str,
    reprojection: Reprojection,
    refinement: Refinement,
    means: FillPlanner,
    seconds: Mapping[str, float],
    fill: FillChoice,
    *,
    watched: bool,
    whole: bool = False,
) -> Price:
    """What the accuracy called `name` would have cost this frame.

    refinement holds what its probes have told, if it was `watched` by any; seconds are those of the stages, fill is how
    its holes were traced. whole: all of the target was. What would be traced is predicted to take as much longer or
    shorter than fills are said to as this frame's own did, and to cost no less than it.
    """
    total = seconds["total"]
    if whole:
        return Price(WHOLE, total, None, 1.0, complete=True)
    spent = seconds.get("fill", 0.0) + seconds.get("refine", 0.0)
    apart = total - spent
    if name == WHOLE:
        more = max(apart - seconds.get("pilot", 0.0) + means.cost.fixed + means.cost.per_frame - total, 0.0)
        return Price(name, total + more, more, 1.0, complete=True)
    predicted = sum(choice.predicted_seconds for choice in (fill, *refinement.fills))
    pace = spent / predicted if predicted > 0.0 else 1.0
    accuracy = for_size(SETTINGS[name], reprojection.reasons.size)
    accuracy = for_denoised(accuracy) if means.cost.denoise_seconds else accuracy
    to_trace, share = _tracing(accuracy, reprojection, refinement, means, watched=watched)
    more = max(apart + pace * to_trace - total, 0.0)
    return Price(name, total + more, more, share, complete=refinement.measured is not None or not watched)


def _tracing(
    accuracy: Accuracy, reprojection: Reprojection, refinement: Refinement, means: FillPlanner, *, watched: bool
) -> tuple[float, float]:
    """Predicted seconds of the fill and of refinement at another accuracy, and the share of the target traced."""
    holes = reprojection.reasons_at(accuracy) > 0
    spacing = accuracy.probe_spacing
    fill = means.choose(float(np.mean(holes)), spacing=spacing if watched else None)
    if fill.method == "full":
        return fill.predicted_seconds, 1.0
    probes = 1.0 / means.spacing(fill.method, spacing) ** 2 if watched else 0.0
    measured = refinement.measured
    if measured is None or accuracy.promise is None:
        return fill.predicted_seconds, min(float(np.mean(holes)) + probes, 1.0)
    worst, unseen = accuracy.tile_limit, accuracy.unseen
    chosen = choose_tiles(measured, accuracy.promise, worst=worst, unseen=unseen) | measured.refined
    pixels = measured.probes.pixels_of(chosen) & ~holes
    refining = means.choose(float(np.mean(pixels))).predicted_seconds if pixels.any() else 0.0
    return fill.predicted_seconds + refining, min(float(np.mean(holes | pixels)) + probes, 1.0)
