"""Tracing with probes: holes and probes in one render, then the tiles that the probes ask for in another."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..holes.reprojection import WarpedHoles
from ..images.denoising import Denoising
from ..images.effects_pass import differ_in_reflected_light, effects_of
from ..images.lookup import variance_share
from ..images.passes import COLOUR_PASS, EFFECTS_PASS, VIEW_DEPENDENT_PASS, Passes, filtered
from ..images.seen_light import scaled_light
from ..matching.matching import Correction
from ..settings.accuracy import Accuracy
from ..trace.fill import FillChoice
from ..trace.planner import FillPlanner
from ..trace.requests import TraceCall, Tracer, TraceRequest, TraceSteps, run_alone
from ..views.solid_angle import PixelWeight, shown_pixels
from .estimator import Estimator, estimator_of
from .evidence import ProbeTraces, RefinedTiles, ReflectedLight, TileEvidence, with_refined
from .expected_excess import local_noise
from .missing import NOTHING_DIFFERS, PROMISES_NOTHING
from .noise_ratio import Estimate, as_rendered, estimate
from .probes import Probes, place_random_probes
from .refinement import choose_tiles, tiles_to_trace
from .target import Provenance, Target
from .tuning import TUNING


@dataclass(frozen=True)
class Refinement:
    """Pixels that were traced because probes asked for it, and the error that is left.

    pixels (H, W) are these; fill is the render in which they were traced, None without any. estimate is that of the
    frame's ratios, None where there were no probes, and no_estimate then says why. evidence is that of the probes, None
    without any. whole: all of the target was traced in the end, and so it is as good as rendered.
    """

    pixels: NDArray[np.bool_]
    fill: FillChoice | None = None
    estimate: Estimate | None = None
    evidence: TileEvidence | None = field(default=None, repr=False)
    whole: bool = False
    no_estimate: str = PROMISES_NOTHING


@dataclass(frozen=True)
class WarpedTarget:
    """A target as it comes out of the warp, with all that completing it by tracing needs.

    view is its name; reprojection has its passes, which tracing changes in place, and its holes; planner chooses fill
    methods. accuracy is that of the frame; denoising is None where the picture stays noisy. needs_probes: whether
    something may look different from each view, so that a promise must be measured. seed is that of the scene.
    light_scale is the number by which the light of the reprojection was multiplied, and by which traced light is to be:
    see `images/seen_light`. pixel_weight is that of the target's pixels (`views.solid_angle`); wraps is True where the
    target goes on at its left beyond its right side.
    """

    view: str
    reprojection: WarpedHoles
    planner: FillPlanner
    accuracy: Accuracy
    denoising: Denoising | None
    needs_probes: bool
    seed: int
    light_scale: float = 1.0
    pixel_weight: PixelWeight = 1.0
    wraps: bool = False

    @property
    def variance_share(self) -> NDArray[np.float32]:
        """Share (H, W) of a plain render's variance that each pixel has once it is warped: 1 in a denoised picture,
        whose noise is smooth, so that a lookup between pixels takes nothing from it."""
        if self.denoising is not None:
            return np.ones(self.reprojection.reasons.shape, np.float32)
        return self.reprojection.variance_share

    def variance_share_of(self, target: Target) -> NDArray[np.float32]:
        """Return (H, W) the variance of each pixel of this target, completed, as a share of that of a plain
        render's."""
        return target.variance_share(self.variance_share, averages_probes=self.denoising is None)


class TargetTracing(Protocol):
    """Completes a warped target by tracing: a pilot if one is wanted, then the holes, then the tiles that need it.

    target is its state so far, replaced at each step. pilot_share is the share of the frame that a pilot expected to be
    refined, None where none was sent. correction says how far traced pixels were moved to match a source of another
    engine, None where it is the same engine. can_promise: False where nothing is ever probed, so that no error can be
    told.
    """

    can_promise: bool
    target: Target
    pilot_share: float | None
    correction: Correction | None

    @property
    def wants_pilot(self) -> bool:
        """True where a few probes should go ahead: the frame may turn out to be cheaper to render whole."""
        ...

    def send_pilot(self) -> None:
        """Render a few probes and wait for them, so that pilot_share tells whether a full render would be cheaper."""
        ...

    def fill(self) -> FillChoice:
        """Trace the holes; return the fill method that was chosen, and why. To be called once, after any pilot."""
        ...

    def refine(self) -> Refinement:
        """Trace what the promise calls for beyond the holes, if anything, and return the outcome. To be called after
        `fill`."""
        ...


