"""What Cycles tells of the way that a pixel's rays take, for thin things and mirrors: passes.SOURCE_ONLY_PASSES."""

from __future__ import annotations

import bpy

from ...images.passes import LENGTH_PASS, REFLECTANCE_PASS, ROUGHNESS_PASS, SURFACE_NORMAL_PASS, Passes
from ..scene.working import rendered_layer
from .denoise import DEPTH

GLOSSY_COLOUR = "Glossy Color" if bpy.app.version >= (5, 0, 0) else "GlossCol"
NORMAL, ROUGHNESS = "Normal", "Denoising Roughness"

SWITCHES = {"use_pass_glossy_color": GLOSSY_COLOUR, "use_pass_normal": NORMAL}
"""Properties of a view layer, and the passes that they switch on."""

OURS = "stereo_reproject_"
"""What begins the properties of a working scene's layer that say which of them were not the user's."""


class RayPasses:
    """Of a working scene whose renders have what guides a denoiser. Switches on what is missing."""

    def __init__(self, scene: bpy.types.Scene, *, glossy: bool) -> None:
        layer = rendered_layer(scene)
        # Without, a ray's length is the depth of what it meets first, and says nothing of a mirror.
        self._follows = getattr(layer.cycles, "denoising_pass_follow_reflections", True)
        # They stay on, in the next frames of an animation too: with other passes, Cycles would begin anew.
        for switch in SWITCHES if glossy else ():
            if not getattr(layer, switch):
                layer[OURS + switch] = True
                setattr(layer, switch, True)
        self._added = {name for switch, name in SWITCHES.items() if OURS + switch in layer}

    def of(self, rendered: Passes) -> Passes:
        """What a render's passes, as Blender has them, tell of the rays, by our names."""
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
        """The passes without those that were switched on."""
        return {name: image for name, image in passes.items() if name not in self._added}
