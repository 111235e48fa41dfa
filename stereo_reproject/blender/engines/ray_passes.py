"""Passes about the way of a pixel's rays, for thin things and mirrors: `SOURCE_ONLY_PASSES` in `images/passes`."""

from __future__ import annotations

import bpy

from ...images.passes import LENGTH_PASS, REFLECTANCE_PASS, ROUGHNESS_PASS, SURFACE_NORMAL_PASS, Passes
from ..scene.working import rendered_layer
from .denoise import DEPTH, GUIDES

GLOSSY_COLOUR = "Glossy Color" if bpy.app.version >= (5, 0, 0) else "GlossCol"
NORMAL, ROUGHNESS = "Normal", "Denoising Roughness"

GUIDES_SWITCH = "denoising_store_passes"
"""Property of a view layer's Cycles settings that has the passes written that guide a denoiser."""

SWITCHES = {GUIDES_SWITCH: GUIDES, "use_pass_glossy_color": (GLOSSY_COLOUR,), "use_pass_normal": (NORMAL,)}
"""Properties of a view layer or of its Cycles settings, and the passes that they switch on."""

ADDED_PREFIX = "stereo_reproject_"
"""Beginning of the names of properties of a working scene's layer that mark switches as not the user's."""


class RayPasses:
    """Passes that a working scene is rendered with besides those that its user asks for: those that guide a denoiser,
    for a picture that is `denoised`, and those that tell of the ways of rays.

    Making the object switches them on, `of` picks those about rays out of a render, and `without_added` takes out all
    that the user did not ask for. mirrors: True where the scene may show flat mirrors whose images can be found. A
    noisy picture has passes about rays only there: without, it has no LENGTH_PASS, by which things thinner than a pixel
    are found too.
    """

    def __init__(self, scene: bpy.types.Scene, *, denoised: bool, mirrors: bool) -> None:
        layer = rendered_layer(scene)
        # Without, a ray's length is the depth of what it meets first, and says nothing of a mirror.
        follows = getattr(layer.cycles, "denoising_pass_follow_reflections", True)
        mirrors = mirrors and follows
        self._tells = follows and (denoised or mirrors)
        # They stay on, in packed renders and in the next frames too, so that all renders have the same passes.
        for switch in SWITCHES if mirrors else (GUIDES_SWITCH,) if denoised else ():
            owner = layer.cycles if switch == GUIDES_SWITCH else layer
            if not getattr(owner, switch):
                layer[ADDED_PREFIX + switch] = True
                setattr(owner, switch, True)
        added = (names for switch, names in SWITCHES.items() if ADDED_PREFIX + switch in layer)
        self._added = {name for names in added for name in names}

    def of(self, rendered: Passes) -> Passes:
        """Return the passes about rays among those of a render, by our names; none where the scene's passes do not
        follow reflections, or where nothing calls for them.
        """
        if not self._tells:
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
