"""START HERE: the way of a frame. Render one eye, warp it, trace the holes, put the other eye together."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..estimate.target import Provenance, Target
from ..estimate.tracing import Refinement, TargetTracing, WarpedTarget
from ..holes.classifier import Optics
from ..holes.reprojection import Reprojection, WarpedHoles, reproject
from ..images.denoising import Denoise, Denoising, denoise_source, denoise_target, remaining_noise
from ..images.effects import Effect, EffectsPlan
from ..images.effects_pass import UNKNOWN_EFFECTS, effects_of
from ..images.passes import COLOUR_PASS, DEPTH_PASS, Passes, without_internal_passes
from ..images.reasons import Reason
from ..images.seen_light import display_scale, scaled_light
from ..matching.matching import Correction
from ..settings.accuracy import Accuracy, accuracy_of, for_denoised, for_size
from ..settings.frame import StereoSettings
from ..trace.costs import TraceCosts
from ..trace.fill import FillChoice, SourceCost, check_fill
from ..trace.planner import FillPlanner
from ..trace.requests import TraceRequest
from ..views.camera import Camera, see_the_same
from ..views.frustum import Lens
from ..views.motion import Moving
from ..views.view import Rig
from ..warp.composite import count_pixels, not_numbers, replace_non_finite, spoilt
from ..warp.grid import Grid
from ..warp.options import WarpOptions
from ..warp.rendered_view import RenderedView
from ..warp.stage import choose_warper, seconds_taken
from ..warp.warper import NUMPY, Warper
from .calibration import calibrated_costs, worth_measuring
from .effect_costs import EffectCost, effect_costs
from .next_accuracy import WHOLE, FinishedTarget, NextAccuracy, cost_of, holes_of, next_better
from .shared_findings import SharedFindings
from .stages import OUTSIDE_TOTAL, Stage


class Renderer(Protocol):
    """Protocol of an object that renders one scene for the pipeline.

    `stereo_reproject.blender.engines.renderer` has the one that ships; tests have others, without Blender.
    """

    cameras: Mapping[str, Camera]
    """Cameras by view name."""
    plan: EffectsPlan
    """Effects that the scene calls for; where none of them may look different from each eye, no probe is traced."""
    lens: Lens
    """Lens of both eyes."""
    gpu: Callable[[], Warper | None]
    """Finds a GPU that can warp."""
    volumes: Sequence[NDArray]
    """Corners (8, 3) in the world of a box around each volume, infinite for one that may be anywhere."""
    seed: int
    """Seed of the scene's noise; the places of the probes follow from it."""
    motion: Mapping[str, Moving] | None
    """Motion of each eye in the frames around this one; None where no pass asks for it."""
    metadata: Mapping[str, str]
    """Texts of Blender's that belong to the passes rendered so far, as they stand in a file's header."""
    denoise: Denoise | None
    """The scene's denoiser; None where it has none. All renders then have the passes that `images.denoising` needs."""

    def render_source(self, view: str) -> tuple[Passes, SourceCost]:
        """Render the source eye, which is the view of this name; return its passes, whole and not denoised, and its
        cost."""
        ...

    def fill_blockers(self, deepest: float = 0.0) -> Mapping[str, str | None]:
        """Return by fill method the reason, in words, why it cannot be used for this scene, or None where it can.

        deepest is the greatest depth that the source sees, in scene units; 0 as long as that is not known.
        """
        ...

    def measured_costs(self, planner: FillPlanner, request: TraceRequest) -> TraceCosts:
        """Return the costs of tracing once these pixels were traced only to measure them, as
        `calibration.CostMeasurer` says. Asked of an animation's first frame alone."""
        ...

    def tracing_of(self, warped: WarpedTarget) -> TargetTracing:
        """Return what completes a warped target: with probes, or by another engine that is matched to the source's."""
        ...


