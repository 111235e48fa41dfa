"""Denoising: what the scene asks for, and the denoisers of this Blender."""

from __future__ import annotations

import bpy

from .rendered import CYCLES
from .working import rendered_layer

NO_DENOISER = "this Blender has no denoiser: pictures stay noisy, as after F12"
"""Warning about a scene that is to be denoised in a Blender that cannot."""


def denoises(scene: bpy.types.Scene) -> bool:
    """Return whether the renders of a working scene are to be denoised: Cycles, its settings and its view layer ask for
    it, and this Blender can.
    """
    asked = scene.render.engine == CYCLES and scene.cycles.use_denoising and rendered_layer(scene).cycles.use_denoising
    return asked and has_denoiser(scene)


def has_denoiser(scene: bpy.types.Scene) -> bool:
    """Return whether this Blender has a denoiser. One that was built without has no name for it, and renders noisy
    pictures.
    """
    return bool(scene.cycles.denoiser)