class ProbedTracing:
    """Completes a warped target with the engine that rendered its source; the `TargetTracing` with probes.

    Probes are traced where there is an estimator to read them. seed is that of their places.
    """

    correction: Correction | None = None
    can_promise = True

    def __init__(self, tracer: Tracer, warped: WarpedTarget) -> None:
        reprojection, accuracy = warped.reprojection, warped.accuracy
        self.pilot_share: float | None = None
        self._tracer, self._planner = tracer, warped.planner
        self._accuracy, self._seed, self._light_scale = accuracy, warped.seed, warped.light_scale
        self.warped = warped
        self._uncorrected: NDArray[np.float32] | None = None
        self._variance_share = warped.variance_share
        shown = shown_pixels(warped.pixel_weight)
        self.target = Target.of_warp(warped.view, reprojection.passes, reprojection.reasons, shown)
        self._promise = np.inf if accuracy.promise is None else accuracy.promise
        self._evidence: TileEvidence | None = None
        self._pilot: TileEvidence | None = None

    @cached_property
    def _estimator(self) -> Estimator | None:
        """Estimator that reads the probes. It is made when first asked for, before anything is traced: when the warp's
        own arrays are let go.

        It is None where nothing is to be measured: where the accuracy promises nothing, where nothing is warped, and
        where nothing that is seen can break the promise.
        """
        warped = self.warped
        if self._accuracy.promise is None or not warped.needs_probes:
            return None
        return estimator_of(warped.reprojection, self.target.warped, warped.denoising, wraps=warped.wraps)

    @property
    def _holes(self) -> NDArray[np.bool_]:
        """Holes (H, W) of the target, traced by now or not."""
        return self.target.any_of(Provenance.HOLE)

    @property
    def wants_pilot(self) -> bool:
        """True where a few probes should go ahead: there are many holes, and a full render is not the cheapest way
        already.

        It is False without an estimator, where the fill method is fixed, and where pixels cannot be packed.
        """
        share = float(np.mean(self._holes))
        if self._estimator is None or share < TUNING.pilot_min_hole_share or self._planner.asked != "auto":
            return False
        # A pilot is packed, and where a full render is the answer already there is nothing to find out.
        return not self._planner.blockers.get("packed") and self._planner.plan(share).method != "full"

    def send_pilot(self) -> None:
        """Render widely spaced probes and wait for them, then set pilot_share by what they tell.

        The probes become pixels of the target, as any probe does, and its slow errors are corrected.
        """
        run_alone(self._pilot_steps(), self._tracer)

    def _pilot_steps(self) -> TraceSteps[None]:
        """Steps of `send_pilot`."""
        spacing = self._accuracy.probe_spacing * TUNING.pilot_spacing_ratio
        before = self.target.colour.copy()
        self._pilot = yield from self._trace_probed("packed", np.zeros_like(self._holes), spacing, self._seed)
        self._uncorrected = before
        # A few probes are sure of little, and one outlier among them must not decide for a full render.
        chosen = choose_tiles(self._pilot, self._promise, unseen=self._accuracy.unseen, margin_sigmas=-1.0)
        self.pilot_share = float(self._pilot.pixels[chosen].sum() / self._holes.size)

    def fill(self) -> FillChoice:
        """Trace the holes, and in the same render the probes, if there are to be any; return the fill method that was
        chosen.

        For a full render all pixels of the target become holes, and there are no probes.
        """
        return run_alone(self.fill_steps(), self._tracer)

    def planned_fill(self) -> FillChoice:
        """Return the fill method by which `fill` traces the holes, as things stand, and why."""
        spacing = None if self._estimator is None else self._accuracy.probe_spacing
        share = float(np.mean(self._holes))
        return self._planner.plan(share, spacing=spacing, expected=self.pilot_share or 0.0)

    def fill_steps(self) -> TraceSteps[FillChoice]:
        """Steps of `fill`, for several targets whose pixels are traced together."""
        choice = self.planned_fill()
        if choice.method == "full" and choice.predicted_seconds > 0.0:
            self.target = self.target.flagged(np.ones_like(self._holes), Provenance.HOLE)
        holes = self._holes
        if self._estimator is None or choice.method == "full" or holes.all():
            yield from self._trace(choice.method, holes)
            return choice
        spacing = self._planner.spacing(choice.method, self._accuracy.probe_spacing)
        self._evidence = yield from self._trace_probed(choice.method, holes, spacing, self._seed + 1)
        return choice

    def refine(self) -> Refinement:
        """Trace as few tiles as bring the frame to its promise, in one render, and return the outcome.

        Where a full render is not clearly dearer, it is taken, and all that is still warped is traced.
        """
        return run_alone(self.refine_steps(), self._tracer)

    def refine_steps(self) -> TraceSteps[Refinement]:
        """Steps of `refine`, for several targets whose pixels are traced together."""
        evidence = self._evidence
        if evidence is None:
            return _unrefined(self.target, self._accuracy, self._pilot)
        chosen, by_own = self._chosen_tiles(evidence)
        tiles = evidence.probes.pixels_of(chosen) & ~self.target.any_of(Provenance.NOTHING)
        pixels = tiles & ~self.target.traced
        if not pixels.any():
            return Refinement(pixels, estimate=estimate(evidence), evidence=evidence)
        fill = self._planner.plan(float(np.mean(pixels)))
        if fill.method == "full":
            pixels = ~self.target.traced
            yield from self._trace("full", pixels)
            self._flag_refined(pixels | self.target.traced)
            return Refinement(pixels, fill, as_rendered(evidence), evidence, whole=True)
        noise, warped = local_noise(evidence), self.target.colour[pixels]
        yield from self._trace(fill.method, pixels)
        self._flag_refined(tiles)
        done = RefinedTiles(chosen, pixels, warped, self.target.colour[pixels], by_own, self._variance_share)
        evidence = with_refined(evidence, done, noise)
        return Refinement(pixels, fill, estimate(evidence), evidence)

    @property
    def share_to_refine(self) -> float:
        """Share of the target's pixels, 0 to 1, that `refine` will trace; 0 without probes."""
        evidence = self._evidence
        if evidence is None:
            return 0.0
        return float(np.mean(evidence.probes.pixels_of(self._chosen_tiles(evidence)[0]) & ~self.target.traced))

    def _chosen_tiles(self, evidence: TileEvidence) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return what `tiles_to_trace` chooses by the target's accuracy."""
        of = self._accuracy
        return tiles_to_trace(
            evidence, self._promise, of.tile_limit, unseen=of.unseen, none_wrong=of.promises_worst_tiles
        )

    def _flag_refined(self, pixels: NDArray[np.bool_]) -> None:
        """Flag these pixels (H, W) of the target as refined, but for holes."""
        self.target = self.target.flagged(pixels & ~self._holes, Provenance.REFINED)

    def _trace(self, method: str, pixels: NDArray[np.bool_]) -> TraceSteps[None]:
        """Trace pixels (H, W) once by this fill method, and put them into the target; to flag them is left to the
        caller."""
        if pixels.any():
            traced = yield from self._traced(method, TraceRequest(self.target.view, pixels))
            self.target.put(pixels, traced)

    def _traced(self, method: str, request: TraceRequest) -> TraceSteps[Passes]:
        """Return the passes (N, C) of a request, traced by this fill method, with light as bright as the target's."""
        traced = yield TraceCall(method, request)
        return scaled_light(traced, self._light_scale)

    def _trace_probed(self, method: str, holes: NDArray[np.bool_], spacing: int, seed: int) -> TraceSteps[TileEvidence]:
        """Trace the holes (H, W) once and probes among the rest twice, in one render; return the probes' evidence.

        The target gets these pixels, its probes flagged, and is corrected by what they tell. A probe's pixel becomes
        the mean of its two traces. spacing is the side of the tiles that have a probe each, seed that of their places.
        """
        estimator = self._estimator
        assert estimator is not None
        probes = place_random_probes(
            self.target.warped,
            spacing=spacing,
            seed=seed,
            contrast=estimator.contrast,
            weight=self.warped.pixel_weight,
            wraps=self.warped.wraps,
        )
        pixels = holes | probes.mask
        traced = yield from self._traced(method, TraceRequest(self.target.view, pixels, probes.mask))
        count = int(pixels.sum())
        first = {name: image[:count] for name, image in traced.items()}
        once = {name: image[probes.mask[pixels]] for name, image in first.items()}
        again = {name: image[count:] for name, image in traced.items()}
        uncorrected = None if self._uncorrected is None else self._uncorrected[probes.mask]
        reprojection, share = self.warped.reprojection, self._variance_share[probes.mask]
        warped, share = _judged_by(reprojection, probes, self.target.colour[probes.mask], share)
        apart = _reflected_light(reprojection, self.target.passes, probes, once, again)
        traces = ProbeTraces(warped, once[COLOUR_PASS], again[COLOUR_PASS], share, uncorrected, apart)
        means = {name: _mean_of_finite(once[name], again[name]) for name in traced if filtered(name)}
        self.target.put(pixels, first)
        self.target.put(probes.mask, means)
        target = self.target.flagged(probes.mask, Provenance.PROBE)
        self.target, evidence = estimator.measure(target, probes, traces)
        return evidence