@dataclass(frozen=True)
class StereoFrame:
    """A finished pair of one view layer, and how it came about.

    eyes has the passes by view name. reasons (H, W) are the target's `Reason` flags; traced (H, W) are the pixels that
    were traced, which are more than those with a reason where a full render was the cheapest. variance_share (H, W) is
    the variance of each target pixel, as a share of that of a plain render's: 1 in a denoised picture. grid is the
    source's. fill is how holes were traced, refinement the tracing that probes asked for; pilot_share is as in
    `TargetTracing`.
    seconds are by stage, and in total; source_cost is that of the source render, trace_costs are those by which fill
    methods were chosen. effect_costs are by effect; next_accuracy is the cost of the next better accuracy.
    invalid_pixels is the number of pixels by view that were no number. metadata is the renderer's. correction is how
    far traced pixels were moved to match a source of another engine, None where it is the same. warped_by is 'numpy' or
    'gpu'; gpu is its name, None for NumPy.
    light_scale is the number by which light was multiplied to be judged as it is seen (`images/seen_light`).
    """

    eyes: dict[str, Passes]
    reasons: NDArray[np.uint16]
    traced: NDArray[np.bool_]
    variance_share: NDArray[np.float32]
    grid: Grid
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


class Stopwatch:
    """Measures the seconds of stages, one after the other.

    `lap` ends the stage that runs and begins the next; `seconds` has those of the ended stages, by name. on_stage is
    called with the name of each stage as it begins.
    """

    def __init__(self, on_stage: Callable[[str], None]) -> None:
        self.seconds: dict[str, float] = {}
        self._on_stage = on_stage
        self._stage = ""
        self._start = time.perf_counter()

    @property
    def seconds_so_far(self) -> float:
        """Seconds since the running stage began."""
        return time.perf_counter() - self._start

    def lap(self, stage: str = "") -> None:
        """End the stage that runs, if one does, and begin this one; an empty name begins none.

        The ended stage's time is added to `seconds`; on_stage is called with the new one's name.
        """
        now = time.perf_counter()
        if self._stage:
            self.seconds[self._stage] = self.seconds.get(self._stage, 0.0) + now - self._start
        self._stage, self._start = str(stage), now
        if stage:
            self._on_stage(stage)

    @contextmanager
    def aside(self, stage: str) -> Iterator[None]:
        """Add the time of a `with` block to this stage, and not to the one that runs and goes on afterwards; on_stage
        is not called."""
        start = time.perf_counter()
        yield
        spent = time.perf_counter() - start
        self.seconds[str(stage)] = self.seconds.get(str(stage), 0.0) + spent
        self._start += spent


@dataclass(frozen=True)
class _Source:
    """The rendered source eye, ready to be warped.

    seen has its passes, with the denoised colour where the scene denoises, and with their light multiplied by
    light_scale, by which it is warped and judged. lost has masks (H, W), by pass, of the pixels that were
    no number, where seen has 0. denoising is None where the scene does not denoise. accuracy is that of the frame,
    adapted to its size and to denoising. needs_probes: whether something may look different from each eye.
    """

    seen: RenderedView
    light_scale: float
    lost: Mapping[str, NDArray[np.bool_]]
    denoising: Denoising | None
    accuracy: Accuracy
    needs_probes: bool

    @property
    def cost(self) -> SourceCost:
        """Measured cost of the source render."""
        assert self.seen.cost is not None
        return self.seen.cost

    @property
    def rendered(self) -> Passes:
        """Passes of the eye with light as bright as the scene has it; copies, where that is not as it is seen."""
        return scaled_light(self.seen.passes, 1.0 / self.light_scale)

    def for_users(self) -> _Source:
        """Return the source without the passes that only the warp and the hole rules read: those that users get."""
        return replace(self, seen=replace(self.seen, passes=without_internal_passes(self.seen.passes)))


@dataclass(frozen=True)
class _Warped:
    """The source warped into the target, ready to be traced: the holes, and what plans and does the tracing.

    gpu is the name of the GPU that was chosen to warp, None for NumPy. better is the name of the next better accuracy,
    and better_holes (H, W) are the holes that it would have, None where that is a full render.
    """

    reprojection: WarpedHoles
    gpu: str | None
    planner: FillPlanner
    tracing: TargetTracing
    better: str
    better_holes: NDArray[np.bool_] | None


