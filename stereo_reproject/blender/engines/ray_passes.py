"""Passes about the way of a pixel's rays: for thin things and mirrors, and for light that looks different from each
eye."""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from ...images.effects import EffectsPlan
from ...images.passes import (
    LENGTH_PASS,
    REFLECTANCE_PASS,
    ROUGHNESS_PASS,
    SURFACE_NORMAL_PASS,
    VIEW_DEPENDENT_PASS,
    Passes,
)
from ...images.reflected_light import LIGHT_PASS_PREFIXES, LIGHT_PASS_SUFFIXES, light_pass_names, reflected_light
from ..scene.rendered import CYCLES
from ..scene.working import rendered_layer
from .denoise import DEPTH, GUIDES

GLOSSY_COLOUR = "Glossy Color" if bpy.app.version >= (5, 0, 0) else "GlossCol"
NORMAL, ROUGHNESS = "Normal", "Denoising Roughness"

GUIDES_SWITCH = "denoising_store_passes"
"""Property of a view layer's Cycles settings that has the passes written that guide a denoiser."""

LIGHT_SWITCHES = {
    f"use_pass_{kind}_{part}": light_pass_names(kind, part)
    for kind in LIGHT_PASS_PREFIXES
    for part in LIGHT_PASS_SUFFIXES
}
"""Properties of a view layer that switch on the passes of reflected and transmitted light, with the names of each."""

MIRROR_SWITCHES = (GUIDES_SWITCH, "use_pass_glossy_color", "use_pass_normal")
"""Properties that switch on the passes by which the images in flat mirrors are found."""

SWITCHES = {GUIDES_SWITCH: GUIDES, "use_pass_normal": (NORMAL,), **LIGHT_SWITCHES}
"""Properties of a view layer or of its Cycles settings, and the passes that they switch on."""

ADDED_PREFIX = "stereo_reproject_"
"""Beginning of the names of properties of a working scene's layer that mark switches as not the user's."""


class RayPasses:
    """Passes that a working scene is rendered with besides those that its user asks for: those that guide a denoiser,
    for a picture that is `denoised`, those that tell of the ways of rays, and those of reflected and transmitted light.

    Making the object switches them on, but for those of light, which `tell_light_apart` does; `of` picks those about
    rays out of a render, and `without_added` takes out all that the user did not ask for. mirrors: True where the scene
    may show flat mirrors whose images can be found. A noisy picture has passes about rays only there: without, it has
    no LENGTH_PASS, by which things thinner than a pixel are found too. plan says whether reflected light is worth being
    told apart, which a denoised picture alone has.
    """

    def __init__(self, scene: bpy.types.Scene, plan: EffectsPlan, *, denoised: bool, mirrors: bool) -> None:
        layer = rendered_layer(scene)
        # Without, a ray's length is the depth of what it meets first, and says nothing of a mirror.
        follows = getattr(layer.cycles, "denoising_pass_follow_reflections", True)
        mirrors = mirrors and follows
        self._tells = follows and (denoised or mirrors)
        self._may_tell_light = denoised and scene.render.engine == CYCLES and plan.differs_in_reflected_light
        self._tells_light = False
        self._added: set[str] = set()
        wanted = {GUIDES_SWITCH} if denoised else set()
        wanted |= set(MIRROR_SWITCHES) if mirrors else set()
        self._switch_on(layer, wanted)

    def tell_light_apart(self, scene: bpy.types.Scene, *, probed: bool) -> None:
        """Have the working scene rendered with the passes of reflected and transmitted light from now on, if pixels are
        to be `probed` and that light is worth being told apart. They take 72 bytes for each pixel.
        """
        self._tells_light = probed and self._may_tell_light
        self._switch_on(rendered_layer(scene), LIGHT_SWITCHES if self._tells_light else ())

    def _switch_on(self, layer: bpy.types.ViewLayer, switches: Iterable[str]) -> None:
        """Switch passes on, and note which of all that are on were not asked for by the user.

        They stay on, in packed renders and in the next frames too, so that all renders have the same passes.
        """
        for switch in switches:
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
        """Return the passes (..., C) without those that were switched on here and that the user did not ask for, and
        with VIEW_DEPENDENT_PASS (..., 3) where light is told apart.
        """
        kept = {name: image for name, image in passes.items() if name not in self._added}
        return {**kept, VIEW_DEPENDENT_PASS: reflected_light(passes)} if self._tells_light else kept
