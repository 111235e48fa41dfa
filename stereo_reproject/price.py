"""What the next better accuracy would have cost, predicted from a frame that is finished."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .accuracy import SETTINGS, Accuracy
from .refinement import choose_refined
from .reprojection import Reprojection
from .tracing import Means, Refinement

WHOLE = "full"
"""What is beyond the best of the settings: the target rendered whole."""


@dataclass(frozen=True)
class Price:
    """Of the next better accuracy: the seconds of the whole frame at it, how many more than now, and the share of the
    target that would be traced. complete: whether what probes would ask for is in it."""

    accuracy: str
    seconds: float
    more_seconds: float
    traced: float
    complete: bool


def next_better(accuracy: Accuracy) -> str:
    """The name of the setting that promises next more."""
    promise = accuracy.promise or np.inf
    better = [name for name, other in SETTINGS.items() if other.promise is not None and other.promise < promise]
    return better[0] if better else WHOLE


def price_of(
    name: str, reprojection: Reprojection, refinement: Refinement, means: Means, seconds: dict[str, float]
) -> Price:
    """What the accuracy called `name` would have cost this frame.

    refinement holds what its probes have told, seconds those of the stages.
    """
    if refinement.whole:
        return Price(WHOLE, seconds["total"], 0.0, 1.0, complete=True)
    measured = refinement.measured
    spent = {"fill": seconds.get("fill", 0.0), "refine": seconds.get("refine", 0.0)}
    apart = seconds["total"] - sum(spent.values())
    if name == WHOLE:
        total = apart - seconds.get("pilot", 0.0) + means.cost.fixed + means.cost.per_frame
        return Price(name, total, total - seconds["total"], 1.0, complete=True)
    accuracy = SETTINGS[name]
    holes = reprojection.reasons_at(accuracy) > 0
    probes = 2.0 / accuracy.probe_spacing**2
    fill = means.choose(float(np.mean(holes)) + probes)
    total, traced = apart + fill.predicted_seconds, holes
    if fill.method == "full":
        traced = np.ones_like(holes)
    elif measured is not None and accuracy.promise is not None:
        chosen = choose_refined(measured, accuracy.promise, worst=accuracy.tile_limit) | measured.refined
        pixels = measured.probes.pixels_of(chosen) & ~holes
        if pixels.any():
            total += means.choose(float(np.mean(pixels))).predicted_seconds
        traced = holes | pixels
    share = min(float(np.mean(traced)) + 0.5 * probes, 1.0)
    return Price(name, total, total - seconds["total"], share, complete=measured is not None)
