"""The scene that hostile cases begin with: it renders in a moment, and every odd thing is done to a new one; and what
several makers do to it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy

from tests.blender.toolbox import (
    Material,
    add,
    add_camera,
    add_cube,
    add_plane,
    add_sun,
    diffuse,
    empty_scene,
    set_background,
)

NAN, INFINITE, HUGE = math.nan, math.inf, 1e30
MODERN = bpy.app.version >= (5, 0)

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


def odd_material(scene: bpy.types.Scene) -> Material:
    """A new material on the cube."""
    made = Material("odd")
    scene.objects["Cube"].data.materials[0] = made.block
    return made


def broken_number(made: Material, kind: str) -> bpy.types.NodeSocket:
    """A socket whose value is no finite number."""
    if kind == "infinite":
        node = made.node("Math")
        node.operation = "MULTIPLY"
        node.inputs[0].default_value = node.inputs[1].default_value = 3e38
        return node.outputs[0]
    node = made.node("Math")
    node.operation = "SUBTRACT"
    made.link(broken_number(made, "infinite"), node.inputs[0])
    made.link(broken_number(made, "infinite"), node.inputs[1])
    return node.outputs[0]


def add_mesh(scene: bpy.types.Scene, vertices: Any, edges: Any = (), faces: Any = ()) -> bpy.types.Object:
    """A mesh of these vertices, edges and faces, valid or not."""
    mesh = bpy.data.meshes.new("Odd")
    mesh.from_pydata(vertices, list(edges), list(faces))
    return add(scene, bpy.data.objects.new("Odd", mesh))


def drive(
    item: bpy.types.ID,
    path: str,
    expression: str,
    *,
    index: int = -1,
    target: bpy.types.ID | None = None,
    target_path: str = "",
) -> bpy.types.FCurve:
    """A driver by an expression, in which `value` is the target's property, if there is a target."""
    curve = item.driver_add(path, index) if index >= 0 else item.driver_add(path)
    curve.driver.expression = expression
    if target is not None:
        variable = curve.driver.variables.new()
        variable.name = "value"
        variable.targets[0].id = target
        variable.targets[0].data_path = target_path
    return curve
