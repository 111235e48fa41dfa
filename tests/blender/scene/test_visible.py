"""What is known of the scene's volumes and of the lens before anything is rendered."""

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.scene.visible import lens_of, volume_boxes
from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.settings.frame import SceneOverrides
from tests.blender.toolbox import Material, add_camera, add_cube, diffuse, empty_scene


@pytest.fixture
def scene():
    scene = empty_scene()
    add_camera(scene)
    add_cube(scene, diffuse("matte"), location=(0.0, 0.0, -9.0))
    return scene


def fog():
    material = Material("fog")
    material.link(material.node("VolumeScatter", Density=0.5).outputs[0], material.output.inputs["Volume"])
    return material


def boxes(scene):
    with working_scene(scene, SceneOverrides()) as working:
        return volume_boxes(working)


def test_a_scene_without_a_volume_has_no_box(scene):
    assert boxes(scene) == ()


def test_a_volume_s_box_holds_it_wherever_it_stands(scene):
    cube = add_cube(scene, fog(), location=(1.0, 2.0, -6.0))
    cube.scale = (1.0, 2.0, 0.5)
    cube.rotation_euler = (0.3, 0.2, 0.9)
    (box,) = boxes(scene)
    bpy.context.view_layer.update()
    expected = [tuple(cube.matrix_world @ vertex.co) for vertex in cube.data.vertices]
    np.testing.assert_allclose(sorted(map(tuple, box)), sorted(expected), atol=1e-5)


def test_what_is_not_rendered_has_no_box(scene):
    add_cube(scene, fog(), location=(1.0, 2.0, -6.0)).hide_render = True
    assert boxes(scene) == ()


def test_the_world_s_volume_has_no_box(scene):
    world = bpy.data.worlds.new("World")
    if world.node_tree is None:
        world.use_nodes = True
    output = next(node for node in world.node_tree.nodes if node.bl_idname == "ShaderNodeOutputWorld")
    scatter = world.node_tree.nodes.new("ShaderNodeVolumeScatter")
    world.node_tree.links.new(scatter.outputs[0], output.inputs["Volume"])
    scene.world = world
    assert boxes(scene) == ()


def test_a_volume_that_moves_while_the_shutter_is_open_may_be_anywhere(scene):
    add_cube(scene, fog(), location=(1.0, 2.0, -6.0))
    scene.render.use_motion_blur = True
    assert np.isinf(boxes(scene)[0]).all()


def test_the_lens_is_the_camera_s(scene):
    camera = scene.camera.data
    camera.clip_start, camera.clip_end, camera.lens = 0.5, 70.0, 40.0
    with working_scene(scene, SceneOverrides()) as working:
        assert (lens_of(working).near, lens_of(working).far, lens_of(working).aperture) == (0.5, 70.0, 0.0)
    camera.dof.use_dof, camera.dof.aperture_fstop, camera.dof.focus_distance = True, 2.0, 3.0
    with working_scene(scene, SceneOverrides()) as working:
        assert lens_of(working).aperture == pytest.approx(0.040 / 2.0 / 2.0)
        assert lens_of(working).focus == pytest.approx(3.0)
