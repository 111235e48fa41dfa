"""A scene inspected: its effects plan, and from a sketch what its pair will cost; nothing is rendered in full."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...holes.classifier import Optics
from ...holes.reprojection import reproject
from ...images.denoising import Denoise, Denoising
from ...images.effects import SEEN_DIFFERENTLY, Effect
from ...images.effects_pass import MATERIAL_CRYPTOMATTE
from ...images.passes import COLOUR_PASS, DEPTH_PASS, EFFECTS_PASS, Passes, deepest
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
from ...report.header import ReportHeader
from ...report.inspection import INSPECTION_SCHEMA, effects_rows
from ...settings.accuracy import Accuracy, accuracy_of, for_denoised, for_size
from ...settings.frame import EYES, StereoSettings
from ...trace.fill import SourceCost, check_fill
from ...trace.planner import FillPlanner
from ...views.camera import see_the_same
from ...views.view import Rig
from ...warp.composite import replace_non_finite
from ...warp.options import WarpOptions
from ...warp.rendered_view import RenderedView
from ..engines.eevee import renderer_of
from ..engines.renderer import BlenderRenderer
from ..engines.time_limit import without_time_limit
from ..scene.rendered import CYCLES
from ..scene.rig import frame_region
from ..scene.warnings import first_layer_alone, scene_warnings
from ..scene.working import make_small, rendered_layer, working_scene
from .frame import parallax_report, report_header
from .known_costs import known_costs

SKETCH_WIDTH_PIXELS = 480
"""Width of the sketch, if that is at most half of the picture's: the holes of narrow gaps are still seen."""

MAX_MORE_SAMPLES = 4
"""Samples that the second render of a sketch has on top of the first one's, at most."""

NO_PASSES = ("use_pass_combined", "use_pass_z", "use_pass_cryptomatte_accurate")
"""Switches that are named already, or that switch no pass on."""


def inspect_scene(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    work: Path,
    *,
    sketch: bool = True,
    on_stage: Callable[[str], None] = lambda _: None,
) -> dict[str, Any]:
    """Return what the command `inspect` prints of the scene, as JSON has it. Without a sketch nothing is rendered, and
    "predicted" and "parallax" are None.

    work is a private folder; on_stage gets each stage's name as it begins. Raises BadInputError and
    StereoReprojectError.
    """
    on_stage(Stage.PLAN)
    with working_scene(scene, settings.scene) as working:
        header = report_header(scene, working, settings)
        cycles = working.render.engine == CYCLES
        frame_width = frame_region(working.render).full_width
        scale = make_small(working, SKETCH_WIDTH_PIXELS) if sketch and cycles else 1.0
        with renderer_of(working, work, user_scene=scene, packed_by=settings.packed_camera) as renderer:
            check_fill(settings.fill, renderer.fill_blockers())
            rows = effects_rows(renderer.plan)
            passes = _passes(working, renderer)
            alone = first_layer_alone(scene, "what is found and predicted is that")
            warnings = [*scene_warnings(scene, settings.scene), *renderer.warnings, *alone]
            predicted = parallax = None
            foreseen = renderer.foreseen_fill(settings.fill) if sketch else None
            if foreseen is not None:
                predicted = _predicted_without_sketch(*foreseen)
            elif sketch:
                on_stage(Stage.SKETCH)
                sketched = _render_sketch(renderer, settings, header.samples)
                predicted = _predicted(renderer, settings, header, scale, rows, sketched)
                parallax = _parallax(renderer, sketched[0], frame_width)
    return {
        **{key: value for key, value in as_json(header).items() if key not in ("stereo", "scene_datablock")},
        "schema": INSPECTION_SCHEMA,
        "effects": rows,
        "passes": passes,
        "predicted": predicted,
        "parallax": parallax,
        "warnings": warnings,
    }


def _parallax(renderer: BlenderRenderer, sketch: Passes, frame_width: int) -> dict[str, Any] | None:
    """Return the parallax of the nearest and farthest point in the sketch as JSON has it, in pixels of a frame of that
    width; None where the sketch shows no point.
    """
    sketch_width = frame_region(renderer.scene.render).full_width
    found = parallax_report(renderer, sketch, sketch_width)
    if found is None:
        return None
    parallax = as_json(found)
    for point in parallax.values():
        point["pixels"] *= frame_width / sketch_width
    return parallax


