"""START HERE for many views: the outermost ones are rendered, and what is between is made from them, or split by
rendering one more.

`view_plan` says which. Two views are a pair: the first is rendered, and the other made from it, or rendered too.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..estimate.noise_ratio import Estimate
from ..estimate.tracing import ProbedTracing
from ..images.depth_pass import with_depth_pass
from ..images.passes import Passes, without_internal_passes
from ..settings.accuracy import Accuracy, accuracy_of
from ..settings.frame import StereoSettings
from ..trace.costs import TraceCosts
from ..trace.fill import SourceCost
from ..trace.requests import run_together
from ..views.view import Rig, View
from .finishing import Completed, composited, denoised
from .renderer import Renderer
from .shared_findings import SharedFindings
from .source import Source, render_source
from .stages import Stage
from .stopwatch import Stopwatch
from .task import FrameTask
from .tuning import TUNING
from .view_plan import Gap, ViewCosts
from .warping import warp_sources

PROBE_SEED_STEP = 7919
"""Added to the seed of the probes' places from view to view, so that each view is probed elsewhere."""


@dataclass(frozen=True)
class FinishedView:
    """A finished view, and how it came about.

    number is its place in the order of the views. passes (H, W, C) are those that users get. sources are the names of
    the views that it was made from, none for a view that was rendered whole. traced (H, W) are the pixels that were
    traced. variance_share (H, W) is the variance of each pixel as a share of a plain render's. estimate is that of the
    error, None where nothing was probed.
    """

    number: int
    name: str
    passes: Passes
    sources: tuple[str, ...]
    traced: NDArray[np.bool_]
    variance_share: NDArray[np.float32]
    estimate: Estimate | None = None


@dataclass(frozen=True)
class PlanStep:
    """A step of the plan as it was decided under way: the views that it is about, and what was done and why, in
    words."""

    views: tuple[str, ...]
    text: str


