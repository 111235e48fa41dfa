"""The sketch of an inspection: the source rendered small, twice, and from that the cost and parallax of the pair."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...holes.classifier import Optics
from ...holes.reprojection import reproject
from ...images.denoising import Denoise, Denoising
from ...images.effects import SEEN_DIFFERENTLY, Effect
from ...images.passes import COLOUR_PASS, EFFECTS_PASS, Passes, deepest
from ...images.seen_light import display_scale, scaled_light
from ...pipeline.prediction import (
    Sketch,
    effect_shares,
    predict,
    predict_holes,
    predict_samples,
    predict_source,
    prediction_fields,
    shown_differently,
    sketch_accuracy,
)
from ...pipeline.stages import Stage
from ...pipeline.warping import interpolations_of
from ...report.as_json import as_json
from ...settings.accuracy import Accuracy, accuracy_of, for_denoised, for_size
from ...settings.frame import EYES, StereoSettings
from ...trace.fill import SourceCost, check_fill
from ...trace.planner import FillPlanner
from ...views.camera import see_the_same
from ...views.view import Rig
from ...warp.composite import replace_non_finite
from ...warp.options import WarpOptions
from ...warp.rendered_view import RenderedView
from ..engines.renderer import BlenderRenderer
from ..engines.time_limit import without_time_limit
from ..scene.rig import frame_region
from ..scene.working import rendered_layer
from .frame import parallax_report
from .known_costs import known_costs

MAX_MORE_SAMPLES = 4
"""Samples that the second render of a sketch has on top of the first one's, at most."""


@dataclass(frozen=True)
class FullPicture:
    """The picture that a sketch stands for: its size (width, height) in pixels and its samples, the width of its whole
    frame, and scale, the sketch's width over the picture's.
    """

    size: tuple[int, int]
    samples: int
    frame_width: int
    scale: float

    @property
    def pixels(self) -> int:
        """Number of its pixels."""
        return self.size[0] * self.size[1]


@dataclass(frozen=True)
class _RenderedSketch:
    """The sketch of the source, rendered twice: the passes of the second render, and the costs and sample counts of
    both.
    """

    passes: Passes
    costs: tuple[SourceCost, SourceCost]
    samples: tuple[int, int]

    @property
    def seconds(self) -> tuple[float, float]:
        """Seconds of both renders."""
        return self.costs[0].seconds, self.costs[1].seconds


def foresee(
    renderer: BlenderRenderer,
    settings: StereoSettings,
    full: FullPicture,
    rows: list[dict[str, Any]],
    on_stage: Callable[[str], None],
) -> tuple[dict[str, Any] | None, dict[str, Any] | None]:
    """Return the prediction, and the parallax of the nearest and farthest point (see `_parallax`), from a sketch that
    is rendered for that at the size that is set. Where the fill is known beforehand, there is no sketch and the
    parallax is None. The rows of effects are changed as by `_predicted`. Raises BadInputError and
    StereoReprojectError.
    """
    foreseen = renderer.foreseen_fill(settings.fill)
    if foreseen is not None:
        return _predicted_without_sketch(*foreseen), None
    on_stage(Stage.SKETCH)
    sketched = _render_sketch(renderer, settings, full.samples)
    predicted = _predicted(renderer, settings, full, rows, sketched)
    return predicted, _parallax(renderer, sketched.passes, full.frame_width)


def _parallax(renderer: BlenderRenderer, sketch: Passes, frame_width: int) -> dict[str, Any] | None:
    """Return the parallax of the nearest and farthest point in the sketch: under "nearest" and "farthest" the fields
    of a `ScreenParallax`, in pixels of a frame of that width. None where the sketch shows no point.
    """
    sketch_width = frame_region(renderer.scene.render).full_width
    found = parallax_report(renderer, sketch, sketch_width)
    if found is None:
        return None
    parallax = as_json(found)
    for point in parallax.values():
        point["pixels"] *= frame_width / sketch_width
    return parallax


def _predicted_without_sketch(method: str, reason: str) -> dict[str, Any]:
    """Return the prediction for a source of EEVEE: of the fill alone, its method and the reason for it."""
    return {
        "rests_on": "how it is done: what Cycles takes beside EEVEE shows as the pair is made",
        "fill": {"method": method, "reason": reason, "seconds": None},
        "total_seconds": None,
        "gain": {"low": 1.0, "high": 1.0 if method == "full" else 2.0},
    }