@dataclass(frozen=True)
class _Completed:
    """The target after it was warped and traced, with all that did it and their results."""

    warped: _Warped
    fill: FillChoice
    refinement: Refinement


def render_stereo_frame(
    renderer: Renderer,
    settings: StereoSettings,
    *,
    on_stage: Callable[[str], None] = lambda _: None,
    accuracy: Accuracy | None = None,
    findings: SharedFindings | None = None,
    watch: Stopwatch | None = None,
    costs: TraceCosts | None = None,
) -> StereoFrame:
    """Render the stereo pair of the renderer's scene and frame, and return it.

    on_stage is called with the name of each stage as it begins: source, denoise_source, warp, pilot, fill, refine,
    composite, denoise_target, and account, which comes after the pair is finished and is not in the total. A watch
    takes the place of on_stage where work for this frame alone, such as the renderer's plan, came before: the stages
    that it has seen are in the seconds and the total too. accuracy takes the place of the one that the settings name,
    for a picture of `SettingsTuning.unscaled_picture_px`; findings are those of other frames of the same animation.
    costs are those of tracing as far as they are known, by default the assumed ones. Raises BadInputError when the
    settings cannot be met for this scene, and StereoReprojectError when a render fails.
    """
    watch = watch or Stopwatch(on_stage)
    findings = findings or SharedFindings()
    check_fill(settings.fill, renderer.fill_blockers())

    source = _render_source(renderer, settings, accuracy or accuracy_of(settings), findings, watch)

    watch.lap(Stage.WARP)
    warped = _warp_source(renderer, settings, source, findings, costs or TraceCosts(), watch)
    source, tracing = source.for_users(), warped.tracing
    if tracing.wants_pilot:
        watch.lap(Stage.PILOT)
        tracing.send_pilot()

    watch.lap(Stage.FILL)
    fill = tracing.fill()

    watch.lap(Stage.REFINE)
    refinement = tracing.refine()

    watch.lap(Stage.COMPOSITE)
    target = tracing.target
    finished, lost_in_target = _without_lost(target, source, warped.reprojection, settings)
    # The finished passes take their place: a denoiser needs memory for a large picture several times over.
    for replaced in (target.passes, warped.reprojection.passes):
        replaced.clear()
    if source.denoising is not None:
        watch.lap(Stage.DENOISE_TARGET)
        refined = target.any_of(Provenance.REFINED)
        finished = denoise_target(finished, target.keeps_warped_colour, source.denoising, refined=refined)

    done = _Completed(warped, fill, refinement)
    return _finished_frame(renderer, settings, source, done, finished, lost_in_target, watch)


def _render_source(
    renderer: Renderer, settings: StereoSettings, accuracy: Accuracy, findings: SharedFindings, watch: Stopwatch
) -> _Source:
    """Render the source eye, clean it of values that are no number, and denoise it where the scene does.

    Stages begin on the watch. The light is scaled to be judged as it is seen. The noise that denoising leaves is
    measured, or taken from findings, where probes need it.
    """
    views = Rig.of_cameras(renderer.cameras, renderer.motion)
    view, target = views[settings.source], views[settings.target].camera
    accuracy = for_size(accuracy, target.width * target.height)

    watch.lap(Stage.SOURCE)
    passes, cost = renderer.render_source(settings.source)
    lost = not_numbers(passes)
    passes, invalid = replace_non_finite(passes)
    needs_probes = bool(renderer.plan.view_dependent) and not see_the_same(view.camera, target)
    denoising = None
    if renderer.denoise is not None:
        watch.lap(Stage.DENOISE_SOURCE)
        denoising, accuracy = Denoising(renderer.denoise), for_denoised(accuracy)
        passes = denoise_source(passes, denoising)
        cost = replace(cost, denoise_seconds=watch.seconds_so_far)

    scale = display_scale(passes[COLOUR_PASS])
    seen = RenderedView(view, scaled_light(passes, scale), invalid, cost)
    del passes
    if denoising is not None and needs_probes and accuracy.promise is not None:
        remaining = findings.remaining_noise(partial(remaining_noise, seen.passes, denoising.denoise))
        denoising = replace(denoising, remaining_noise=remaining)
    return _Source(seen, scale, lost, denoising, accuracy, needs_probes)


