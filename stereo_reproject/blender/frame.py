"""One frame of a .blend, from the file to the finished files: what the command line and scripts call."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..accuracy import accuracy_of
from ..effects import EffectsPlan
from ..estimates import effects_fields, estimate_fields, estimate_map
from ..exr import write_eye, write_stereo
from ..passes import Passes
from ..pipeline import StereoFrame, colour, render_stereo_frame, traced_fractions
from ..report import REPORT_SCHEMA, check_report, write_json
from ..settings import StereoSettings
from ..work_folder import FILES
from .compare import compare_with_multiview
from .delivery import deliver_side_by_side
from .pictures import write_estimate, write_grid, write_holes
from .renderer import BlenderRenderer
from .rig import frame_region
from .scene import CYCLES, evaluated, scene_warnings, working_scene


def render_files(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    work: Path,
    *,
    load_seconds: float = 0.0,
    on_stage: Callable[[str], None] = lambda _: None,
) -> tuple[dict[str, Any], list[str]]:
    """Render the pair of one frame and write its files into work/out; the report, and the files' names.

    work is a private folder that also takes what passes between the stages. on_stage is told each stage's name as it
    begins. Raises BadInputError and StereoReprojectError.
    """
    out = work / "out"
    out.mkdir(exist_ok=True)
    with working_scene(scene, settings.scene) as working:
        facts = frame_facts(scene, working, settings)
        renderer = BlenderRenderer(working, work, user_scene=scene)
        frame = render_stereo_frame(renderer, settings, on_stage=on_stage)
    memory = _peak_mb()
    on_stage("write")
    start = time.perf_counter()
    _write_pictures(scene, settings, frame, out, facts["frame"])
    frame.seconds.update(load=load_seconds, write=time.perf_counter() - start)
    report = {**facts, **_measurements(frame, renderer.plan, settings), "memory": {"peak_mb": memory}}
    if settings.compare:
        on_stage("compare")
        report["compare"] = compare_with_multiview(scene, settings, frame, out / "stereo.png", work)
    report["warnings"] = scene_warnings(scene) + _invalid_warnings(frame)
    check_report(report)
    write_json(out / "report.json", report)
    return report, list(FILES)


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


def _measurements(frame: StereoFrame, plan: EffectsPlan, settings: StereoSettings) -> dict[str, Any]:
    source, price = frame.source_cost, frame.price
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
        "fractions": traced_fractions(frame),
        "effects": effects_fields(plan, frame.accounts),
        "estimate": estimate_fields(frame.refinement, accuracy_of(settings)),
        "price": asdict(price),
        "seconds": frame.seconds,
        "predicted_speedup": (source.seconds + source.per_frame) / frame.seconds["total"],
    }


def _write_pictures(
    scene: bpy.types.Scene, settings: StereoSettings, frame: StereoFrame, out: Path, number: int
) -> None:
    eyes = {view: frame.eyes[view] for view in ("left", "right")}
    for view, passes in eyes.items():
        write_eye(out / f"{view}.exr", passes, view=view)
    write_stereo(out / "stereo.exr", eyes)
    pictures = {view: colour(passes) for view, passes in eyes.items()}
    deliver_side_by_side(scene, pictures, out / "stereo.png", frame=number)
    target = pictures[settings.target]
    write_holes(out / "holes.png", target, frame.reasons)
    estimates = estimate_map(frame.refinement, frame.traced)
    write_estimate(out / "estimate.png", target, estimates)
    write_eye(out / "estimate.exr", _estimate_passes(estimates), view=settings.target)
    write_grid(out / "grid.png", pictures[settings.source], frame.grid)


def _estimate_passes(estimates: NDArray[np.float32]) -> Passes:
    names = ("Noise Ratio", "Noise Ratio Low", "Noise Ratio High")
    return {name: estimates[..., k : k + 1] for k, name in enumerate(names)}


def _invalid_warnings(frame: StereoFrame) -> list[str]:
    invalid = frame.invalid_pixels.items()
    return [f"{count} pixels of the {view} eye were no numbers and are black" for view, count in invalid if count]


def _peak_mb() -> float | None:
    """The process's greatest resident size so far, or None where the system does not tell."""
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1 << 20 if sys.platform == "darwin" else 1 << 10)
