"""A small scene with every pass on that Blender offers, and something in it for most of them to show."""

from __future__ import annotations

from pathlib import Path

import bpy

from tests.blender.toolbox import (
    Material,
    add_camera,
    add_cube,
    add_plane,
    add_sphere,
    add_sun,
    empty_scene,
    keyframes,
    noise_image,
    set_background,
)

LAYER = "Every.Pass"
"""A view layer may be called so, and then has the separator of channel names in its own."""

AOVS = {"Normal map": "COLOR", "Depth of it": "VALUE", "UV mask": "COLOR", "Cryptic": "VALUE"}
"""Names that begin as those of passes that must not be mixed."""

LIGHT_GROUP = "Sun.1"

OFF = ("use_pass_cryptomatte_accurate", "use_pass_shadow_catcher")
"""One that is no pass, and one that needs something to catch shadows with."""


def every_pass(folder: Path, width: int = 96, height: int = 54, *, samples: int = 4) -> bpy.types.Scene:
    """A wall before the sky, a floor, a box, and a ball that moves across and shines; the camera stands
    still. What a plain multiview render gives is the ruler."""
    scene = empty_scene(width, height, samples=samples)
    picture = noise_image(folder, size=8)
    add_plane(scene, _surface("wall", picture), size=(8, 5), location=(0, 0, -9)).pass_index = 1
    floor = add_plane(scene, _surface("floor", picture), size=(16, 14), location=(0, -1.6, -6), rotation=(-1.3, 0, 0))
    floor.pass_index = 2
    add_cube(scene, _surface("box", picture), size=1.4, location=(-1.3, -0.2, -5.5)).pass_index = 3
    ball = add_sphere(scene, _surface("ball", picture, shining=True), radius=0.7, location=(1.2, 0.2, -4.5))
    ball.pass_index = 4
    keyframes(ball, "location", {0: (0.9, 0.1, -4.5), 1: (1.2, 0.2, -4.5), 2: (1.6, 0.35, -4.5)})
    for index, material in enumerate(bpy.data.materials):
        material.pass_index = 10 + index
    sun = add_sun(scene)
    set_background(scene, 0.4)
    add_camera(scene)
    scene.frame_set(1)
    _switch_on(scene)
    sun.lightgroup = scene.view_layers[0].lightgroups[0].name
    return scene


def _surface(name: str, picture: bpy.types.Image, *, shining: bool = False) -> Material:
    material = Material(name)
    texture = material.texture(picture)
    shader = material.node("BsdfDiffuse")
    material.link(texture, shader.inputs["Color"])
    for aov, kind in AOVS.items():
        output = material.node("OutputAOV")
        output.aov_name = aov
        material.link(texture, output.inputs["Value" if kind == "VALUE" else "Color"])
    if not shining:
        return material.surface(shader)
    rough = material.node("BsdfPrincipled", Roughness=0.6)
    material.link(texture, rough.inputs["Base Color"])
    material.link(texture, rough.inputs["Emission Color"])
    rough.inputs["Emission Strength"].default_value = 0.3
    rough.inputs["Transmission Weight"].default_value = 0.4
    return material.surface(rough)


def _switch_on(scene: bpy.types.Scene) -> None:
    layer = scene.view_layers[0]
    layer.name = LAYER
    for owner in (layer, layer.cycles):
        for name in [one.identifier for one in owner.bl_rna.properties]:
            if name.startswith(("use_pass_", "pass_debug_", "pass_render_")) and name not in OFF:
                setattr(owner, name, True)
    for name, kind in AOVS.items():
        aov = layer.aovs.add()
        aov.name, aov.type = name, kind
    layer.lightgroups.add(name=LIGHT_GROUP)