@dataclass
class ViewsMaker:
    """Renders and makes the views of one frame, and hands each to `on_view` when it is finished.

    renderer can render each of the `views` whole, and trace pixels of it. accuracy is that of the frame, for a picture
    of `SettingsTuning.unscaled_picture_px`. steps, and the costs of the views that were rendered whole, grow under way.
    light_scale is the number by which light is multiplied to be judged as it is seen: None before the first render.
    """

    renderer: Renderer
    settings: StereoSettings
    views: Sequence[View]
    accuracy: Accuracy
    watch: Stopwatch
    known_costs: Callable[[], TraceCosts]
    on_view: Callable[[FinishedView], None]
    steps: list[PlanStep] = field(default_factory=list)
    costs: list[SourceCost] = field(default_factory=list)
    light_scale: float | None = None
    _sources: dict[int, Source] = field(default_factory=dict)
    _findings: SharedFindings = field(default_factory=SharedFindings)
    _made_seconds: float = 0.0
    _refined: tuple[int, float] | None = None

    def make_all(self) -> None:
        """Render or make all views, the outermost ones first."""
        last = len(self.views) - 1
        self.render(0, "outermost")
        if last == 1:
            self._make_other()
            return
        self.render(last, "outermost")
        gaps = [Gap(0, last)]
        while gaps:
            gap = gaps.pop()
            if gap.count and self.is_split(gap):
                gaps += reversed(gap.halves())
                continue
            # From left to right: no other gap needs this source.
            del self._sources[gap.first]

    def _make_other(self) -> None:
        """Make the second of two views from the first; its tracing is a full render where that is cheaper."""
        self._begin(Stage.WARP)
        [done] = self._completed((0,), [(1, self._warped((0,), 1))])
        traced, names = float(np.mean(done.target.traced)), (self.views[1].name,)
        self.steps.append(PlanStep(names, f"made from the other: {traced:.0%} traced; {done.fill.reason}"))
        self._finish((0,), 1, done)

    def render(self, number: int, why: str) -> None:
        """Render a view whole, to be a source of others; `why` goes into the plan."""
        view = self.views[number]
        task = self._task(view, view)
        source = render_source(task, self.accuracy, light_scale=self.light_scale)
        self.costs.append(source.cost)
        self._sources[number], self.light_scale = source, source.light_scale
        self.steps.append(PlanStep((view.name,), f"rendered: {why}"))
        whole = np.ones(source.seen.depth.shape, bool)
        passes = with_depth_pass(without_internal_passes(source.rendered), view.camera)
        self.on_view(FinishedView(number, view.name, passes, (), whole, whole.astype(np.float32)))

    def is_split(self, gap: Gap) -> bool:
        """Fill a gap by making all of its views, or render the one in the middle and return True: two gaps of half the
        width are left then.

        The view in the middle tells: by its holes, and then, once it is probed, by what its promise calls for.
        """
        task = self._task(self.views[gap.first], self.views[gap.middle])
        start = self._begin(Stage.WARP)
        tracing = self._warped(gap.ends, gap.middle)
        self._made_seconds = time.perf_counter() - start
        holes = float(np.mean(tracing.target.traced))
        share = min(holes + self._expected_refinement(gap) * task.may_differ, 1.0)
        costs = self._costs()
        if costs.is_split(gap.count, share):
            self.render(gap.middle, _reason(gap, holes, share, costs, "expected"))
            return True
        [made] = self._completed(gap.ends, [(gap.middle, tracing)])
        traced = float(np.mean(made.target.traced))
        self._refined = gap.last - gap.first, max(traced - holes, 0.0)
        others = [number for number in gap.inner if number != gap.middle]
        # The view in the middle is made by now: the others are what is left to be decided.
        if task.may_differ and self._is_split_after_all(gap, traced, costs):
            self.render(gap.middle, _reason(gap, holes, traced, costs, "found"))
            return True
        names = tuple(self.views[number].name for number in gap.inner)
        self.steps.append(PlanStep(names, f"made: {_figures(gap, holes, traced, costs)}"))
        self._finish(gap.ends, gap.middle, made)
        for batch in self._batches(others):
            self._begin(Stage.WARP)
            warped = [(number, self._warped(gap.ends, number)) for number in batch]
            for number, done in zip(batch, self._completed(gap.ends, warped), strict=True):
                self._finish(gap.ends, number, done)
        return False

    @staticmethod
    def _is_split_after_all(gap: Gap, traced: float, costs: ViewCosts) -> bool:
        """Return whether it is still worth while to render the view in the middle of a gap, which was made already,
        and of which a share `traced` was traced."""
        left, right = gap.halves()
        halved = traced * TUNING.halved_gap_share
        split = 1.0 + costs.of_gap(left.count, halved) + costs.of_gap(right.count, halved)
        return split < costs.of_making(gap.count - 1, traced)

    def _expected_refinement(self, gap: Gap) -> float:
        """Return the share of the view in the middle of a gap that its promise will call for beyond the holes: by the
        last gap measured, in proportion to the angle; 0 before any was."""
        if self._refined is None:
            return 0.0
        width, share = self._refined
        return min(share * (gap.last - gap.first) / width, 1.0)

    def _costs(self) -> ViewCosts:
        """Return the costs of a view as they are known by now."""
        whole = self.plain_seconds(1) - self.costs[0].sync_seconds
        return ViewCosts(self.known_costs().packed_pixel_cost, self._made_seconds / max(whole, 1e-9))

    def plain_seconds(self, count: int) -> float:
        """Return the predicted seconds of rendering so many views plainly, with one sync of the scene."""
        whole = float(np.mean([cost.per_frame + cost.denoise_seconds for cost in self.costs]))
        return self.costs[0].sync_seconds + count * whole

    def _batches(self, numbers: Sequence[int]) -> list[Sequence[int]]:
        """Return these views in batches whose pixels are traced together: so many that memory holds them."""
        camera = self.views[0].camera
        size = max(int(TUNING.batch_pixels / (camera.width * camera.height)), 1)
        return [numbers[at : at + size] for at in range(0, len(numbers), size)]

    def _begin(self, stage: Stage) -> float:
        """Begin a stage on the watch, and return the time."""
        self.watch.lap(stage)
        return time.perf_counter()

    def _task(self, source: View, target: View) -> FrameTask:
        """Return the task of making one view from others, of which `source` is the first."""
        return FrameTask(self.renderer, self.settings, source, target, self._findings, self.known_costs, self.watch)

    def _warped(self, ends: Sequence[int], number: int) -> ProbedTracing:
        """Return a view as the rendered ones of these numbers show it, ready to be traced."""
        sources = [self._sources[end] for end in ends]
        task = self._task(self.views[ends[0]], self.views[number])
        warped = warp_sources(task, sources, seed=self.renderer.seed + PROBE_SEED_STEP * number)
        return ProbedTracing(self.renderer, warped)

    def _completed(self, ends: Sequence[int], targets: Sequence[tuple[int, ProbedTracing]]) -> list[Completed]:
        """Return views that were warped from those of the numbers `ends`, given by number, traced together: holes and
        probes, then what these ask for."""
        tracings = [tracing for _, tracing in targets]
        self._begin(Stage.FILL)
        fills = run_together([tracing.fill_steps() for tracing in tracings], self.renderer)
        self._begin(Stage.REFINE)
        refinements = run_together([tracing.refine_steps() for tracing in tracings], self.renderer)
        sources = tuple(self._sources[end] for end in ends)
        return [
            Completed(sources, tracing.warped, tracing.target, fill, refinement)
            for tracing, fill, refinement in zip(tracings, fills, refinements, strict=True)
        ]

    def _finish(self, ends: Sequence[int], number: int, done: Completed) -> None:
        """Put a view together that was made from those of the numbers `ends`, and hand it over."""
        view, sources = self.views[number], [self.views[end] for end in ends]
        task = self._task(sources[0], view)
        share = done.warped.variance_share_of(done.target)
        self._begin(Stage.COMPOSITE)
        finished = composited(task, done)
        denoising = done.sources[0].denoising
        if denoising is not None:
            self._begin(Stage.DENOISE_TARGET)
            finished = denoised(done, finished, denoising)
        passes = with_depth_pass(without_internal_passes(finished.passes), view.camera)
        names, estimate = tuple(source.name for source in sources), done.refinement.estimate
        self.on_view(FinishedView(number, view.name, passes, names, done.target.traced, share, estimate))


