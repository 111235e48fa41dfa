"""One frame of a .blend, from the file to the finished files: what the command line and scripts call."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...files import write_json
from ...images.exr import VIEWS, write_eye, write_stereo
from ...images.passes import DEPTH_PASS, Passes
from ...images.ranges import range_warnings
from ...jobs.work_folder import DIFFERENCE, pair_files
from ...pipeline.frame import StereoFrame, Stopwatch, colour, render_stereo_frame, traced_fractions
from ...pipeline.shared_findings import SharedFindings
from ...pipeline.stages import Stage
from ...pipeline.stereo_pair import StereoPair
from ...report.estimates import effects_fields, estimate_fields, estimate_map
from ...report.report import REPORT_SCHEMA, check_report
from ...settings.accuracy import accuracy_of
from ...settings.frame import StereoSettings
from ...views.parallax import visible_parallax
from ..engines.eevee import renderer_of
from ..engines.renderer import BlenderRenderer
from ..engines.time_limit import has_time_limit
from ..output.delivery import deliver_composited, deliver_side_by_side
from ..output.output_paths import check_file_outputs
from ..output.pictures import write_difference, write_estimate, write_grid, write_holes
from ..scene.compositor import is_composited
from ..scene.rig import frame_region
from ..scene.warnings import scene_warnings
from ..scene.working import CYCLES, WorkingScenes, check_layers, evaluated
from .compare import compare_with_multiview

STEREO_PICTURE = "stereo.png"


def render_files(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    work: Path,
    *,
    files: Sequence[str] | None = None,
    load_seconds: float = 0.0,
    on_stage: Callable[[str], None] = lambda _: None,
) -> tuple[dict[str, Any], list[str]]:
    """Render the pair of one frame and write its files into work/out; the report, and the files' names.

    work is a private folder that also takes what passes between the stages. files are some of `pair_files`; all,
    without them. With stereo.png, the scene's compositor runs, and its File Output nodes write where they point.
    on_stage is told each stage's name as it begins. Raises BadInputError and StereoReprojectError.
    """
    out = work / "out"
    out.mkdir(exist_ok=True)
    files = pair_files(compare=settings.compare) if files is None else files
    if STEREO_PICTURE in files and is_composited(scene):
        check_file_outputs(scene)
    pair, report = render_pair(scene, settings, work, on_stage=on_stage)
    on_stage(Stage.WRITE)
    start = time.perf_counter()
    _write_pictures(scene, settings, pair, out, report, files)
    report["seconds"].update(load=load_seconds, write=time.perf_counter() - start)
    if settings.compare:
        on_stage(Stage.COMPARE)
        report["compare"], reference = compare_with_multiview(scene, settings, pair, work)
        if DIFFERENCE in files:
            write_difference(out / DIFFERENCE, colour(pair.main_frame.eyes[settings.target]), reference)
    report["warnings"] += scene_warnings(scene, settings.scene) + value_warnings(pair)
    check_report(report)
    write_json(out / "report.json", report)
    return report, list(files)


def render_pair(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    work: Path,
    *,
    on_stage: Callable[[str], None] = lambda _: None,
    scenes: WorkingScenes | None = None,
    precedents: Callable[[str], SharedFindings] = lambda _: SharedFindings(),
) -> tuple[StereoPair, dict[str, Any]]:
    """The pair of one frame, all its view layers, and its report as far as it goes without files; as for
    `render_files`.

    scenes are those of a sequence, which go on to its next frame; precedents has, by view layer, what others of its
    frames have found. What the report tells of one layer is of the main one, but seconds are of all.
    """
    frames: dict[str, StereoFrame] = {}
    reports: list[dict[str, Any]] = []
    with nullcontext(scenes) if scenes is not None else WorkingScenes(scene) as open_scenes:
        for layer in check_layers(scene):
            watch = Stopwatch(on_stage)
            watch.lap(Stage.PLAN)
            working = open_scenes.at(settings.scene, layer)
            frames[layer], report = _render_layer(scene, working, settings, work, watch, precedents(layer))
            reports.append(report)
    pair = StereoPair(frames)
    times = {"seconds": pair.seconds, "predicted_speedup": pair.predicted_speedup}
    layers = {"layers": pair.layer_rows()} if len(frames) > 1 else {}
    warnings = list(dict.fromkeys(line for report in reports for line in report["warnings"]))
    return pair, {**reports[0], **times, "memory": _memory(), "warnings": warnings, **layers}


def _render_layer(
    scene: bpy.types.Scene,
    working: bpy.types.Scene,
    settings: StereoSettings,
    work: Path,
    watch: Stopwatch,
    precedent: SharedFindings,
) -> tuple[StereoFrame, dict[str, Any]]:
    facts = frame_facts(scene, working, settings)
    with renderer_of(working, work, user_scene=scene) as renderer:
        frame = render_stereo_frame(renderer, settings, watch=watch, precedent=precedent)
        warnings = list(renderer.warnings)
        parallax = parallax_fields(renderer, frame.eyes[settings.source], frame_region(working.render).full_width)
    return frame, {**facts, **_measurements(frame, renderer, settings), "parallax": parallax, "warnings": warnings}


def frame_facts(scene: bpy.types.Scene, working: bpy.types.Scene, settings: StereoSettings) -> dict[str, Any]:
    """What is rendered, and with which settings, as reports tell it."""
    render = working.render
    region = frame_region(render)
    cycles = render.engine == CYCLES
    stereo = evaluated(working.camera, working).data.stereo
    return {
        "schema": REPORT_SCHEMA,
        "scene": Path(bpy.data.filepath).stem or scene.name,
        "scene_datablock": scene.name,
        "frame": working.frame_current,
        "size": [region.width, region.height],
        "samples": working.cycles.samples if cycles else working.eevee.taa_render_samples,
        "engine": render.engine,
        "device": working.cycles.device if cycles else "GPU",
        "blender": bpy.app.version_string,
        "accuracy": settings.accuracy,
        "stereo": {
            "source": settings.source,
            "interocular_distance": stereo.interocular_distance,
            "convergence_distance": stereo.convergence_distance,
            "convergence_mode": stereo.convergence_mode,
            "pivot": stereo.pivot,
        },
    }


def parallax_fields(renderer: BlenderRenderer, source: Passes, frame_width: int) -> dict[str, Any] | None:
    """The parallax of the nearest and farthest of what the source eye sees, as JSON has it: the sky's depth is null."""
    cameras = renderer.cameras
    found = visible_parallax(cameras["left"], cameras["right"], source[DEPTH_PASS], frame_width)
    return None if found is None else dict(zip(("nearest", "farthest"), map(asdict, found), strict=True))


