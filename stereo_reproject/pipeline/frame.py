"""The way of a frame: render one eye, warp it, find the holes, trace them, put the other eye together."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from ..estimate.tracing import FillPlanner, Refinement, TargetEye
from ..holes.classifier import Optics
from ..holes.reprojection import Reprojection, reproject
from ..images.denoising import Denoise, Denoising, denoise_source, denoise_target, noise_left
from ..images.effects import Effect, EffectsPlan
from ..images.effects_pass import UNKNOWN, effects_of
from ..images.passes import COLOUR_PASS, DEPTH_PASS, Passes, without_ours
from ..images.reasons import Reason
from ..matching.matching import Correction
from ..settings.accuracy import Accuracy, accuracy_of, for_denoised, for_size
from ..settings.frame import StereoSettings
from ..trace.fill import FillChoice, SourceCost, check_fill
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
from .effect_costs import EffectCost, accounts
from .matched_eye import LightMatcher, MatchedEye
from .price import WHOLE, Price, next_better, price_of
from .shared_findings import SharedFindings


class Renderer(Protocol):
    """What the pipeline asks of whoever renders; `stereo_reproject.blender.engines.renderer` is the one that ships."""

    cameras: Mapping[str, Camera]
    plan: EffectsPlan
    """What the scene calls for; where nothing in it may look different from each eye, no probe is traced."""
    lens: Lens
    """Both eyes'."""
    gpu: Callable[[], Warper | None]
    """What finds a GPU that can warp."""
    volumes: Sequence[NDArray]
    """Corners (8, 3) in the world of a box around each volume, infinite for one that may be anywhere."""
    seed: int
    """Of the scene's noise; the places of the probes follow from it."""
    motion: Mapping[str, Moving] | None
    """Each eye's in the frames around this one; None where no pass asks for it."""
    metadata: Mapping[str, str]
    """Texts of Blender's that belong to the passes rendered so far, as they stand in a file's header."""

    denoise: Denoise | None
    """What the scene denoises with; None where it does not. All passes then have those that `denoising` is about."""
    foreign: bool
    """Whether another engine traces than the one that renders the source; then it is a `LightMatcher` too."""

    def render_source(self, view: str) -> tuple[Passes, SourceCost]:
        """The source eye, whole, and not denoised."""
        ...

    def fill_blockers(self, deepest: float = 0.0) -> Mapping[str, str | None]:
        """Why a fill method cannot be used for this scene, by method; deepest is the greatest depth that was seen."""
        ...

    def trace(
        self, method: str, view: str, pixels: NDArray[np.bool_], *, twice: NDArray[np.bool_] | None = None
    ) -> Passes:
        """The passes (N, C) of the target pixels that are set in `pixels` (H, W), in the mask's order.

        After them those of the pixels set in `twice` (H, W), traced once more with noise of their own.
        """
        ...


@dataclass(frozen=True)
class StereoFrame:
    """A finished pair, and how it came about.

    eyes by view name; reasons (H, W) are the target's `Reason` flags; traced (H, W) the pixels that were traced,
    which are more than those with a reason where a full render was the cheapest. accounts are what each effect has
    cost; price is what the next better accuracy would have. metadata is the renderer's. correction is how far traced
    pixels were moved to match a source of another engine. warped_by is numpy or gpu, whose name is gpu then.
    """

    eyes: dict[str, Passes]
    reasons: NDArray[np.uint16]
    traced: NDArray[np.bool_]
    grid: Grid
    fill: FillChoice
    refinement: Refinement
    pilot_share: float | None
    seconds: dict[str, float]
    source_cost: SourceCost
    accounts: dict[Effect, EffectCost]
    price: Price
    invalid_pixels: dict[str, int]
    metadata: dict[str, str]
    correction: Correction | None = None
    warped_by: str = "numpy"
    gpu: str | None = None


