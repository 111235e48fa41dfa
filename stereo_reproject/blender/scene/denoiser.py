"""Denoising: what the scene asks for, and the denoisers of this Blender."""

from __future__ import annotations

import bpy

from .working import CYCLES, rendered_layer


def denoises(scene: bpy.types.Scene) -> bool:
    """Return whether a working scene's layer comes out of a render denoised."""
    asked = scene.render.engine == CYCLES and scene.cycles.use_denoising and rendered_layer(scene).cycles.use_denoising
    return asked and has_denoiser(scene)


def has_denoiser(scene: bpy.types.Scene) -> bool:
    """Return whether this Blender has a denoiser: one that was built without renders noisy pictures, and has no name
    for it."""
    return bool(scene.cycles.denoiser)
