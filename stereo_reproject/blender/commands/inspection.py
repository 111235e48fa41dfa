"""A scene inspected: its effects plan, and from a sketch what its pair will cost; nothing is rendered in full."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy

from ...images.effects_pass import MATERIAL_CRYPTOMATTE
from ...images.passes import COLOUR_PASS, DEPTH_PASS
from ...pipeline.stages import Stage
from ...report.as_json import as_json
from ...report.inspection import INSPECTION_SCHEMA, effects_rows
from ...settings.frame import StereoSettings
from ...trace.fill import check_fill
from ..engines.eevee import renderer_of
from ..engines.renderer import BlenderRenderer
from ..scene.rendered import CYCLES
from ..scene.rig import frame_region
from ..scene.warnings import first_layer_alone, scene_warnings
from ..scene.working import make_small, rendered_layer, working_scene
from .frame import report_header
from .inspection_sketch import FullPicture, foresee

SKETCH_WIDTH_PIXELS = 480
"""Width of the sketch, if that is at most half of the picture's: the holes of narrow gaps are still seen."""

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
    """Return the dict that the command `inspect` prints as JSON: the scene's header, effects, passes, prediction,
    parallax and warnings. Without a sketch nothing is rendered, and "predicted" and "parallax" are None.

    work is a private folder; on_stage gets each stage's name as it begins. Raises BadInputError and
    StereoReprojectError.
    """
    on_stage(Stage.PLAN)
    with working_scene(scene, settings.scene) as working:
        header = report_header(scene, working, settings)
        cycles = working.render.engine == CYCLES
        frame_width = frame_region(working.render).full_width
        scale = make_small(working, SKETCH_WIDTH_PIXELS) if sketch and cycles else 1.0
        full = FullPicture(header.size, header.samples, frame_width, scale)
        with renderer_of(working, work, user_scene=scene, packed_by=settings.packed_camera) as renderer:
            check_fill(settings.fill, renderer.fill_blockers())
            rows = effects_rows(renderer.plan)
            passes = _passes(working, renderer)
            alone = first_layer_alone(scene, "what is found and predicted is that")
            predicted, parallax = foresee(renderer, settings, full, rows, on_stage) if sketch else (None, None)
            # The sketch shows what stands between the eyes.
            warnings = [*scene_warnings(scene, settings.scene), *renderer.warnings, *alone]
    return {
        **{key: value for key, value in as_json(header).items() if key not in ("stereo", "scene_datablock")},
        "schema": INSPECTION_SCHEMA,
        "effects": rows,
        "passes": passes,
        "predicted": predicted,
        "parallax": parallax,
        "warnings": warnings,
    }


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