def render_many_views(
    renderer: Renderer,
    settings: StereoSettings,
    names: Sequence[str],
    on_view: Callable[[FinishedView], None],
    *,
    accuracy: Accuracy | None = None,
    watch: Stopwatch | None = None,
    known_costs: Callable[[], TraceCosts] = TraceCosts,
) -> ViewsMaker:
    """Render the views of these names, from the leftmost to the rightmost, and hand each to `on_view` when it is
    finished; return the maker, which knows how they came about.

    The parameters are those of `render_stereo_frame`. At least two names are needed. Raises StereoReprojectError when a
    render fails.
    """
    rig = Rig.of_cameras(renderer.cameras, renderer.motion)
    maker = ViewsMaker(
        renderer,
        settings,
        [rig[name] for name in names],
        accuracy or accuracy_of(settings),
        watch or Stopwatch(),
        known_costs,
        on_view,
    )
    maker.make_all()
    maker.watch.lap()
    return maker


def _reason(gap: Gap, holes: float, share: float, costs: ViewCosts, how: str) -> str:
    """Return why a gap is split, in words: its view in the middle is `how` ("expected" or "found") to have a share
    traced."""
    return f"in the middle of a gap: {_figures(gap, holes, share, costs)} {how}"


def _figures(gap: Gap, holes: float, share: float, costs: ViewCosts) -> str:
    """Return in words what a gap was decided by."""
    made = costs.of_making(gap.count, share)
    return (
        f"of the middle one of {gap.count} views {share:.0%} traced ({holes:.0%} holes): {made:.1f} views of work to"
        f" make them, {costs.of_gap(gap.count, share):.1f} at best"
    )