def _passes(working: bpy.types.Scene, renderer: BlenderRenderer) -> list[str]:
    """Return the names of the source's passes: colour, depth, those of the user, and those that the plan needs."""
    layer = rendered_layer(working)
    asked = [*_switched_on(layer), *_switched_on(layer.cycles)] if hasattr(layer, "cycles") else _switched_on(layer)
    ours = [MATERIAL_CRYPTOMATTE] if renderer.plan.view_dependent and working.render.engine == CYCLES else []
    if layer.use_pass_cryptomatte_material:
        ours = []
    if renderer.denoise is not None:
        ours = [*ours, "Denoising Data"]
    names = [COLOUR_PASS, DEPTH_PASS, *asked, *(aov.name for aov in layer.aovs), *ours]
    return list(dict.fromkeys(names))


def _switched_on(owner: bpy.types.bpy_struct) -> list[str]:
    """Return the names of the passes that are switched on in a view layer, or in Cycles' settings of one; `NO_PASSES`
    left out.
    """
    switches = [prop for prop in owner.bl_rna.properties if prop.identifier.startswith("use_pass_")]
    return [prop.name for prop in switches if prop.identifier not in NO_PASSES and getattr(owner, prop.identifier)]


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
    header: ReportHeader,
    scale: float,
    rows: list[dict[str, Any]],
    sketched: tuple[Passes, list[SourceCost], tuple[int, int]],
) -> dict[str, Any]:
    """Return the prediction of seconds and gain, as JSON has it. The rows of effects are changed: each gets its share
    of the picture, and the most that tracing it may cost.

    scale is the sketch's width over the picture's; sketched is what `_render_sketch` returns.
    """
    source, costs, samples = sketched
    reasons, warp_seconds = _warp_sketch(renderer, settings, source, scale)
    seconds, syncs = [cost.seconds for cost in costs], [cost.sync_seconds for cost in costs]
    sketch = Sketch(reasons.size, samples, (seconds[0], seconds[1]), (syncs[0], syncs[1]))
    pixels = header.size[0] * header.size[1]
    blockers = _blockers(renderer, settings, source)
    called_for, flags = _seen_differently(renderer), source.get(EFFECTS_PASS)
    accuracy = for_size(accuracy_of(settings), pixels)
    limit = renderer.scene.cycles.time_limit
    rendered = predict_samples(sketch, pixels, header.samples, limit)
    cost = predict_source(sketch, pixels, rendered)
    if renderer.denoise is not None:
        seconds_each = _denoise_seconds(source, renderer.denoise) * pixels / reasons.size
        accuracy, cost = for_denoised(accuracy), replace(cost, denoise_seconds=seconds_each)
    planner = FillPlanner(settings.fill, cost, blockers, known_costs(renderer.scene, renderer.packed_by))
    prediction = predict(
        planner,
        warp_seconds * pixels / reasons.size,
        predict_holes(reasons, scale),
        accuracy,
        shown_differently(called_for, flags),
    )
    _add_shares(rows, effect_shares(called_for, flags), planner)
    size = list(reasons.shape[::-1])
    what = f"sketches of {size[0]}x{size[1]} pixels with {samples[0]} and {samples[1]} samples"
    rests_on = f"{what}, which took {sum(seconds):.1f} s"
    if rendered < header.samples:
        rests_on += f"; the time limit of {limit:g} s ends the source after about {rendered} samples"
    return {
        **prediction_fields(prediction, rests_on),
        "sketch": {"size": size, "samples": list(samples), "seconds": seconds},
    }


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


def _render_sketch(
    renderer: BlenderRenderer, settings: StereoSettings, samples: int
) -> tuple[Passes, list[SourceCost], tuple[int, int]]:
    """Render the source eye twice at the size that is set, with one sample and then with a few. Return the passes of
    the second render, and the costs and sample counts of both; samples are those of the full picture.
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
    return passes, costs, counts


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
