"""Whether a scene is denoised, and whether this Blender can."""

from __future__ import annotations

import bpy

from .working import CYCLES, rendered_layer


def denoises(scene: bpy.types.Scene) -> bool:
    """Whether a working scene's layer comes out of a render denoised."""
    asked = scene.render.engine == CYCLES and scene.cycles.use_denoising and rendered_layer(scene).cycles.use_denoising
    return asked and has_denoiser(scene)


def has_denoiser(scene: bpy.types.Scene) -> bool:
    """Whether this Blender has any: one that is built without has no name for it, and renders what is noisy."""
    return bool(scene.cycles.denoiser)
