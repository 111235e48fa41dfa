"""START HERE for reuse over time: both eyes of a frame are made from the eye of a key frame, an earlier frame that was
rendered whole.

A pixel is looked up where it was rendered, in the key frame, however many frames lie between. No frame is made from one
that comes after it, nor from a frame that was itself made.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..estimate.tracing import ProbedTracing
from ..holes.moved import Movers
from ..images.depth_pass import with_depth_pass
from ..images.passes import Passes, without_internal_passes
from ..settings.frame import StereoSettings
from ..trace.costs import TraceCosts
from ..trace.requests import run_together
from ..views.view import Rig
from .finishing import Completed, FinishedPasses, account_of, all_reasons, composited, denoised
from .renderer import Renderer
from .shared_findings import SharedFindings
from .source import Source
from .stages import Stage
from .stereo_frame import ReusedEye, StereoFrame
from .stopwatch import Stopwatch
from .task import FrameTask
from .tuning import TUNING
from .warping import warp_sources

PROBE_SEED_STEP = 15_485_863
"""Added to the seed of the probes' places from eye to eye and from frame to frame, so that each is probed elsewhere."""


@dataclass(frozen=True)
class KeyFrame:
    """The eye of an earlier frame that was rendered whole.

    number is that of the frame. source is its first eye, ready to be warped, with its camera in that frame. metadata
    are the texts of its render.
    """

    number: int
    source: Source
    metadata: Mapping[str, str]


@dataclass(frozen=True)
class SinceKey:
    """Changes since the key frame: number is that of the frame that is made; movers are what has moved, by the
    name of the eye, none where nothing has."""

    number: int
    movers: Mapping[str, Movers]


@dataclass(frozen=True)
class _Eye:
    """One made eye: its task, and the target once it is completed."""

    task: FrameTask
    done: Completed


def render_from_key(
    renderer: Renderer,
    settings: StereoSettings,
    key: KeyFrame,
    changed: SinceKey,
    *,
    findings: SharedFindings,
    watch: Stopwatch,
    known_costs: Callable[[], TraceCosts],
) -> StereoFrame | None:
    """Make both eyes of a frame from a key frame, and return the pair; None where so much would have to be traced that
    it is better rendered.

    Besides the camera, only the movers of `changed` may have changed since the key frame. The other parameters are
    those of `render_stereo_frame`. Raises StereoReprojectError when a render fails.
    """
    rig = Rig.of_cameras(renderer.cameras, renderer.motion)
    tasks = [
        FrameTask(renderer, settings, key.source.seen.view, rig[name], findings, known_costs, watch)
        for name in (settings.source, settings.target)
    ]
    # The key frame was rendered by a renderer of its own.
    renderer.expect_probes(probed=any(task.may_differ for task in tasks) and key.source.accuracy.promise is not None)

    watch.lap(Stage.WARP)
    tracings = []
    for eye, task in enumerate(tasks):
        seed = renderer.seed + PROBE_SEED_STEP * (2 * changed.number + eye)
        movers = changed.movers.get(task.target.name)
        tracings.append(ProbedTracing(renderer, warp_sources(task, [key.source], seed=seed, movers=movers)))

    if float(np.mean(tracings[0].target.traced)) > TUNING.max_traced_of_key:
        return None

    watch.lap(Stage.FILL)
    fills = run_together([tracing.fill_steps() for tracing in tracings], renderer)

    watch.lap(Stage.REFINE)
    refinements = run_together([tracing.refine_steps() for tracing in tracings], renderer)

    eyes = [
        _Eye(task, Completed((key.source,), tracing.warped, tracing.target, fill, refinement))
        for task, tracing, fill, refinement in zip(tasks, tracings, fills, refinements, strict=True)
    ]
    finished = [_finished(eye, watch) for eye in eyes]
    watch.lap(Stage.ACCOUNT)
    return _frame(key, eyes, finished, watch)


def _finished(eye: _Eye, watch: Stopwatch) -> FinishedPasses:
    """Return the finished passes of a made eye, denoised where the scene is."""
    watch.lap(Stage.COMPOSITE)
    finished, denoising = composited(eye.task, eye.done), eye.done.sources[0].denoising
    if denoising is not None:
        watch.lap(Stage.DENOISE_TARGET)
        finished = denoised(eye.done, finished, denoising)
    return finished


def _for_users(eye: _Eye, finished: FinishedPasses) -> Passes:
    """Return an eye's passes for users, with depth as Blender's Depth pass has it."""
    return with_depth_pass(without_internal_passes(finished.passes), eye.task.target.camera)


def _frame(key: KeyFrame, eyes: list[_Eye], finished: list[FinishedPasses], watch: Stopwatch) -> StereoFrame:
    """Return the finished pair of two made eyes; what is said of the target is the second's."""
    first, second = eyes
    done, warped = second.done, second.done.warped
    account = account_of(second.task, done, finished[1].passes)
    watch.lap()
    target, other = done.target, first.done.target
    reused = ReusedEye(
        key.number,
        all_reasons(first.done.warped.reprojection.reasons, other),
        other.traced,
        first.done.warped.variance_share_of(other),
        first.done.refinement,
    )
    names = [eye.task.target.name for eye in eyes]
    return StereoFrame(
        eyes={name: _for_users(eye, passes) for name, eye, passes in zip(names, eyes, finished, strict=True)},
        reasons=account.reasons,
        traced=target.traced,
        variance_share=warped.variance_share_of(target),
        grid=warped.reprojection.grid,
        fill=done.fill,
        refinement=done.refinement,
        pilot_share=None,
        seconds={**watch.seconds, "total": account.total_seconds},
        source_cost=key.source.cost,
        trace_costs=warped.planner.costs,
        effect_costs=account.effect_costs,
        next_accuracy=account.next_accuracy,
        invalid_pixels={name: passes.lost for name, passes in zip(names, finished, strict=True)},
        metadata={**key.metadata, **second.task.renderer.metadata},
        warped_by=warped.reprojection.warped_by,
        light_scale=key.source.light_scale,
        pixel_weight=warped.pixel_weight,
        camera=second.task.target.camera,
        reused=reused,
    )
