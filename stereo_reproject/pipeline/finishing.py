"""The finished frame: the target's passes as users get them, and the account of how they came about."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..estimate.target import Provenance, Target
from ..estimate.tracing import Refinement, WarpedTarget
from ..images.denoising import Denoising, denoise_target
from ..images.depth_pass import with_depth_pass
from ..images.effects import Effect
from ..images.effects_pass import UNKNOWN_EFFECTS, effects_of
from ..images.passes import Passes, without_internal_passes
from ..images.reasons import Reason
from ..images.seen_light import scaled_light
from ..trace.fill import FillChoice
from ..views.view import View
from ..warp.composite import count_pixels, not_numbers, replace_non_finite, spoilt
from ..warp.rendered_view import RenderedView
from .effect_costs import EffectCost, effect_costs
from .next_accuracy import WHOLE, FinishedTarget, NextAccuracy, cost_of
from .source import Source
from .stages import OUTSIDE_TOTAL
from .stereo_frame import StereoFrame
from .task import FrameTask
from .warping import WarpedSource, interpolations_of


@dataclass(frozen=True)
class Completed:
    """The target after it was warped and traced, with the sources that it was made from and how it was traced."""

    sources: tuple[Source, ...]
    warped: WarpedTarget
    target: Target
    fill: FillChoice
    refinement: Refinement


@dataclass(frozen=True)
class FinishedPasses:
    """The target's passes as they are in the end, with 0 for what was no number.

    lost is the number of pixels that had any such value; invalid (H, W) are those that had one in an essential pass.
    """

    passes: Passes
    lost: int
    invalid: NDArray[np.bool_]


def composited(task: FrameTask, done: Completed) -> FinishedPasses:
    """Return the target's passes with 0 for values that are no number, and light as bright again as the scene has it.

    Values also count as lost that were looked up where the source's own were no number. The passes of `done` are let
    go: a denoiser needs memory for a large picture several times over.
    """
    target, source, reprojection = done.target, done.sources[0], done.warped.reprojection
    finished, invalid = replace_non_finite(target.passes)
    dark = not_numbers(target.passes)
    interpolation, _ = interpolations_of(task.settings.interpolation, denoised=False)
    for name, pixels in spoilt(
        [each.lost for each in done.sources], reprojection.warp, interpolation=interpolation, wraps=source.seen.wraps
    ).items():
        warped = pixels & ~target.traced
        if name in finished and warped.any():
            finished[name] = np.where(warped[..., None], np.float32(0.0), finished[name])
            dark[name] = warped | dark.get(name, False)
    result = FinishedPasses(scaled_light(finished, 1.0 / source.light_scale), count_pixels(dark), invalid)
    for replaced in (target.passes, reprojection.passes):
        replaced.clear()
    return result


def denoised(done: Completed, finished: FinishedPasses, denoising: Denoising) -> FinishedPasses:
    """Return the target's finished passes with the colour of its traced pixels denoised."""
    target = done.target
    refined = target.any_of(Provenance.REFINED)
    passes = denoise_target(finished.passes, target.keeps_warped_colour, denoising, refined=refined)
    return replace(finished, passes=passes)


def traced_part(view: View, done: Completed, finished: FinishedPasses) -> Source:
    """Return a finished target as a source of other views, of which only what was traced is looked up.

    view is the target's; finished are its passes, the internal ones too.
    """
    first, target = done.sources[0], done.target
    # A denoised probe keeps the colour of the warp.
    traced = target.traced if first.denoising is None else ~target.keeps_warped_colour
    for mirrors in (samples.mirrors for samples in done.warped.reprojection.samples):
        if mirrors is not None:
            # The image in a mirror is found by passes that are never warped.
            traced = traced & ~mirrors[0]
    passes = scaled_light(finished.passes, first.light_scale)
    return replace(first, seen=RenderedView(view, passes, finished.invalid, first.seen.cost, traced), lost={})


