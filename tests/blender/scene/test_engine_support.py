"""What one engine shows and the other does not know is said, a line each."""

import bpy
import pytest

from stereo_reproject.blender.scene.engine_support import engine_warnings, unmatched_materials
from stereo_reproject.blender.scene.rig import stereo_cameras
from stereo_reproject.blender.scene.warnings import warnings_ahead
from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.settings.frame import SceneOverrides
from tests.blender.toolbox import Material, add, add_camera, add_plane, add_sun, diffuse, empty_scene

EEVEE_ONLY, CYCLES_ONLY = "which Cycles does not know", "which EEVEE does not know"
AHEAD = (0.0, 0.0, -6.0)


@pytest.fixture
def scene():
    scene = empty_scene(64, 36)
    add_camera(scene)
    return scene


def shaded(kind):
    material = Material(kind)
    return material.surface(material.node(kind))


def warnings(scene):
    with working_scene(scene, SceneOverrides(source_engine="eevee")) as working:
        return engine_warnings(working)


def test_of_what_both_know_nothing_is_said(scene):
    add_plane(scene, diffuse(), location=AHEAD)
    add_sun(scene)
    assert warnings(scene) == []


@pytest.mark.parametrize("kind", ["BsdfToon", "BsdfSheen", "BsdfHair", "BsdfHairPrincipled", "BsdfRayPortal"])
def test_a_shader_of_cycles_alone(scene, kind):
    add_plane(scene, shaded(kind), location=AHEAD)
    (line,) = warnings(scene)
    assert line.startswith(f"material '{kind}' uses ")
    assert CYCLES_ONLY in line


def test_it_is_said_before_anything_is_rendered_by_eevee(scene):
    add_plane(scene, shaded("BsdfToon"), location=AHEAD)
    assert warnings_ahead(scene, SceneOverrides(source_engine="eevee")) == warnings(scene)
    assert warnings_ahead(scene, SceneOverrides()) == []


def test_a_shader_of_eevees_alone(scene):
    add_plane(scene, shaded("EeveeSpecular"), location=AHEAD)
    (line,) = warnings(scene)
    assert EEVEE_ONLY in line


def test_it_is_found_within_a_group(scene):
    tree = bpy.data.node_groups.new("inside", "ShaderNodeTree")
    tree.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    toon, result = tree.nodes.new("ShaderNodeBsdfToon"), tree.nodes.new("NodeGroupOutput")
    tree.links.new(toon.outputs[0], result.inputs[0])
    material = Material("grouped")
    group = material.node("Group")
    group.node_tree = tree
    add_plane(scene, material.surface(group), location=AHEAD)
    (line,) = warnings(scene)
    assert line.startswith("material 'grouped' uses Toon")


def test_what_is_not_linked_or_not_seen_is_not_told(scene):
    material = diffuse("unlinked")
    material.node("BsdfToon")
    add_plane(scene, material, location=AHEAD)
    add_plane(scene, shaded("BsdfSheen"), location=(0.0, 0.0, 6.0))
    assert warnings(scene) == []


def test_outputs_of_each_engines_own(scene):
    material = diffuse("two")
    material.output.target = "EEVEE"
    add_plane(scene, material, location=AHEAD)
    assert warnings(scene) == ["material 'two' has no output that Cycles reads: it is black there"]
    other = material.node("OutputMaterial")
    other.target = "CYCLES"
    material.link(material.node("Emission").outputs[0], other.inputs["Surface"])
    assert warnings(scene) == [
        "material 'two' has an output for EEVEE and another for Cycles: they need not look the same"
    ]


def test_lights_that_eevee_does_not_know(scene):
    lamp = add_sun(scene).data
    if lamp.node_tree is None:
        lamp.use_nodes = True
    assert warnings(scene) == []
    emission = next(node for node in lamp.node_tree.nodes if node.bl_idname == "ShaderNodeEmission")
    noise = lamp.node_tree.nodes.new("ShaderNodeTexNoise")
    lamp.node_tree.links.new(noise.outputs[0], emission.inputs["Strength"])
    portal = bpy.data.lights.new("window", "AREA")
    portal.cycles.is_portal = True
    add(scene, bpy.data.objects.new("window", portal))
    first, second = warnings(scene)
    assert first.startswith("light 'Sun' has nodes")
    assert second.startswith("light 'window' is a portal")


@pytest.mark.parametrize(("method", "told"), [("BLENDED", True), ("DITHERED", False)])
def test_what_eevee_draws_without_depth_cannot_be_matched(scene, method, told):
    pane = shaded("BsdfTransparent")
    pane.block.surface_render_method = method
    add_plane(scene, pane, location=AHEAD)
    with working_scene(scene, SceneOverrides(source_engine="eevee")) as working:
        why = unmatched_materials(working, stereo_cameras(working.camera, working.render).values())
    assert (why is not None) == told