class Stopwatch:
    """Seconds by stage; each `lap` ends the stage that runs and tells whoever listens what begins."""

    def __init__(self, on_stage: Callable[[str], None]) -> None:
        self.seconds: dict[str, float] = {}
        self._on_stage = on_stage
        self._stage = ""
        self._start = time.perf_counter()

    @property
    def seconds_so_far(self) -> float:
        """Of the stage that runs."""
        return time.perf_counter() - self._start

    def lap(self, stage: str = "") -> None:
        now = time.perf_counter()
        if self._stage:
            self.seconds[self._stage] = self.seconds.get(self._stage, 0.0) + now - self._start
        self._stage, self._start = stage, now
        if stage:
            self._on_stage(stage)


def render_stereo_frame(
    renderer: Renderer,
    settings: StereoSettings,
    *,
    on_stage: Callable[[str], None] = lambda _: None,
    accuracy: Accuracy | None = None,
    precedent: SharedFindings | None = None,
    watch: Stopwatch | None = None,
) -> StereoFrame:
    """Render the pair of the renderer's scene and frame.

    on_stage is told the name of each stage as it begins: source, denoise_source, warp, pilot, fill, refine,
    composite, denoise_target, and account, which comes after the pair is finished and is not in the total. A watch
    takes the place of on_stage where work for this frame alone, such as the renderer's plan, came before: the stages
    that it has seen are in the seconds and the total too. accuracy takes the place of the one that the settings name,
    for a picture up to `accuracy.PROBED_PIXELS`; precedent has what other frames of the same animation have found.
    Raises BadInputError when the settings cannot be met for this scene, and StereoReprojectError when a render fails.
    """
    watch = watch or Stopwatch(on_stage)
    precedent = precedent or SharedFindings()
    check_fill(settings.fill, renderer.fill_blockers())
    source_camera, target_camera = renderer.cameras[settings.source], renderer.cameras[settings.target]
    accuracy = for_size(accuracy or accuracy_of(settings), target_camera.width * target_camera.height)

    watch.lap("source")
    rendered, cost = renderer.render_source(settings.source)
    source, invalid = replace_non_finite(rendered)
    lost = not_numbers(rendered)

    may_differ = bool(renderer.plan.view_dependent) and not see_the_same(source_camera, target_camera)
    watched = may_differ and not renderer.foreign
    denoising = None if renderer.denoise is None else Denoising(renderer.denoise)
    if denoising is not None:
        watch.lap("denoise_source")
        source = denoise_source(source, denoising)
        cost = replace(cost, denoise_seconds=watch.seconds_so_far)
        if watched and accuracy.promise is not None:
            left = precedent.noise_left(partial(noise_left, source, denoising.denoise))
            denoising = replace(denoising, noise_left=left)
        accuracy = for_denoised(accuracy)

    watch.lap("warp")
    views = Rig.of_cameras(renderer.cameras, renderer.motion)
    interpolation, colour_interpolation = interpolations_of(settings.interpolation, denoised=denoising is not None)
    warp = partial(
        reproject,
        [RenderedView(views[settings.source], source, invalid, cost)],
        views[settings.target],
        accuracy,
        optics=Optics(renderer.lens, renderer.volumes),
        options=WarpOptions(settings.grid_threshold, interpolation, colour_interpolation),
    )
    warper = _warper(settings, renderer, precedent, target_camera, lambda warper: warp(warper=warper).reasons)
    reprojection = warp(warper=warper)

    blockers = renderer.fill_blockers(_deepest(source))
    check_fill(settings.fill, blockers)
    means = FillPlanner(settings.fill, precedent.cost(cost), blockers)
    target = _target_eye(renderer, settings.target, means, reprojection, accuracy, watched=watched, denoising=denoising)
    if target.wants_pilot:
        watch.lap("pilot")
        target.send_pilot()

    watch.lap("fill")
    fill = target.fill()

    watch.lap("refine")
    refinement = target.refine()

    watch.lap("composite")
    finished, lost_in_target = _without_lost(target, lost, reprojection, interpolation)
    if denoising is not None:
        watch.lap("denoise_target")
        finished = denoise_target(finished, target.kept, denoising, refined=target.refined)
    watch.lap("account")
    seconds = {**watch.seconds, "total": sum(watch.seconds.values())}
    reasons = _all_reasons(reprojection.reasons, target.probed, refinement.pixels)
    shown = np.where(reprojection.warp.covered, effects_of(finished), UNKNOWN)
    told = None if refinement.whole else refinement.measured
    spent = accounts(renderer.plan.called_for, shown, reasons, target.traced, seconds, told)
    better = WHOLE if renderer.foreign else next_better(accuracy)
    whole = bool(target.traced.all())
    price = price_of(better, reprojection, refinement, means, seconds, fill, watched=watched, whole=whole)
    watch.lap()

    return StereoFrame(
        eyes={settings.source: without_ours(source), settings.target: without_ours(finished)},
        reasons=reasons,
        traced=target.traced,
        grid=reprojection.grid,
        fill=fill,
        refinement=refinement,
        pilot_share=target.pilot_share,
        seconds={**watch.seconds, "total": seconds["total"]},
        source_cost=cost,
        accounts=spent,
        price=price,
        invalid_pixels={settings.source: count_pixels(lost), settings.target: lost_in_target},
        metadata=dict(renderer.metadata),
        correction=target.correction if isinstance(target, MatchedEye) else None,
        warped_by=reprojection.warped_by,
        gpu=warper.device if reprojection.warped_by == "gpu" else None,
    )


