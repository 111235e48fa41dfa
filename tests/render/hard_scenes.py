"""Small scenes in each of which one effect makes a warped pixel wrong, in a room that is otherwise easy."""

from __future__ import annotations

import math
from pathlib import Path

import bpy
import numpy as np

from tests.blender.toolbox import (
    Material,
    add,
    add_camera,
    add_cube,
    add_plane,
    diffuse,
    empty_scene,
    keyframes,
    noise_image,
    save_image,
    set_background,
)

WIDTH, HEIGHT, SAMPLES = 240, 136, 16
WALL = -10.0
"""Where the far wall stands: some 12 px of disparity lie between it and what is half as far."""


def waves(folder: Path, name: str, *, phase: int = 0, times: float = 1.0) -> bpy.types.Image:
    """A picture of slow waves of colour: what bilinear interpolation changes in it is less than the noise."""
    y, x = np.mgrid[0:128, 0:128] / 128 * times
    values = np.ones((128, 128, 4), np.float32)
    for c in range(3):
        angle = 2 * np.pi * (x * (1 + (c + phase) % 2) + y * ((c + phase) % 3)) + c + phase
        values[..., c] = 0.5 + 0.4 * np.sin(angle)
    return save_image(folder / f"{name}.png", values)


def room(folder: Path) -> bpy.types.Scene:
    """A floor and a wall with slow waves on them, a lamp above: diffuse throughout, and easy."""
    scene = empty_scene(WIDTH, HEIGHT, samples=SAMPLES)
    floor = diffuse("floor", image=waves(folder, "floor", times=3.0))
    add_plane(scene, floor, size=(24, 24), location=(0, -1.6, -6), rotation=(-math.pi / 2, 0, 0)).name = "Floor"
    wall = diffuse("wall", image=waves(folder, "wall", phase=1, times=4.0))
    add_plane(scene, wall, size=(24, 14), location=(0, 3, WALL)).name = "Wall"
    add_lamp(scene, size=3.0, energy=900.0, location=(2.0, 5.0, -3.0))
    set_background(scene, 0.3)
    add_camera(scene, interocular=0.3, convergence=7.0)
    return scene


def add_lamp(scene: bpy.types.Scene, *, size: float, energy: float, location: tuple) -> bpy.types.Object:
    """A square lamp that shines down."""
    light = bpy.data.lights.new("Lamp", "AREA")
    light.size, light.energy = size, energy
    lamp = add(scene, bpy.data.objects.new("Lamp", light))
    lamp.location = location
    return lamp


def mirror(scene: bpy.types.Scene, folder: Path) -> list[bpy.types.Object]:
    """It shows a wall that is far behind the camera, and a box that is near."""
    material = Material("mirror")
    material.surface(material.node("BsdfGlossy", Roughness=0.0))
    wall_behind(scene, folder)
    add_cube(scene, diffuse("near", image=noise_image(folder, size=6, seed=2, name="near")), location=(-1.2, 0.4, 1.0))
    return [add_plane(scene, material, size=(3.0, 2.0), location=(0.2, 0.1, -5.5), rotation=(0.0, -0.12, 0.0))]


def glass_block(scene: bpy.types.Scene, folder: Path) -> list[bpy.types.Object]:
    material = Material("glass")
    material.surface(material.node("BsdfGlass", Roughness=0.0, IOR=1.45))
    rough_wall(scene, folder)
    block = add_cube(scene, material, size=1.8, location=(0.1, 0.2, -4.5), rotation=(0.1, 0.3, 0.05))
    block.scale.z = 0.2
    return [block]


def window_pane(scene: bpy.types.Scene, folder: Path) -> list[bpy.types.Object]:
    """A single surface as architects make it: mostly see-through, tinted, with a reflection of what is behind us."""
    material = Material("pane")
    mix = material.node("MixShader", Fac=0.2)
    material.link(material.node("BsdfTransparent", Color=(0.35, 0.9, 0.6, 1.0)).outputs[0], mix.inputs[1])
    material.link(material.node("BsdfGlossy", Roughness=0.0).outputs[0], mix.inputs[2])
    material.surface(mix)
    rough_wall(scene, folder)
    wall_behind(scene, folder)
    return [add_plane(scene, material, size=(1.7, 1.5), location=(0.0, 0.2, -4.0), rotation=(0, 0.2, 0))]