def _predicted(
    renderer: BlenderRenderer,
    settings: StereoSettings,
    full: FullPicture,
    rows: list[dict[str, Any]],
    sketched: _RenderedSketch,
) -> dict[str, Any]:
    """Return the prediction of seconds and gain: what `prediction_fields` returns, and under "sketch" the size, samples
    and seconds of the sketch. The rows of effects are changed: each gets its share of the picture, and the most that
    tracing it may cost.
    """
    source = sketched.passes
    reasons, warp_seconds = _warp_sketch(renderer, settings, source, full.scale)
    syncs = sketched.costs[0].sync_seconds, sketched.costs[1].sync_seconds
    sketch = Sketch(reasons.size, sketched.samples, sketched.seconds, syncs)
    blockers = _blockers(renderer, settings, source)
    called_for, flags = _seen_differently(renderer), source.get(EFFECTS_PASS)
    limit = renderer.scene.cycles.time_limit
    rendered = predict_samples(sketch, full.pixels, full.samples, limit)
    accuracy = for_size(accuracy_of(settings), full.pixels)
    cost = predict_source(sketch, full.pixels, rendered)
    if renderer.denoise is not None:
        seconds_each = _denoise_seconds(source, renderer.denoise) * full.pixels / reasons.size
        accuracy, cost = for_denoised(accuracy), replace(cost, denoise_seconds=seconds_each)
    planner = FillPlanner(settings.fill, cost, blockers, known_costs(renderer.scene, renderer.packed_by))
    prediction = predict(
        planner,
        warp_seconds * full.pixels / reasons.size,
        predict_holes(reasons, full.scale),
        accuracy,
        shown_differently(called_for, flags),
    )
    _add_shares(rows, effect_shares(called_for, flags), planner)
    size = list(reasons.shape[::-1])
    return {
        **prediction_fields(prediction, _rests_on(size, sketched, full.samples, rendered, limit)),
        "sketch": {"size": size, "samples": list(sketched.samples), "seconds": list(sketched.seconds)},
    }


def _rests_on(size: list[int], sketched: _RenderedSketch, samples: int, rendered: int, limit: float) -> str:
    """Return in words what a prediction rests on: the sketches, whose size (width, height) is in pixels, and the time
    limit in seconds if by that only `rendered` of the source's samples are expected.
    """
    fewer, more = sketched.samples
    what = f"sketches of {size[0]}x{size[1]} pixels with {fewer} and {more} samples"
    rests_on = f"{what}, which took {sum(sketched.seconds):.1f} s"
    if rendered < samples:
        rests_on += f"; the time limit of {limit:g} s ends the source after about {rendered} samples"
    return rests_on


def _denoise_seconds(sketch: Passes, denoise: Denoise) -> float:
    """Return the seconds that denoising the sketch takes. It is denoised twice and the second time counts: the first
    also sets the denoiser up.
    """
    denoising = Denoising(denoise)
    denoising.denoised_colour(sketch)
    start = time.perf_counter()
    denoising.denoised_colour(sketch)
    return time.perf_counter() - start


def _blockers(renderer: BlenderRenderer, settings: StereoSettings, source: Passes) -> dict[str, str | None]:
    """Return for each fill method why holes cannot be traced by it, in words, or None if they can. source are the
    sketch's passes, whose greatest depth is taken into account. Raises BadInputError if the method asked for is
    blocked.
    """
    blockers = renderer.fill_blockers(deepest(source))
    check_fill(settings.fill, blockers)
    return blockers


def _seen_differently(renderer: BlenderRenderer) -> Effect:
    """Return the effects that are called for and may look different from each eye; none where both eyes are in one
    place.
    """
    if see_the_same(*(renderer.cameras[view] for view in EYES)):
        return Effect(0)
    return renderer.plan.called_for & SEEN_DIFFERENTLY


def _add_shares(rows: list[dict[str, Any]], shares: dict[Effect, float], planner: FillPlanner) -> None:
    """Add to the rows of effects their share of the picture, and the seconds at most that tracing it takes. shares are
    by effect; planner is that of the prediction.
    """
    by_label = {effect.label: share for effect, share in shares.items()}
    for row in rows:
        share = by_label.get(row["effect"])
        if share is not None:
            seconds = planner.plan(share).predicted_seconds
            row.update(share=share, seconds_at_most=seconds)


def _render_sketch(renderer: BlenderRenderer, settings: StereoSettings, samples: int) -> _RenderedSketch:
    """Render the source eye twice at the size that is set, with one sample and then with a few; samples are those of
    the full picture.
    """
    counts = (1, 1 + min(max(samples // 16, 1), MAX_MORE_SAMPLES))
    costs = []
    passes: Passes = {}
    for count in counts:
        renderer.scene.cycles.samples = count
        rendered_layer(renderer.scene).samples = 0
        with without_time_limit(renderer.scene, None):
            passes, cost = renderer.render_source(settings.source)
        costs.append(cost)
    return _RenderedSketch(passes, (costs[0], costs[1]), counts)


def _warp_sketch(
    renderer: BlenderRenderer, settings: StereoSettings, passes: Passes, scale: float
) -> tuple[NDArray[np.uint16], float]:
    """Warp the sketch to the target. Return the `Reason` flags (H, W) of its holes, and the seconds that the warp
    takes.
    """
    source, invalid = replace_non_finite(passes)
    views = Rig.of_cameras(renderer.cameras)
    interpolations = interpolations_of(settings.interpolation, denoised=bool(renderer.denoise))
    options = WarpOptions(settings.grid_threshold, *interpolations)
    optics = Optics(renderer.lens, renderer.volumes)
    seen = scaled_light(source, display_scale(source[COLOUR_PASS]))
    rendered, target = RenderedView(views[settings.source], seen, invalid), views[settings.target]

    def warp(accuracy: Accuracy) -> NDArray[np.uint16]:
        return reproject([rendered], target, accuracy, optics=optics, options=options).reasons

    accuracy = accuracy_of(settings)
    start = time.perf_counter()
    warp(accuracy)
    seconds = time.perf_counter() - start
    return warp(sketch_accuracy(accuracy, scale)), seconds