def _warp_source(
    renderer: Renderer,
    settings: StereoSettings,
    source: _Source,
    findings: SharedFindings,
    costs: TraceCosts,
    watch: Stopwatch,
) -> _Warped:
    """Return the source warped into the target, with what plans and does its tracing.

    All that only tells the holes takes three times as much memory, and is let go here. So the holes of the next better
    accuracy are found now, though they belong to the account of the finished frame.
    """
    reprojection, gpu = _reprojected(renderer, settings, source, findings)
    planner = _planner_of(renderer, settings, source, reprojection, findings, costs, watch)
    answered = reprojection.answered()
    tracing = renderer.tracing_of(
        WarpedTarget(
            settings.target,
            answered,
            planner,
            source.accuracy,
            source.denoising,
            source.needs_probes,
            renderer.seed,
            source.light_scale,
        )
    )
    better = next_better(source.accuracy) if tracing.can_promise else WHOLE
    with watch.aside(Stage.ACCOUNT):
        better_holes = holes_of(better, reprojection, denoised=source.denoising is not None)
    return _Warped(answered, gpu, planner, tracing, better, better_holes)


def _reprojected(
    renderer: Renderer, settings: StereoSettings, source: _Source, findings: SharedFindings
) -> tuple[Reprojection, str | None]:
    """Return the source warped into the target, and the name of the GPU that was chosen for it, None for NumPy."""
    target = Rig.of_cameras(renderer.cameras, renderer.motion)[settings.target]
    interpolations = interpolations_of(settings.interpolation, denoised=source.denoising is not None)
    warp = partial(
        reproject,
        [source.seen],
        target,
        source.accuracy,
        optics=Optics(renderer.lens, renderer.volumes),
        options=WarpOptions(settings.grid_threshold, *interpolations),
    )

    def is_faster(gpu: Warper) -> bool:
        return findings.gpu_is_faster(lambda: seconds_taken(run, gpu) < seconds_taken(run, NUMPY))

    def run(warper: Warper) -> object:
        return warp(warper=warper).reasons

    warper = choose_warper(settings.warp, target.camera.width * target.camera.height, renderer.gpu, is_faster)
    return warp(warper=warper), warper.device


def _planner_of(
    renderer: Renderer,
    settings: StereoSettings,
    source: _Source,
    reprojection: Reprojection,
    findings: SharedFindings,
    costs: TraceCosts,
    watch: Stopwatch,
) -> FillPlanner:
    """Return the planner of the frame's traces, which knows the costs of tracing, or measures them first.

    Raises BadInputError where the fill method that was asked for cannot be used for what the source shows.
    """
    blockers = renderer.fill_blockers(_deepest(source.seen.passes))
    check_fill(settings.fill, blockers)
    planner = FillPlanner(settings.fill, findings.cost(source.cost), blockers, costs)

    def measure() -> TraceCosts:
        holes = reprojection.reasons > 0
        if worth_measuring(planner, holes):
            watch.lap(Stage.PILOT)
        return calibrated_costs(renderer, replace(planner, cost=source.cost), settings.target, holes, renderer.seed)

    return replace(planner, costs=findings.trace_costs(costs, measure))