def wall_behind(scene: bpy.types.Scene, folder: Path) -> None:
    """Far behind the camera, for what reflects it."""
    rough = diffuse("behind", image=noise_image(folder, size=48, name="behind"))
    add_plane(scene, rough, size=(30, 16), location=(0, 3, 9), rotation=(0, math.pi, 0))


def rough_wall(scene: bpy.types.Scene, folder: Path) -> None:
    """A texture on the wall by which it is seen whether it stands in its place."""
    scene.objects["Wall"].data.materials[0] = diffuse("rough", image=waves(folder, "rough", times=18.0)).block


def volume(scene: bpy.types.Scene, folder: Path) -> list[bpy.types.Object]:
    """Smoke with no surface: its pixels have the depth of the wall behind it."""
    rough_wall(scene, folder)
    return [add_cube(scene, smoke(), size=1.3, location=(0.1, 0.1, -4.5))]


def smoke() -> Material:
    material = Material("smoke")
    both = material.node("AddShader")
    scatter = material.node("VolumeScatter", Color=(0.9, 0.6, 0.3, 1.0), Density=1.8)
    absorb = material.node("VolumeAbsorption", Color=(0.2, 0.3, 0.8, 1.0), Density=1.2)
    material.link(scatter.outputs[0], both.inputs[0])
    material.link(absorb.outputs[0], both.inputs[1])
    material.link(both.outputs[0], material.output.inputs["Volume"])
    return material


def volume_before_sky(scene: bpy.types.Scene, folder: Path) -> list[bpy.types.Object]:
    """No surface at all behind it: only the colour tells that something is there."""
    bpy.data.objects.remove(scene.objects["Wall"])
    textured_sky(scene)
    return [add_cube(scene, smoke(), size=1.3, location=(0.1, 0.3, -4.5))]


def textured_sky(scene: bpy.types.Scene, *, scale: float = 3.0, strength: float = 0.8) -> None:
    """Soft clouds all around."""
    tree = scene.world.node_tree
    noise, coordinates = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeTexCoord")
    noise.inputs["Scale"].default_value, noise.inputs["Detail"].default_value = scale, 1.0
    background = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBackground")
    tree.links.new(coordinates.outputs["Generated"], noise.inputs["Vector"])
    tree.links.new(noise.outputs["Color"], background.inputs["Color"])
    background.inputs["Strength"].default_value = strength


def leaves(scene: bpy.types.Scene, folder: Path) -> list[bpy.types.Object]:
    """Layers of foliage that is finer than a pixel, cut out of planes."""
    rng = np.random.default_rng(3)
    values = np.zeros((256, 256, 4), np.float32)
    values[..., :3] = (rng.random((256, 256, 1)) < 0.4).astype(np.float32)
    values[..., 3] = 1.0
    image = save_image(folder / "leaves.png", values)
    material = Material("leaves")
    mix, leaf = material.node("MixShader"), material.node("BsdfDiffuse", Color=(0.15, 0.5, 0.08, 1.0))
    material.link(material.texture(image), mix.inputs["Fac"])
    material.link(material.node("BsdfTransparent").outputs[0], mix.inputs[1])
    material.link(leaf.outputs[0], mix.inputs[2])
    material.surface(mix)
    places = [(-0.3, 0.2, -3.4), (0.3, 0.4, -4.4)]
    return [add_plane(scene, material, size=(1.5, 1.1), location=place, rotation=(0.2, 0.4, 0.1)) for place in places]