def _judged_by(
    reprojection: WarpedHoles, probes: Probes, warped: NDArray[np.float32], share: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the warped colours (N, C) that the probes' traces are held against, and the share (N,) of a pixel's
    variance that these have.

    They are the target's own, warped and share, but where these are single pixels of the source, they are looked up
    between pixels: as wrong in the mean, with less noise, which else makes more tiles stand out by chance.
    """
    if reprojection.single is None:
        return warped, share
    place, single = (probes.rows, probes.columns), reprojection.single[probes.mask]
    x, y = reprojection.places(place)
    between = variance_share(x[None], y[None])[0]
    return np.where(single[:, None], reprojection.between(place), warped), np.where(single, between, share)


def _mean_of_finite(once: NDArray[np.float32], again: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the mean (N, C) of two traces; where one value is NaN or infinite, the other is taken."""
    once, again = np.where(np.isfinite(once), once, again), np.where(np.isfinite(again), again, once)
    return (0.5 * once + 0.5 * again).astype(np.float32)


def _reflected_light(
    reprojection: WarpedHoles, passes: Passes, probes: Probes, once: Passes, again: Passes
) -> ReflectedLight | None:
    """Return the reflected light of a target's probes, whose traces' passes (N, C) are once and again; None where
    the renders do not tell it. passes (H, W, C) are the target's, before the traces are put into it."""
    if VIEW_DEPENDENT_PASS not in passes or VIEW_DEPENDENT_PASS not in once:
        return None
    place = probes.rows, probes.columns
    x, y = reprojection.places(place)
    warped, *traced = (
        np.nan_to_num(image.astype(np.float64), posinf=0.0, neginf=0.0)
        for image in (passes[VIEW_DEPENDENT_PASS][place], once[VIEW_DEPENDENT_PASS], again[VIEW_DEPENDENT_PASS])
    )
    return ReflectedLight(
        warped,
        *traced,
        # As `warp.composite` looks the pass up, if nobody asked for another lookup.
        variance_share=variance_share(x[None], y[None])[0],
        tells=differ_in_reflected_light(effects_of(passes)[place]) & _all_differ_in_reflected_light(once, again),
    )


def _all_differ_in_reflected_light(*traces: Passes) -> NDArray[np.bool_]:
    """Return which pixels (N,) show in none of their traces, whose passes (N, C) are given, what looks different from
    each eye in other than reflected light; where a trace tells no effects, it has no say.

    The warp may have missed something that a pixel shows, as where the surface is hardly there: then it is not where
    the depth pass says.
    """
    told = [effects_of(passes) for passes in traces if EFFECTS_PASS in passes]
    every = np.ones(len(traces[0][COLOUR_PASS]), bool)
    for flags in told:
        every &= differ_in_reflected_light(flags)
    return every


def _unrefined(target: Target, accuracy: Accuracy, pilot: TileEvidence | None) -> Refinement:
    """Return the refinement of a target without probes' evidence but for a pilot's: nothing probed it, or it was
    rendered whole at once."""
    promises = accuracy.promise is not None
    whole = promises and bool(target.traced.all())
    told = as_rendered(pilot) if whole else None
    why = NOTHING_DIFFERS if promises else PROMISES_NOTHING
    return Refinement(np.zeros_like(target.traced), estimate=told, whole=whole, no_estimate=why)