def _measurements(frame: StereoFrame, renderer: BlenderRenderer, settings: StereoSettings) -> dict[str, Any]:
    return {
        "fill": {
            "method": frame.fill.method,
            "reason": frame.fill.reason,
            "predicted_seconds": frame.fill.predicted_seconds,
        },
        "refine": [{"method": fill.method, "reason": fill.reason} for fill in frame.refinement.fills] or None,
        "grid": {
            "cells": frame.grid.cells,
            "subdivided": int(frame.grid.subdivided.sum()),
            "triangles": frame.grid.triangles,
        },
        "warp": {"asked": settings.warp, "used": frame.warped_by, "gpu": frame.gpu},
        "fractions": traced_fractions(frame),
        "effects": effects_fields(renderer.plan, frame.accounts),
        "estimate": estimate_fields(frame.refinement, accuracy_of(settings), foreign=renderer.foreign),
        "price": asdict(frame.price),
        "correction": None if frame.correction is None else asdict(frame.correction),
        **_limited(renderer),
    }


def _limited(renderer: BlenderRenderer) -> dict[str, Any]:
    """What a time limit has left of the samples, where the scene has one."""
    if not has_time_limit(renderer.scene):
        return {}
    return {"time_limit": renderer.scene.cycles.time_limit, "samples_rendered": renderer.samples_rendered}


def _write_pictures(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    pair: StereoPair,
    out: Path,
    report: Mapping[str, Any],
    files: Sequence[str],
) -> None:
    frame, eyes = pair.main_frame, {view: pair.eyes[view] for view in VIEWS}
    pictures = {view: colour(layers[pair.main]) for view, layers in eyes.items()}
    target = pictures[settings.target]
    estimates, number = estimate_map(frame.refinement, frame.traced), report["frame"]
    why_none = report["estimate"]["from"] if frame.refinement.estimate is None else None
    writers: dict[str, Callable[[Path], None]] = {
        "left.exr": lambda path: write_eye(path, eyes["left"], view="left", metadata=pair.metadata),
        "right.exr": lambda path: write_eye(path, eyes["right"], view="right", metadata=pair.metadata),
        "stereo.exr": lambda path: write_stereo(path, eyes, metadata=pair.metadata),
        STEREO_PICTURE: lambda path: (
            deliver_composited(scene, eyes, path, frame=number, metadata=pair.metadata)
            if is_composited(scene)
            else deliver_side_by_side(scene, pictures, path, frame=number)
        ),
        "holes.png": lambda path: write_holes(path, target, frame.reasons),
        "estimate.png": lambda path: write_estimate(path, target, estimates, why_none=why_none),
        "estimate.exr": lambda path: write_eye(path, {pair.main: _estimate_passes(estimates)}, view=settings.target),
        "grid.png": lambda path: write_grid(path, pictures[settings.source], frame.grid),
    }
    for name, write in writers.items():
        if name in files:
            write(out / name)


def _estimate_passes(estimates: NDArray[np.float32]) -> Passes:
    names = ("Noise Ratio", "Noise Ratio Low", "Noise Ratio High")
    return {name: estimates[..., k : k + 1] for k, name in enumerate(names)}


def value_warnings(pair: StereoPair, *, half: bool = False) -> list[str]:
    """A line each for what a picture should not hold, or a file of half floats cannot."""
    invalid = pair.invalid_pixels.items()
    warnings = [
        f"{count} pixels of the {view} eye were no numbers in a pass, and are 0 there"
        for view, count in invalid
        if count
    ]
    for view, layers in pair.eyes.items():
        for passes in layers.values():
            warnings += range_warnings(passes, view=view, half=half)
    return list(dict.fromkeys(warnings))


def _memory() -> dict[str, float | None]:
    """What the process holds now, and the most that it has held so far; None where the system does not tell."""
    try:
        import resource
    except ImportError:
        return {"peak_mb": None, "resident_mb": None}
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    resident = None
    with suppress(OSError):
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
        resident = pages * resource.getpagesize() / (1 << 20)
    return {"peak_mb": peak / (1 << 20 if sys.platform == "darwin" else 1 << 10), "resident_mb": resident}