def _target_eye(
    renderer: Renderer,
    view: str,
    means: FillPlanner,
    reprojection: Reprojection,
    accuracy: Accuracy,
    *,
    watched: bool,
    denoising: Denoising | None,
) -> TargetEye:
    seed = renderer.seed
    if renderer.foreign:
        return MatchedEye(cast("LightMatcher", renderer), view, means, reprojection, accuracy, seed=seed)
    return TargetEye(renderer, view, means, reprojection, accuracy, watched=watched, seed=seed, denoising=denoising)


def _without_lost(
    target: TargetEye, lost: Mapping[str, NDArray[np.bool_]], reprojection: Reprojection, interpolation: str
) -> tuple[Passes, int]:
    """Return the target's passes with 0 for what is no number, or was looked up where the source has none, and in how
    many pixels that is."""
    finished, _ = replace_non_finite(target.passes)
    dark = not_numbers(target.passes)
    for name, pixels in spoilt([lost], reprojection.warp, interpolation=interpolation).items():
        warped = pixels & ~target.traced
        if name in finished and warped.any():
            finished[name] = np.where(warped[..., None], np.float32(0.0), finished[name])
            dark[name] = warped | dark.get(name, False)
    return finished, count_pixels(dark)


def _warper(
    settings: StereoSettings,
    renderer: Renderer,
    precedent: SharedFindings,
    camera: Camera,
    run: Callable[[Warper], object],
) -> Warper:
    def is_faster(gpu: Warper) -> bool:
        return precedent.gpu_is_faster(lambda: seconds_taken(run, gpu) < seconds_taken(run, NUMPY))

    return choose_warper(settings.warp, camera.width * camera.height, renderer.gpu, is_faster)


def interpolations_of(asked: str, *, denoised: bool) -> tuple[str, str]:
    """Of most passes, and of the colour, which is all that is denoised."""
    if asked != "auto":
        return asked, asked
    return "linear", "cubic" if denoised else "linear"


def _all_reasons(
    reasons: NDArray[np.uint16], probed: NDArray[np.bool_], refined: NDArray[np.bool_]
) -> NDArray[np.uint16]:
    result = reasons.copy()
    result[probed] |= Reason.PROBE.bit
    result[refined] |= Reason.REFINED.bit
    return result


def traced_fractions(frame: StereoFrame) -> dict[str, float]:
    """Share of the target's pixels that was traced: by reason, of which a pixel may have several, and in all."""
    fractions = {reason.label: float(np.mean((frame.reasons & reason.bit) > 0)) for reason in Reason}
    named = ("disoccluded", "outside", "silhouette")
    result = {label: value for label, value in fractions.items() if label in named or value > 0.0}
    result["rerendered"] = float(np.mean(frame.traced))
    return result


def _deepest(source: Passes) -> float:
    depth = source[DEPTH_PASS]
    finite = depth[np.isfinite(depth)]
    return float(finite.max()) if finite.size else 0.0


def colour(passes: Passes) -> NDArray[np.float32]:
    """The (H, W, 4) picture among an eye's passes."""
    return passes[COLOUR_PASS]
