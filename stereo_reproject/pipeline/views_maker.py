"""Views of one frame, rendered whole or made from others: what `many_views` decides is done here."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..estimate.noise_ratio import Estimate
from ..estimate.shared_noise import NoiseOrigins, origins_of_made, origins_of_render
from ..estimate.target import Provenance, Target
from ..estimate.tracing import ProbedTracing
from ..images.depth_pass import with_depth_pass
from ..images.passes import COLOUR_PASS, Passes, without_internal_passes
from ..settings.accuracy import Accuracy
from ..settings.frame import StereoSettings
from ..trace.costs import TraceCosts
from ..trace.fill import FillChoice, SourceCost
from ..trace.requests import run_together
from ..views.view import View
from .finishing import Completed, all_reasons, composited, denoised
from .fresh import FreshPixels
from .renderer import Renderer
from .shared_findings import SharedFindings
from .source import Source, render_source
from .stages import Stage
from .stopwatch import Stopwatch
from .task import FrameTask
from .tuning import TUNING
from .warping import warp_sources

PROBE_SEED_STEP = 7919
"""Added to the seed of the probes' places from view to view, so that each view is probed elsewhere."""


@dataclass(frozen=True)
class FinishedView:
    """A finished view, and how it came about.

    number is its place in the order of the views. passes (H, W, C) are those that users get. sources are the names of
    the views that it was made from, none for a view that was rendered whole. traced (H, W) are the pixels that were
    traced. variance_share (H, W) is the variance of each pixel as a share of a plain render's. estimate is that of the
    error, None where nothing was probed. origins are those of its noise, None in a denoised picture. Of a made view,
    reasons (H, W) are the `Reason` flags of its pixels, and shown_from is the share of all pixels, 0 to 1, that each of
    its sources shows, by name.
    """

    number: int
    name: str
    passes: Passes
    sources: tuple[str, ...]
    traced: NDArray[np.bool_]
    variance_share: NDArray[np.float32]
    estimate: Estimate | None = None
    origins: NoiseOrigins | None = None
    reasons: NDArray[np.uint16] | None = None
    shown_from: Mapping[str, float] = field(default_factory=dict)


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
    of `SettingsTuning.unscaled_picture_px`. fresh chooses pixels of made views to be traced anew. steps, and the costs
    of the views that were rendered whole, grow under way. light_scale is the number by which light is multiplied to be
    judged as it is seen: None before the first render.
    finish_seconds are those of putting the last made view together, and of denoising it: None before the first.
    sources has the views that were rendered whole and are still needed, by number. findings are those that the frame
    shares with others of an animation.
    """

    renderer: Renderer
    settings: StereoSettings
    views: Sequence[View]
    accuracy: Accuracy
    watch: Stopwatch
    known_costs: Callable[[], TraceCosts]
    on_view: Callable[[FinishedView], None]
    fresh: FreshPixels
    steps: list[PlanStep] = field(default_factory=list)
    costs: list[SourceCost] = field(default_factory=list)
    light_scale: float | None = None
    finish_seconds: float | None = None
    sources: dict[int, Source] = field(default_factory=dict)
    findings: SharedFindings = field(default_factory=SharedFindings)

    def render(self, number: int, why: str) -> None:
        """Render a view whole, to be a source of others; `why` goes into the plan."""
        view = self.views[number]
        # Of another view's place: whether something looks different from there decides what is rendered to be probed.
        task = self.task(view, self.views[-1 if number == 0 else 0])
        source = render_source(task, self.accuracy, light_scale=self.light_scale)
        self.costs.append(source.cost)
        self.sources[number], self.light_scale = source, source.light_scale
        self.steps.append(PlanStep((view.name,), f"rendered: {why}"))
        whole = np.ones(source.seen.depth.shape, bool)
        passes = with_depth_pass(without_internal_passes(source.rendered), view.camera)
        origins = None if source.denoising else origins_of_render(number, source.seen.passes[COLOUR_PASS])
        self.on_view(FinishedView(number, view.name, passes, (), whole, whole.astype(np.float32), origins=origins))

    def plain_seconds(self, count: int) -> float:
        """Return the predicted seconds of rendering so many views plainly, with one sync of the scene."""
        whole = float(np.mean([cost.per_frame + cost.denoise_seconds for cost in self.costs]))
        return self.costs[0].sync_seconds + count * whole

    @property
    def packed_seconds(self) -> float:
        """Predicted seconds of tracing all pixels of a view packed."""
        return self.known_costs().packed_pixel_cost * float(np.mean([cost.per_frame for cost in self.costs]))

    def batches(self, numbers: Sequence[int]) -> list[Sequence[int]]:
        """Return these views in batches whose pixels are traced together: so many that memory holds them."""
        camera = self.views[0].camera
        size = max(int(TUNING.batch_pixels / (camera.width * camera.height)), 1)
        return [numbers[at : at + size] for at in range(0, len(numbers), size)]

    def task(self, source: View, target: View) -> FrameTask:
        """Return the task of making one view from others, of which `source` is the first."""
        return FrameTask(self.renderer, self.settings, source, target, self.findings, self.known_costs, self.watch)

    def warped(self, ends: Sequence[int], number: int) -> ProbedTracing:
        """Return a view as the rendered ones of these numbers show it, ready to be traced."""
        self.watch.lap(Stage.WARP)
        sources = [self.sources[end] for end in ends]
        task = self.task(self.views[ends[0]], self.views[number])
        warped = warp_sources(task, sources, seed=self.renderer.seed + PROBE_SEED_STEP * number)
        tracing = ProbedTracing(self.renderer, warped)
        tracing.target = self.fresh.added_to(tracing.target, number)
        return tracing

    def filled(self, tracings: Sequence[ProbedTracing]) -> list[FillChoice]:
        """Trace the holes and the probes of warped views together; return how."""
        self.watch.lap(Stage.FILL)
        return run_together([tracing.fill_steps() for tracing in tracings], self.renderer)

    def completed(
        self, ends: Sequence[int], tracings: Sequence[ProbedTracing], fills: Sequence[FillChoice]
    ) -> list[Completed]:
        """Return views that were warped from those of the numbers `ends`, and filled so, once what their probes ask for
        is traced, together."""
        self.watch.lap(Stage.REFINE)
        refinements = run_together([tracing.refine_steps() for tracing in tracings], self.renderer)
        sources = tuple(self.sources[end] for end in ends)
        return [
            Completed(sources, tracing.warped, tracing.target, fill, refinement)
            for tracing, fill, refinement in zip(tracings, fills, refinements, strict=True)
        ]

    def finish(self, ends: Sequence[int], number: int, done: Completed) -> None:
        """Put a view together that was made from those of the numbers `ends`, and hand it over."""
        view, sources = self.views[number], [self.views[end] for end in ends]
        task = self.task(sources[0], view)
        share, denoising = done.warped.variance_share_of(done.target), done.sources[0].denoising
        origins = None
        if denoising is None:
            fresh = done.target.any_of(Provenance.FRESH)
            warped_share = np.where(fresh, done.warped.variance_share, share)
            origins = origins_of_made(ends, done.warped.reprojection, done.target, warped_share)
        self.fresh.count(done.target)
        start = time.perf_counter()
        self.watch.lap(Stage.COMPOSITE)
        finished = composited(task, done)
        if denoising is not None:
            self.watch.lap(Stage.DENOISE_TARGET)
            finished = denoised(done, finished, denoising)
        self.finish_seconds = time.perf_counter() - start
        passes = with_depth_pass(without_internal_passes(finished.passes), view.camera)
        names, estimate = tuple(source.name for source in sources), done.refinement.estimate
        reprojection, target = done.warped.reprojection, done.target
        reasons, shown = all_reasons(reprojection.reasons, target), _shown_from(names, reprojection.warp.source, target)
        self.on_view(
            FinishedView(number, view.name, passes, names, target.traced, share, estimate, origins, reasons, shown)
        )


def _shown_from(names: Sequence[str], source: NDArray[np.integer], target: Target) -> dict[str, float]:
    """Return the share of all pixels that each of these views shows; source (H, W) is the number of each pixel's view
    among them, and the pixels of `target` that were traced are of none."""
    return {name: float(np.mean(target.warped & (source == number))) for number, name in enumerate(names)}
