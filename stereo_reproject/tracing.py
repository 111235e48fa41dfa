"""The traced part of a frame: the holes and the probes in one render, then what the probes ask for in another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .accuracy import Accuracy
from .composite import composite, filtered
from .fill import FillChoice, SourceCost, choose_fill
from .passes import COLOUR_PASS, Passes
from .probes import Estimate, Measured, Probes, choose_refined, measure, place_probes, refined_pixels

BOOTSTRAP_SEED = 29
PROBE_SEED = 17

CARD_SPACING = 3
"""How many times further apart probes are behind a card: each opens it for its whole filter, some 25 pixels."""


class Tracer(Protocol):
    """The part of `pipeline.Renderer` that traces."""

    def trace(
        self, method: str, view: str, pixels: NDArray[np.bool_], *, twice: NDArray[np.bool_] | None = None
    ) -> Passes: ...


def plan_probes(
    warped: NDArray[np.bool_], accuracy: Accuracy, method: str, view_dependent: Sequence[str]
) -> Probes | None:
    """Probes among the warped pixels (H, W), if anything was promised that the scene may break; else None."""
    if accuracy.promise is None or not view_dependent or not warped.any() or method == "full":
        return None
    spacing = accuracy.probe_spacing * (CARD_SPACING if method == "card" else 1)
    return place_probes(warped, spacing=spacing, seed=PROBE_SEED)


def trace_holes(
    tracer: Tracer, method: str, view: str, warped: Passes, holes: NDArray[np.bool_], probes: Probes | None
) -> tuple[Passes, Measured | None]:
    """`warped` with the holes (H, W) traced, and what the probes, traced twice in the same render, say of the rest.

    Probes are pixels of the result too: each becomes the mean of its two traces.
    """
    if probes is None:
        return (composite(warped, tracer.trace(method, view, holes), holes) if holes.any() else warped), None
    twins = probes.mask
    wanted = holes | twins
    traced = tracer.trace(method, view, wanted, twice=twins)
    count = int(wanted.sum())
    target = composite(warped, {name: image[:count] for name, image in traced.items()}, wanted)
    once, again = target[COLOUR_PASS][twins], traced[COLOUR_PASS][count:]
    measured = measure(probes, ~holes, warped[COLOUR_PASS][twins], once, again)
    means = (name for name in target if name in traced and filtered(name))
    mean = {name: 0.5 * (target[name][twins] + traced[name][count:]) for name in means}
    return composite(target, mean, twins), measured


@dataclass(frozen=True)
class Refinement:
    """What the probes ask for: (H, W) pixels to be traced as well, how, and the frame's noise ratio then.

    Without probes there is no estimate, and nothing is asked for.
    """

    pixels: NDArray[np.bool_]
    fill: FillChoice | None
    estimate: Estimate | None


def plan_refinement(
    measured: Measured | None,
    untraced: NDArray[np.bool_],
    promise: float | None,
    asked: str,
    cost: SourceCost,
    blockers: Mapping[str, str | None],
) -> Refinement:
    """As few tiles as bring the frame's estimated noise ratio down to `promise`, by the cheapest way to trace them.

    untraced (H, W) are the pixels that are still warped. Where a full render is not clearly dearer, it is taken and
    all of them are traced.
    """
    nothing = np.zeros_like(untraced)
    if measured is None or promise is None:
        return Refinement(nothing, None, None)
    choice = choose_refined(measured, promise, seed=BOOTSTRAP_SEED)
    pixels = refined_pixels(measured, choice.refined) & untraced
    if not pixels.any():
        return Refinement(nothing, None, choice.estimate)
    fill = choose_fill(asked, float(np.mean(pixels)), cost, blockers)
    if fill.method == "full":
        return Refinement(untraced, fill, Estimate(1.0, 1.0, 1.0))
    return Refinement(pixels, fill, choice.estimate)


def trace_more(tracer: Tracer, refinement: Refinement, view: str, target: Passes) -> Passes:
    """`target` with the pixels of the refinement traced."""
    if refinement.fill is None:
        return target
    return composite(target, tracer.trace(refinement.fill.method, view, refinement.pixels), refinement.pixels)
