"""A finished pair of one view layer, or the one view of a mono frame, and how it came about."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..estimate.tracing import Refinement
from ..images.effects import Effect
from ..images.passes import COLOUR_PASS, Passes
from ..images.reasons import Reason
from ..matching.matching import Correction
from ..trace.costs import TraceCosts
from ..trace.fill import FillChoice, SourceCost
from ..views.camera import Camera
from ..views.solid_angle import PixelWeight
from ..warp.grid import Grid
from .effect_costs import EffectCost
from .next_accuracy import NextAccuracy


@dataclass(frozen=True)
class ReusedEye:
    """The first eye of a pair where it was made from a key frame, as its second eye was; or a mono frame's one view.

    key_frame is the number of that frame. reasons (H, W) are the eye's `Reason` flags, traced (H, W) its pixels that
    were traced, and variance_share (H, W) the variance of each of its pixels, as a share of that of a plain render's.
    refinement is the tracing that its probes asked for.
    """

    key_frame: int
    reasons: NDArray[np.uint16]
    traced: NDArray[np.bool_]
    variance_share: NDArray[np.float32]
    refinement: Refinement


@dataclass(frozen=True)
class StereoFrame:
    """A finished pair of one view layer, or the one view of a mono frame, and how it came about.

    eyes has the passes by view name; of one view, that is the target too. reasons (H, W) are the target's `Reason`
    flags; traced (H, W) are the pixels that were traced, which are more than those with a reason where a full render
    was the cheapest. variance_share (H, W) is the variance of each target pixel, as a share of that of a plain
    render's: 1 in a denoised picture. grid is the source's, None where nothing was warped. fill is how holes were
    traced, refinement the tracing that probes asked for; pilot_share is as in `TargetTracing`. seconds are by stage,
    and in total; source_cost is that of the source render, trace_costs are those by which fill methods were chosen.
    effect_costs are by effect; next_accuracy is the cost of the next better accuracy. invalid_pixels is the number of
    pixels by view that were no number. metadata is the renderer's. correction is how far traced pixels were moved to
    match a source of another engine, None where it is the same. warped_by is 'numpy' or 'gpu'; gpu is its name, None
    for NumPy. light_scale is the number by which light was multiplied to be judged as it is seen (`images/seen_light`).
    pixel_weight is that of the target's pixels (`views/solid_angle`). camera is the target's, None where it is not
    known. reused is the first eye where it was made from an earlier frame, None where it was rendered.
    """

    eyes: dict[str, Passes]
    reasons: NDArray[np.uint16]
    traced: NDArray[np.bool_]
    variance_share: NDArray[np.float32]
    grid: Grid | None
    fill: FillChoice
    refinement: Refinement
    pilot_share: float | None
    seconds: dict[str, float]
    source_cost: SourceCost
    trace_costs: TraceCosts
    effect_costs: dict[Effect, EffectCost]
    next_accuracy: NextAccuracy
    invalid_pixels: dict[str, int]
    metadata: dict[str, str]
    correction: Correction | None = None
    warped_by: str = "numpy"
    gpu: str | None = None
    light_scale: float = 1.0
    pixel_weight: PixelWeight = 1.0
    camera: Camera | None = None
    reused: ReusedEye | None = None


def traced_fractions(frame: StereoFrame) -> dict[str, float]:
    """Return the share, 0 to 1, of the target's pixels that was traced, by the label of the reason.

    A pixel may have several reasons. "rerendered" is the share in all. Reasons that no pixel has are left out, but for
    the three that every report names.
    """
    fractions = {reason.label: float(np.mean((frame.reasons & reason.bit) > 0)) for reason in Reason}
    named = ("disoccluded", "outside", "silhouette")
    result = {label: value for label, value in fractions.items() if label in named or value > 0.0}
    result["rerendered"] = float(np.mean(frame.traced))
    return result


def colour(passes: Passes) -> NDArray[np.float32]:
    """Return the colour pass (H, W, 4) of an eye's passes."""
    return passes[COLOUR_PASS]
