"""What Cycles tells of the way that a pixel's rays take, for thin things and mirrors: passes.OF_SOURCE."""

from __future__ import annotations

import bpy

from ..passes import LENGTH_PASS, REFLECTANCE_PASS, Passes
from .denoise import DEPTH
from .scene import rendered_layer

GLOSSY_COLOUR = ("Glossy Color", "GlossCol")
"""The pass by its names in Blender 5 and in 4.5."""


class RayPasses:
    """Of a working scene whose renders have what guides a denoiser. Switches on what is missing."""

    def __init__(self, scene: bpy.types.Scene, *, glossy: bool) -> None:
        layer = rendered_layer(scene)
        # Without, a ray's length is the depth of what it meets first, and says nothing of a mirror.
        self._follows = getattr(layer.cycles, "denoising_pass_follow_reflections", True)
        self._added = () if layer.use_pass_glossy_color else GLOSSY_COLOUR
        # It stays on: with other passes for the next render, Cycles would begin anew.
        layer.use_pass_glossy_color |= glossy

    def of(self, rendered: Passes) -> Passes:
        """What a render's passes, as Blender has them, tell of the rays, by our names."""
        if not self._follows:
            return {}
        told = {LENGTH_PASS: rendered[DEPTH]}
        for name in GLOSSY_COLOUR:
            if name in rendered:
                told[REFLECTANCE_PASS] = rendered[name]
        return told

    def without_added(self, passes: Passes) -> Passes:
        """The passes without the one that was switched on."""
        return {name: image for name, image in passes.items() if name not in self._added}