def finished_frame(task: FrameTask, warped: WarpedSource, done: Completed, finished: FinishedPasses) -> StereoFrame:
    """Return the finished frame, with the account of what each effect cost, which is not in the total seconds. warped
    is the target as it came out of the warp."""
    [source], target = done.sources, done.target
    reprojection, better = done.warped.reprojection, warped.better
    account = account_of(task, done, finished.passes, better=better, better_holes=warped.better_holes)
    names = task.source.name, task.target.name
    task.watch.lap()
    return StereoFrame(
        eyes=dict(zip(names, _as_blender_has_them(task, source, finished), strict=True)),
        reasons=account.reasons,
        traced=target.traced,
        variance_share=done.warped.variance_share_of(target),
        grid=reprojection.grid,
        fill=done.fill,
        refinement=done.refinement,
        pilot_share=warped.tracing.pilot_share,
        seconds={**task.watch.seconds, "total": account.total_seconds},
        source_cost=source.cost,
        trace_costs=done.warped.planner.costs,
        effect_costs=account.effect_costs,
        next_accuracy=account.next_accuracy,
        invalid_pixels=dict(zip(names, (count_pixels(source.lost), finished.lost), strict=True)),
        metadata=dict(task.renderer.metadata),
        correction=warped.tracing.correction,
        warped_by=reprojection.warped_by,
        gpu=warped.gpu if reprojection.warped_by == "gpu" else None,
        light_scale=source.light_scale,
        pixel_weight=done.warped.pixel_weight,
        camera=task.target.camera,
    )


def _as_blender_has_them(task: FrameTask, source: Source, finished: FinishedPasses) -> tuple[Passes, Passes]:
    """Return the passes of source and target for users, with depth as Blender's Depth pass has it."""
    target = without_internal_passes(finished.passes)
    return with_depth_pass(source.rendered, task.source.camera), with_depth_pass(target, task.target.camera)


@dataclass(frozen=True)
class Account:
    """The account of a finished frame: its seconds so far, the target's `Reason` flags (H, W), the cost of each effect,
    and that of the next better accuracy."""

    total_seconds: float
    reasons: NDArray[np.uint16]
    effect_costs: dict[Effect, EffectCost]
    next_accuracy: NextAccuracy


def account_of(
    task: FrameTask,
    done: Completed,
    finished: Passes,
    *,
    better: str = WHOLE,
    better_holes: NDArray[np.bool_] | None = None,
) -> Account:
    """Return the account of a frame whose target has these finished passes.

    better is the name of the next better accuracy, and better_holes (H, W) are the holes that it would have, None where
    that is a full render.
    """
    refinement, target = done.refinement, done.target
    total = sum(seconds for stage, seconds in task.watch.seconds.items() if stage not in OUTSIDE_TOTAL)
    seconds = {**task.watch.seconds, "total": total}
    reprojection, planner = done.warped.reprojection, done.warped.planner
    reasons = all_reasons(reprojection.reasons, target)
    shown = np.where(reprojection.warp.covered, effects_of(finished), UNKNOWN_EFFECTS)
    evidence = None if refinement.whole else refinement.evidence
    spent = effect_costs(task.renderer.plan.called_for, shown, reasons, target.traced, seconds, evidence)
    whole, probed = bool(target.traced.all()), done.warped.needs_probes
    completed = FinishedTarget(better_holes, planner, done.fill, refinement, probed, is_whole=whole)
    return Account(total, reasons, spent, cost_of(better, completed, seconds))


def all_reasons(reasons: NDArray[np.uint16], target: Target) -> NDArray[np.uint16]:
    """Return the warp's reasons (H, W), with PROBE and REFINED added for the target's probes and refined tiles."""
    result = reasons.copy()
    probes = target.any_of(Provenance.PROBE)
    result[probes] |= Reason.PROBE.bit
    result[target.any_of(Provenance.REFINED) & ~probes] |= Reason.REFINED.bit
    return result