def _finished_frame(
    renderer: Renderer,
    settings: StereoSettings,
    source: _Source,
    done: _Completed,
    finished: Passes,
    lost_in_target: int,
    watch: Stopwatch,
) -> StereoFrame:
    """Return the finished frame from the target's finished passes, with an account of what each effect cost.

    That account is a stage of its own, which is not in the total seconds. lost_in_target is the number of the target's
    pixels that were no number.
    """
    watch.lap(Stage.ACCOUNT)
    total = sum(seconds for stage, seconds in watch.seconds.items() if stage not in OUTSIDE_TOTAL)
    seconds = {**watch.seconds, "total": total}
    warped, refinement = done.warped, done.refinement
    reprojection, target = warped.reprojection, warped.tracing.target
    reasons = _all_reasons(reprojection.reasons, target)
    shown = np.where(reprojection.warp.covered, effects_of(finished), UNKNOWN_EFFECTS)
    evidence = None if refinement.whole else refinement.evidence
    spent = effect_costs(renderer.plan.called_for, shown, reasons, target.traced, seconds, evidence)
    whole = bool(target.traced.all())
    completed = FinishedTarget(
        warped.better_holes, warped.planner, done.fill, refinement, source.needs_probes, is_whole=whole
    )
    next_accuracy = cost_of(warped.better, completed, seconds)
    watch.lap()
    return StereoFrame(
        eyes={
            settings.source: source.rendered,
            settings.target: without_internal_passes(finished),
        },
        reasons=reasons,
        traced=target.traced,
        variance_share=_variance_share(source, reprojection, target),
        grid=reprojection.grid,
        fill=done.fill,
        refinement=refinement,
        pilot_share=warped.tracing.pilot_share,
        seconds={**watch.seconds, "total": seconds["total"]},
        source_cost=source.cost,
        trace_costs=warped.planner.costs,
        effect_costs=spent,
        next_accuracy=next_accuracy,
        invalid_pixels={settings.source: count_pixels(source.lost), settings.target: lost_in_target},
        metadata=dict(renderer.metadata),
        correction=warped.tracing.correction,
        warped_by=reprojection.warped_by,
        gpu=warped.gpu if reprojection.warped_by == "gpu" else None,
        light_scale=source.light_scale,
    )


def interpolations_of(asked: str, *, denoised: bool) -> tuple[str, str]:
    """Return two interpolations for a warp: that of most passes, and that of the colour.

    asked is one of the settings' names; for "auto" they are linear, but for the colour cubic in a denoised picture and
    adaptive in a noisy one.
    """
    if asked != "auto":
        return asked, asked
    return "linear", "cubic" if denoised else "adaptive"


def _without_lost(
    target: Target, source: _Source, reprojection: WarpedHoles, settings: StereoSettings
) -> tuple[Passes, int]:
    """Return the target's passes with 0 for values that are no number, and the number of pixels that had any.

    Light is as bright again as the scene has it. Values also count that were looked up where the source's own were no
    number.
    """
    finished, _ = replace_non_finite(target.passes)
    dark = not_numbers(target.passes)
    interpolation, _ = interpolations_of(settings.interpolation, denoised=False)
    for name, pixels in spoilt([source.lost], reprojection.warp, interpolation=interpolation).items():
        warped = pixels & ~target.traced
        if name in finished and warped.any():
            finished[name] = np.where(warped[..., None], np.float32(0.0), finished[name])
            dark[name] = warped | dark.get(name, False)
    return scaled_light(finished, 1.0 / source.light_scale), count_pixels(dark)


def _variance_share(source: _Source, reprojection: WarpedHoles, target: Target) -> NDArray[np.float32]:
    """Return (H, W) the variance of each finished target pixel, as a share of that of a plain render's: 1 in a denoised
    picture, whose noise is smooth, so that a lookup between pixels takes nothing from it."""
    if source.denoising is not None:
        return np.ones(target.traced.shape, np.float32)
    return target.variance_share(reprojection.variance_share)


def _all_reasons(reasons: NDArray[np.uint16], target: Target) -> NDArray[np.uint16]:
    """Return the warp's reasons (H, W), with PROBE and REFINED added for the target's probes and refined tiles."""
    result = reasons.copy()
    probes = target.any_of(Provenance.PROBE)
    result[probes] |= Reason.PROBE.bit
    result[target.any_of(Provenance.REFINED) & ~probes] |= Reason.REFINED.bit
    return result


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


def _deepest(source: Passes) -> float:
    """Return the greatest finite depth of the source, in scene units; 0 where there is none."""
    depth = source[DEPTH_PASS]
    finite = depth[np.isfinite(depth)]
    return float(finite.max()) if finite.size else 0.0


def colour(passes: Passes) -> NDArray[np.float32]:
    """Return the colour pass (H, W, 4) of an eye's passes."""
    return passes[COLOUR_PASS]
