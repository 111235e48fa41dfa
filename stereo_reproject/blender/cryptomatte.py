"""Cryptomatte of the materials, switched on for one render of a working scene and off again."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from .scene import rendered_layer

FEWEST_LEVELS = 2
"""Ranks that Blender makes at least: two to a pass."""


@contextmanager
def cryptomatte(scene: bpy.types.Scene) -> Iterator[bool]:
    """Have the materials' cryptomatte rendered; yields whether the user has asked for it, and keeps it."""
    layer = rendered_layer(scene)
    if layer.use_pass_cryptomatte_material:
        yield True
        return
    name, depth = layer.name, layer.pass_cryptomatte_depth
    try:
        layer.use_pass_cryptomatte_material = True
        if not (layer.use_pass_cryptomatte_object or layer.use_pass_cryptomatte_asset):
            layer.pass_cryptomatte_depth = FEWEST_LEVELS
        yield False
    finally:
        scene.view_layers[name].use_pass_cryptomatte_material = False
        scene.view_layers[name].pass_cryptomatte_depth = depth
