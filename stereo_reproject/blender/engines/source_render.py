"""A source as Cycles renders it: the passes that we add to it, and its first sample alone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import bpy

from ...images.effects import EffectsPlan
from ...images.effects_pass import effects_pass, material_pass
from ...images.passes import EFFECTS_PASS, MATERIAL_PASS, Passes
from ...views.camera import Camera
from ..scene.cryptomatte import switch_on_cryptomatte
from ..scene.rendered import CYCLES
from ..scene.working import changed, rendered_layer
from .portal_sheet import hide_sheet
from .render import Rendered, render_views
from .time_limit import count_samples, has_time_limit


def render_source_view(
    scene: bpy.types.Scene, view: str, cameras: Iterable[Camera], plan: EffectsPlan, folder: Path, seed: int
) -> Rendered:
    """Render an eye of a working scene, with the passes that a source must have for us, and without what no plain
    render may show to any of the cameras. The other parameters are those of `render_views`.
    """
    if _tells_effects(scene, plan):
        switch_on_cryptomatte(scene)
    hide_sheet(scene, cameras)
    if has_time_limit(scene):
        count_samples(scene)
    return render_views(scene, (view,), folder, seed=seed)


def effects_passes(scene: bpy.types.Scene, plan: EffectsPlan, passes: Passes, attributes: Mapping[str, str]) -> Passes:
    """Return the passes of the effects and the materials of each pixel, which the passes and attributes of a source
    tell. They are left out where they are not known, or nothing may look different from each eye.
    """
    effects = effects_in(scene, plan, passes, attributes)
    materials = material_pass(passes) if _tells_effects(scene, plan) else None
    return effects if materials is None else {**effects, MATERIAL_PASS: materials}


def effects_in(scene: bpy.types.Scene, plan: EffectsPlan, passes: Passes, attributes: Mapping[str, str]) -> Passes:
    """Return the pass (..., 1) of the effects that each pixel of a render shows, by its passes (..., C) and attributes.
    There is none where they do not tell it, or nothing may look different from each eye.
    """
    if not _tells_effects(scene, plan):
        return {}
    effects = effects_pass(passes, attributes, plan.materials, layer=rendered_layer(scene).name)
    return {} if effects is None else {EFFECTS_PASS: effects}


def _tells_effects(scene: bpy.types.Scene, plan: EffectsPlan) -> bool:
    """Return whether the source of a working scene has passes that tell of the effects and materials of each pixel."""
    return bool(plan.view_dependent) and scene.render.engine == CYCLES


def has_first_sample(scene: bpy.types.Scene) -> bool:
    """Return whether a working scene's renders begin with a sample that can be rendered alone: by EEVEE they do not,
    nor where the scene asks for a range of samples.
    """
    return scene.render.engine == CYCLES and not scene.cycles.use_sample_subset


@contextmanager
def single_sample(scene: bpy.types.Scene) -> Iterator[None]:
    """Have a working scene rendered with one sample, not denoised, for the time of a `with` block."""
    # A layer's own number would win.
    with changed(scene.cycles, samples=1, use_denoising=False), changed(rendered_layer(scene), samples=0):
        yield
