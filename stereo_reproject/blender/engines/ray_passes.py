"""Passes about the way of a pixel's rays, for thin things and mirrors: `SOURCE_ONLY_PASSES` in `images/passes`."""

from __future__ import annotations

import bpy

from ...images.passes import LENGTH_PASS, REFLECTANCE_PASS, ROUGHNESS_PASS, SURFACE_NORMAL_PASS, Passes
from ..scene.working import rendered_layer
from .denoise import DEPTH

GLOSSY_COLOUR = "Glossy Color" if bpy.app.version >= (5, 0, 0) else "GlossCol"
NORMAL, ROUGHNESS = "Normal", "Denoising Roughness"

SWITCHES = {"use_pass_glossy_color": GLOSSY_COLOUR, "use_pass_normal": NORMAL}
"""Properties of a view layer, and the passes that they switch on."""

ADDED_PREFIX = "stereo_reproject_"
"""Beginning of the names of properties of a working scene's layer that mark switches as not the user's."""


class RayPasses:
    """Source of the passes that tell of the ways of rays, for a working scene that is rendered with passes for a
    denoiser. Making the object switches on passes about the surface, with `glossy`, that the scene lacks. `of` picks
    the passes out of a render.
    """

    def __init__(self, scene: bpy.types.Scene, *, glossy: bool) -> None:
        layer = rendered_layer(scene)
        # Without, a ray's length is the depth of what it meets first, and says nothing of a mirror.
        self._follows = getattr(layer.cycles, "denoising_pass_follow_reflections", True)
        # They stay on, in the next frames of an animation too: with other passes, Cycles would begin anew.
        for switch in SWITCHES if glossy else ():
            if not getattr(layer, switch):
                layer[ADDED_PREFIX + switch] = True
                setattr(layer, switch, True)
        self._added = {name for switch, name in SWITCHES.items() if ADDED_PREFIX + switch in layer}

    def of(self, rendered: Passes) -> Passes:
        """Return the passes about rays among those of a render, by our names; none where the scene's passes do not
        follow reflections.
        """
        if not self._follows:
            return {}
        ours = {
            LENGTH_PASS: DEPTH,
            REFLECTANCE_PASS: GLOSSY_COLOUR,
            SURFACE_NORMAL_PASS: NORMAL,
            ROUGHNESS_PASS: ROUGHNESS,
        }
        return {name: rendered[theirs] for name, theirs in ours.items() if theirs in rendered}

    def without_added(self, passes: Passes) -> Passes:
        """Return the passes without those that were switched on here and that the user did not ask for."""
        return {name: image for name, image in passes.items() if name not in self._added}
