"""START HERE for reuse over time: the first eye of a frame is made from that of a key frame, an earlier frame that was
rendered whole, and the other eye from both. A mono animation has the first eye alone.

A pixel is looked up where it was traced: in the key frame, however many frames lie between, or among the traced pixels
of this frame's first eye. No frame is made from one that comes after it, nor from another made frame.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..estimate.tracing import ProbedTracing, WarpedTarget
from ..holes.moved import Movers
from ..images.depth_pass import with_depth_pass
from ..images.passes import Passes, without_internal_passes
from ..settings.frame import StereoSettings
from ..trace.costs import TraceCosts
from ..views.view import Rig
from .finishing import Completed, FinishedPasses, account_of, all_reasons, composited, denoised, traced_part
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
    """Changes since the key frame.

    number is that of the frame that is made. movers are what has moved, by the name of the eye, and stale (H, W) the
    pixels of the key frame's eye that show it where it was. Without movers nothing has moved.
    """

    number: int
    movers: Mapping[str, Movers] = field(default_factory=dict)
    stale: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class _Eye:
    """One made eye: its task, the target once it is completed, and its finished passes."""

    task: FrameTask
    done: Completed
    finished: FinishedPasses


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
    """Make both eyes of a frame from a key frame, or its one view, and return it; None where so much would have to be
    traced that it is better rendered.

    Besides the camera, only the movers of `changed` may have changed since the key frame. The other parameters are
    those of `render_stereo_frame`. Raises StereoReprojectError when a render fails.
    """
    rig = Rig.of_cameras(renderer.cameras, renderer.motion)
    tasks = [
        FrameTask(renderer, settings, key.source.seen.view, rig[name], findings, known_costs, watch)
        for name in dict.fromkeys((settings.source, settings.target))
    ]
    # The key frame was rendered by a renderer of its own.
    renderer.expect_probes(probed=any(task.may_differ for task in tasks) and key.source.accuracy.promise is not None)

    seeds = [renderer.seed + PROBE_SEED_STEP * (2 * changed.number + eye) for eye in range(len(tasks))]
    movers = [changed.movers.get(task.target.name) for task in tasks]
    source = _denoised_by(renderer, key.source)
    source = source if changed.stale is None else _still_there(source, changed.stale)
    watch.lap(Stage.WARP)
    warped = warp_sources(tasks[0], [source], seed=seeds[0], movers=movers[:1])
    if float(np.mean(warped.reprojection.reasons > 0)) > TUNING.max_traced_of_key:
        return None
    eyes = [_completed(tasks[0], (source,), warped)]

    if len(tasks) > 1:
        watch.lap(Stage.WARP)
        sources = source, traced_part(tasks[0].target, eyes[0].done, eyes[0].finished)
        # What was traced in this frame has moved with it.
        warped = warp_sources(tasks[1], sources, seed=seeds[1], movers=(movers[1], None))
        eyes.append(_completed(tasks[1], sources, warped))
    watch.lap(Stage.ACCOUNT)
    return _frame(key, eyes)


def _denoised_by(renderer: Renderer, source: Source) -> Source:
    """Return a source whose denoiser is this frame's: that of the key frame may have gone with its scene."""
    if source.denoising is None or renderer.denoise is None:
        return source
    return replace(source, denoising=replace(source.denoising, denoise=renderer.denoise))


def _still_there(source: Source, stale: NDArray[np.bool_]) -> Source:
    """Return a source without the pixels `stale` (H, W), which show what is there no more."""
    return replace(source, seen=replace(source.seen, traced=~stale))


def _completed(task: FrameTask, sources: tuple[Source, ...], warped: WarpedTarget) -> _Eye:
    """Trace what these sources do not show of a warped eye, and what its probes ask for; return the eye, denoised where
    the scene is."""
    watch, tracing = task.watch, ProbedTracing(task.renderer, warped)
    watch.lap(Stage.FILL)
    fill = tracing.fill()
    watch.lap(Stage.REFINE)
    refinement = tracing.refine()
    watch.lap(Stage.COMPOSITE)
    done = Completed(sources, warped, tracing.target, fill, refinement)
    finished, denoising = composited(task, done), sources[0].denoising
    if denoising is not None:
        watch.lap(Stage.DENOISE_TARGET)
        finished = denoised(done, finished, denoising)
    return _Eye(task, done, finished)


def _for_users(eye: _Eye) -> Passes:
    """Return an eye's passes for users, with depth as Blender's Depth pass has it."""
    return with_depth_pass(without_internal_passes(eye.finished.passes), eye.task.target.camera)


def _frame(key: KeyFrame, made: Sequence[_Eye]) -> StereoFrame:
    """Return the finished frame of two made eyes, or of one; what is said of the target is the last one's."""
    first, last = made[0], made[-1]
    done, warped, watch = last.done, last.done.warped, last.task.watch
    account = account_of(last.task, done, last.finished.passes)
    watch.lap()
    target, other = done.target, first.done.target
    reused = ReusedEye(
        key.number,
        all_reasons(first.done.warped.reprojection.reasons, other),
        other.traced,
        first.done.warped.variance_share_of(other),
        first.done.refinement,
    )
    eyes = {eye.task.target.name: eye for eye in made}
    return StereoFrame(
        eyes={name: _for_users(eye) for name, eye in eyes.items()},
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
        invalid_pixels={name: eye.finished.lost for name, eye in eyes.items()},
        metadata={**key.metadata, **last.task.renderer.metadata},
        warped_by=warped.reprojection.warped_by,
        light_scale=key.source.light_scale,
        pixel_weight=warped.pixel_weight,
        camera=last.task.target.camera,
        reused=reused,
    )
