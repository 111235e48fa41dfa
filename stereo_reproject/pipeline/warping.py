"""The source warped into the target, with what plans and does the tracing of its holes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..estimate.tracing import TargetTracing, WarpedTarget
from ..holes.classifier import Optics
from ..holes.moved import Movers
from ..holes.reprojection import Reprojection, reproject
from ..images.passes import deepest
from ..trace.costs import TraceCosts
from ..trace.fill import check_fill
from ..trace.planner import FillPlanner
from ..views.camera import goes_round
from ..views.solid_angle import pixel_weights
from ..warp.options import WarpOptions
from ..warp.stage import choose_warper, seconds_taken
from ..warp.warper import NUMPY, Warper
from .calibration import calibrated_costs, worth_measuring
from .next_accuracy import WHOLE, holes_of, next_better
from .onlooker import shown_target
from .source import Source
from .stages import Stage
from .task import FrameTask


@dataclass(frozen=True)
class WarpedSource:
    """The source warped into the target, ready to be traced: the holes, and what plans and does the tracing.

    gpu is the name of the GPU that was chosen to warp, None for NumPy. better is the name of the next better accuracy,
    and better_holes (H, W) are the holes that it would have, None where that is a full render.
    """

    target: WarpedTarget
    tracing: TargetTracing
    gpu: str | None
    better: str
    better_holes: NDArray[np.bool_] | None


def warp_source(task: FrameTask, source: Source) -> WarpedSource:
    """Return the source warped into the target, with what plans and does its tracing.

    All that only tells the holes takes three times as much memory, and is let go here. So the holes of the next better
    accuracy are found now, though they belong to the account of the finished frame.
    """
    interpolations = interpolations_of(task.settings.interpolation, denoised=source.denoising is not None)
    reprojection, gpu = _reprojected(task, [source], interpolations)
    target = _target_of(task, source, reprojection, seed=task.renderer.seed)
    tracing = task.renderer.tracing_of(target)
    better = next_better(source.accuracy) if tracing.can_promise else WHOLE
    with task.watch.aside(Stage.ACCOUNT):
        better_holes = holes_of(better, reprojection, denoised=source.denoising is not None)
    return WarpedSource(target, tracing, gpu, better, better_holes)


def warp_sources(
    task: FrameTask, sources: Sequence[Source], *, seed: int, movers: Sequence[Movers | None] = ()
) -> WarpedTarget:
    """Return several sources warped into the target, ready to be traced; seed is that of its probes' places.

    The sources have one accuracy, denoiser and light scale. movers has, for each source, what has moved since it was
    rendered; empty where nothing has. Where something has, all else is probed where it can be, since shadows and
    reflections move too.
    """
    linear, colour = interpolations_of(task.settings.interpolation, denoised=sources[0].denoising is not None)
    # Beside views that are rendered whole, another look of the noise is seen.
    interpolations = linear, "grained" if colour == "adaptive" else colour
    reprojection, _ = _reprojected(task, sources, interpolations, movers)
    target = _target_of(task, sources[0], reprojection, seed=seed)
    has_moved = any(moved is not None for moved in movers)
    return replace(target, needs_probes=target.needs_probes or (has_moved and target.denoising is None))


def _target_of(task: FrameTask, source: Source, reprojection: Reprojection, *, seed: int) -> WarpedTarget:
    """Return a reprojection as a target that is ready to be traced, by the accuracy and the denoiser of `source`. seed
    is that of its probes' places."""
    planner = _planner_of(task, source, reprojection)
    return WarpedTarget(
        task.target.name,
        reprojection.answered(),
        planner,
        source.accuracy,
        source.denoising,
        task.may_differ,
        seed,
        source.light_scale,
        pixel_weights(task.target.camera),
        goes_round(task.target.camera),
    )


def show_target(
    task: FrameTask, source: Source, warped: WarpedSource, *, holes: NDArray[np.bool_] | None = None
) -> None:
    """Show the watch's onlooker the target as it is so far; `holes` (H, W) are still to be traced."""
    target = warped.tracing.target
    task.watch.show(target.view, lambda: shown_target(target.colour, source.light_scale, holes))


def _reprojected(
    task: FrameTask,
    sources: Sequence[Source],
    interpolations: tuple[str, str],
    movers: Sequence[Movers | None] = (),
) -> tuple[Reprojection, str | None]:
    """Return the sources warped into the target, and the name of the GPU that was chosen for it, None for NumPy.
    interpolations are those of most passes and of the colour; movers are as for `warp_sources`."""
    renderer, settings, target = task.renderer, task.settings, task.target
    warp = partial(
        reproject,
        [source.seen for source in sources],
        target,
        sources[0].accuracy,
        optics=Optics(renderer.lens, renderer.volumes),
        options=WarpOptions(settings.grid_threshold, *interpolations),
        movers=movers,
    )

    def is_faster(gpu: Warper) -> bool:
        return task.findings.gpu_is_faster(lambda: seconds_taken(run, gpu) < seconds_taken(run, NUMPY))

    def run(warper: Warper) -> object:
        return warp(warper=warper).reasons

    warper = choose_warper(settings.warp, target.camera.width * target.camera.height, renderer.gpu, is_faster)
    return warp(warper=warper), warper.device


def _planner_of(task: FrameTask, source: Source, reprojection: Reprojection) -> FillPlanner:
    """Return the planner of the frame's traces, which knows the costs of tracing, or measures them first.

    Raises BadInputError where the fill method that was asked for cannot be used for what the source shows.
    """
    renderer, settings = task.renderer, task.settings
    blockers = renderer.fill_blockers(deepest(source.seen.passes))
    check_fill(settings.fill, blockers)
    # Only now is it certain by which packed camera pixels are traced, each of which has costs of its own.
    costs = task.known_costs()
    planner = FillPlanner(settings.fill, task.findings.cost(source.cost), blockers, costs)

    def measure() -> TraceCosts:
        holes = reprojection.reasons > 0
        if not worth_measuring(planner, holes):
            return costs
        task.watch.lap(Stage.PILOT)
        return calibrated_costs(renderer, replace(planner, cost=source.cost), task.target.name, holes, renderer.seed)

    return replace(planner, costs=task.findings.trace_costs(costs, measure, packed_by=renderer.packed_by))


def interpolations_of(asked: str, *, denoised: bool) -> tuple[str, str]:
    """Return two interpolations for a warp: that of most passes, and that of the colour.

    asked is one of the settings' names; for "auto" they are linear, but for the colour cubic in a denoised picture and
    adaptive in a noisy one.
    """
    if asked != "auto":
        return asked, asked
    return "linear", "cubic" if denoised else "adaptive"
