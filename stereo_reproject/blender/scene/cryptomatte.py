"""Cryptomatte of the materials, switched on in a working scene."""

from __future__ import annotations

import bpy

from .working import rendered_layer

MIN_LEVELS = 2
"""Ranks that Blender makes at least: two to a pass."""

OURS = "stereo_reproject_cryptomatte"
"""Property of the working scene's view layer: that it was us who switched it on."""


def cryptomatte_asked_for(scene: bpy.types.Scene) -> bool:
    """Return whether the user has asked for the materials' cryptomatte. It does not count if `switch_on_cryptomatte`
    has switched it on.
    """
    layer = rendered_layer(scene)
    return layer.use_pass_cryptomatte_material and OURS not in layer


def switch_on_cryptomatte(scene: bpy.types.Scene) -> None:
    """Have the materials' cryptomatte rendered, from now on in every render of a working scene. It is never switched
    off: with persistent data, the render after the last one with it damages Blender's memory (5.2.3).
    """
    layer = rendered_layer(scene)
    if layer.use_pass_cryptomatte_material:
        return
    layer.use_pass_cryptomatte_material = layer[OURS] = True
    if not (layer.use_pass_cryptomatte_object or layer.use_pass_cryptomatte_asset):
        layer.pass_cryptomatte_depth = MIN_LEVELS