def hair(scene: bpy.types.Scene, folder: Path) -> list[bpy.types.Object]:
    """Black strands a quarter of a pixel wide, standing before the wall."""
    rng = np.random.default_rng(4)
    strands, points = 150, 4
    curves = bpy.data.hair_curves.new("Hair")
    curves.add_curves([points] * strands)
    root = rng.uniform((-0.6, -0.6, -0.4), (0.6, -0.5, 0.4), (strands, 3))
    tip = root + rng.uniform((-0.2, 0.7, -0.2), (0.2, 1.2, 0.2), (strands, 3))
    along = np.linspace(0.0, 1.0, points)[None, :, None]
    positions = root[:, None] * (1.0 - along) + tip[:, None] * along
    curves.attributes["position"].data.foreach_set("vector", positions.astype(np.float32).ravel())
    radius = curves.attributes.get("radius") or curves.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.full(strands * points, 0.002, np.float32))
    material = diffuse("hair", colour=(0.03, 0.02, 0.01))
    curves.materials.append(material.block)
    item = add(scene, bpy.data.objects.new("Hair", curves))
    item.location = (0.0, 0.0, -4.0)
    bpy.context.view_layer.update()
    return [item]


def highlight(scene: bpy.types.Scene, folder: Path) -> list[bpy.types.Object]:
    """A glossy table and a small lamp behind it: the highlight is where the lamp's mirror image is."""
    material = Material("polished")
    mix = material.node("MixShader", Fac=0.25)
    material.link(material.node("BsdfDiffuse", Color=(0.3, 0.1, 0.1, 1.0)).outputs[0], mix.inputs[1])
    material.link(material.node("BsdfGlossy", Roughness=0.12).outputs[0], mix.inputs[2])
    material.surface(mix)
    lamp = add_lamp(scene, size=0.4, energy=60.0, location=(0.3, 0.0, -9.0))
    lamp.rotation_euler.x = math.pi + 0.2
    table = (-math.pi / 2, 0, 0)
    return [add_plane(scene, material, size=(3.5, 3.0), location=(0.1, -1.0, -5.0), rotation=table)]


def defocus(scene: bpy.types.Scene, folder: Path) -> list[bpy.types.Object]:
    """The wall is in focus, and a box near the camera is a blur that one sees through at its rim."""
    rough_wall(scene, folder)
    dof = scene.camera.data.dof
    dof.use_dof, dof.focus_distance, dof.aperture_fstop = True, -WALL, 0.15
    return [add_cube(scene, diffuse("blurred", colour=(0.8, 0.15, 0.1)), size=0.7, location=(0.1, 0.1, -3.0))]


def motion(scene: bpy.types.Scene, folder: Path) -> list[bpy.types.Object]:
    """Bars that move by twice their width while the shutter is open: nothing but blur, that one sees through."""
    rough_wall(scene, folder)
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
    paint = diffuse("moving", colour=(0.8, 0.15, 0.1))
    bars = []
    for x in (-0.8, 0.0, 0.8):
        bar = add_plane(scene, paint, size=(0.12, 1.2))
        keyframes(bar, "location", {0: (x - 0.25, 0.0, -4.0), 2: (x + 0.25, 0.3, -4.0)})
        bars.append(bar)
    scene.frame_set(1)
    return bars


def checkerboard(scene: bpy.types.Scene) -> None:
    """The floor is a checkerboard up to the horizon, and nothing stands on it."""
    bpy.data.objects.remove(scene.objects["Wall"])
    bpy.data.objects.remove(scene.objects["Lamp"])
    floor = scene.objects["Floor"]
    floor.scale = (500.0, 500.0, 1.0)
    material = Material("checkerboard")
    checker, shader = material.node("TexChecker", Scale=0.7), material.node("BsdfDiffuse")
    checker.inputs["Color1"].default_value, checker.inputs["Color2"].default_value = (0.8,) * 4, (0.1,) * 4
    material.link(material.node("NewGeometry").outputs["Position"], checker.inputs["Vector"])
    material.link(checker.outputs["Color"], shader.inputs["Color"])
    floor.data.materials[0] = material.surface(shader).block
    set_background(scene, 1.0)
    scene.camera.data.clip_end = 1e5
