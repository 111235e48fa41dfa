"""Which scenes call for probes: those in which something may look different from each eye, and no others."""

import bpy
import pytest

from stereo_reproject.blender.effects import view_dependent_effects
from tests.blender.toolbox import Material, add, add_camera, add_plane, diffuse, empty_scene


@pytest.fixture
def scene():
    scene = empty_scene()
    add_camera(scene)
    add_plane(scene, diffuse("matte"))
    return scene


def shaded(name, *kinds, **inputs):
    """A material with the shader of the last kind, which the ones before it feed."""
    material = Material(name)
    shader = material.node(kinds[-1], **inputs)
    for kind in kinds[:-1]:
        material.link(material.node(kind).outputs[0], shader.inputs[0])
    return material.surface(shader)


def test_a_diffuse_scene_calls_for_nothing(scene):
    assert view_dependent_effects(scene) == ()


@pytest.mark.parametrize(
    "kind", ["BsdfGlossy", "BsdfGlass", "BsdfPrincipled", "BsdfTransparent", "SubsurfaceScattering"]
)
def test_a_surface_that_depends_on_the_view_is_named(scene, kind):
    add_plane(scene, shaded("polished", kind))
    assert view_dependent_effects(scene) == ("material 'polished'",)


@pytest.mark.parametrize("kind", ["LightPath", "Fresnel", "LayerWeight", "CameraData"])
def test_what_a_shader_knows_of_the_eye_counts(scene, kind):
    add_plane(scene, shaded("telling", kind, "Emission"))
    assert view_dependent_effects(scene) == ("material 'telling'",)


def test_a_shader_inside_a_group_counts(scene):
    group = bpy.data.node_groups.new("inner", "ShaderNodeTree")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    glossy, output = group.nodes.new("ShaderNodeBsdfGlossy"), group.nodes.new("NodeGroupOutput")
    group.links.new(glossy.outputs[0], output.inputs[0])
    material = Material("grouped")
    node = material.node("Group")
    node.node_tree = group
    add_plane(scene, material.surface(node))
    assert view_dependent_effects(scene) == ("material 'grouped'",)


def test_a_material_that_only_an_instance_shows_counts(scene):
    collection = bpy.data.collections.new("hidden away")
    plane = add_plane(scene, shaded("polished", "BsdfGlossy"))
    scene.collection.objects.unlink(plane)
    collection.objects.link(plane)
    empty = add(scene, bpy.data.objects.new("instance", None))
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    assert view_dependent_effects(scene) == ("material 'polished'",)


def test_lens_shutter_air_and_hair_count(scene):
    scene.camera.data.dof.use_dof = True
    scene.render.use_motion_blur = True
    tree = scene.world.node_tree
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputWorld")
    tree.links.new(tree.nodes.new("ShaderNodeVolumeScatter").outputs[0], output.inputs["Volume"])
    add(scene, bpy.data.objects.new("Fur", bpy.data.hair_curves.new("Fur")))
    assert view_dependent_effects(scene) == ("depth of field", "motion blur", "a world volume", "curves 'Fur'")
