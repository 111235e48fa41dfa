"""The scene that hostile cases begin with: it renders in a moment, and every odd thing is done to a new one."""

from __future__ import annotations

from pathlib import Path

import bpy

from tests.blender.toolbox import add_camera, add_cube, add_plane, add_sun, diffuse, empty_scene, set_background

SIDE = 16
"""Pixels of a picture's width and height."""


def small_scene() -> bpy.types.Scene:
    """A cube before a wall, lit by a sun, with a camera at the origin that looks along -z."""
    scene = empty_scene(SIDE, SIDE)
    set_background(scene, 0.5)
    add_plane(scene, diffuse("wall"), size=(30.0, 20.0), location=(0.0, 0.0, -9.0))
    add_cube(scene, diffuse("stuff"), location=(0.0, 0.0, -5.0))
    add_sun(scene)
    add_camera(scene)
    scene.frame_start = scene.frame_end = 1
    return scene


def save(path: Path, *, compress: bool = False) -> None:
    """Save the open file, unused datablocks included as far as Blender keeps them."""
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=compress, copy=True, relative_remap=False)
