"""The effects plan: what a scene calls for, by which object and material, and nothing that the cameras cannot see."""

import bpy
import pytest

from stereo_reproject.blender.scene.effects import plan_effects
from stereo_reproject.blender.scene.working import open_blend, working_scene
from stereo_reproject.images.effects import EEVEE_HANDLING, HANDLING, NOT_CALLED_FOR, Effect
from stereo_reproject.settings.frame import SceneOverrides
from tests.blender.toolbox import (
    Material,
    add,
    add_camera,
    add_cube,
    add_plane,
    add_sun,
    diffuse,
    empty_scene,
    keyframes,
)

NOTHING = Effect(0)
AHEAD = (0.0, 0.0, -5.0)


@pytest.fixture
def scene():
    """A matte wall before the camera, lit by a sun."""
    scene = empty_scene()
    add_camera(scene)
    add_sun(scene)
    add_plane(scene, diffuse("matte"), size=(20.0, 20.0), location=(0.0, 0.0, -8.0)).name = "Wall"
    return scene


def plan(scene, **overrides):
    with working_scene(scene, SceneOverrides(**overrides)) as working:
        return plan_effects(working, user_scene=scene)


def called_for(scene):
    return plan(scene).called_for


def by(scene, effect):
    return next(finding.by for finding in plan(scene).findings if finding.effect == effect)


def shaded(name, kind, **inputs):
    """A material of one shader; inputs are by name, with underscores for spaces."""
    material = Material(name)
    return material.surface(material.node(kind, **{name.replace("_", " "): value for name, value in inputs.items()}))


def matte(**inputs):
    """A Principled shader that is as good as diffuse, but for the inputs."""
    return shaded("principled", "BsdfPrincipled", **{"Specular_IOR_Level": 0.0, **inputs})


def shader_of(material):
    return material.output.inputs["Surface"].links[0].from_node


def fed(material, name, kind, output=0):
    """The material with a new node of this kind feeding an input of its shader."""
    node = material.node(kind)
    material.link(node.outputs[output], shader_of(material).inputs[name])
    return material


def worn(scene, material):
    """What a plane that wears the material calls for, in the middle of the picture."""
    add_plane(scene, material, location=AHEAD)
    return called_for(scene)


# A diffuse scene


def test_a_diffuse_scene_calls_for_nothing(scene):
    result = plan(scene)
    assert result.called_for == NOTHING
    assert result.view_dependent == ()
    assert result.materials == {"matte": NOTHING}
    assert [finding.effect for finding in result.findings] == list(Effect)
    assert {finding.handling for finding in result.findings} == {NOT_CALLED_FOR}


# Shaders

GLOSSY_SHARP = Effect.GLOSSY | Effect.CAUSTICS
GLASS = Effect.GLOSSY | Effect.TRANSMISSION | Effect.CAUSTICS


@pytest.mark.parametrize(
    ("kind", "inputs", "effects"),
    [
        ("BsdfGlossy", {"Roughness": 0.5}, Effect.GLOSSY),
        ("BsdfGlossy", {"Roughness": 0.05}, GLOSSY_SHARP),
        ("BsdfGlossy", {"Color": (0.0, 0.0, 0.0, 1.0)}, NOTHING),
        ("BsdfMetallic", {}, Effect.GLOSSY),
        ("BsdfSheen", {}, Effect.GLOSSY),
        ("BsdfHair", {}, GLOSSY_SHARP),
        ("BsdfGlass", {}, GLASS),
        ("BsdfRefraction", {"Roughness": 0.5}, Effect.TRANSMISSION),
        ("BsdfTransparent", {}, Effect.ALPHA),
        ("BsdfTranslucent", {}, NOTHING),
        ("BsdfDiffuse", {"Roughness": 1.0}, Effect.GLOSSY),
        ("SubsurfaceScattering", {}, Effect.SUBSURFACE),
        ("Holdout", {}, Effect.CATCHER),
        ("Emission", {}, NOTHING),
        ("BsdfToon", {}, NOTHING),
    ],
)
def test_what_a_shader_calls_for(scene, kind, inputs, effects):
    assert worn(scene, shaded("a", kind, **inputs)) == effects


GREY, DARK = (0.6, 0.6, 0.6, 1.0), (0.1, 0.1, 0.1, 1.0)


@pytest.mark.parametrize(
    ("kind", "inputs", "may_mirror"),
    [
        ("BsdfGlossy", {"Color": GREY, "Roughness": 0.05}, True),
        ("BsdfGlossy", {"Color": GREY, "Roughness": 0.1}, True),
        ("BsdfGlossy", {"Color": GREY, "Roughness": 0.15}, False),
        ("BsdfGlossy", {"Color": DARK, "Roughness": 0.0}, False),
        ("BsdfGlossy", {"Color": (0.6, 0.0, 0.0, 1.0), "Roughness": 0.0}, True),
        ("BsdfMetallic", {"Base_Color": GREY, "Roughness": 0.0}, True),
        ("BsdfMetallic", {"Base_Color": GREY, "Roughness": 0.3}, False),
        ("BsdfMetallic", {"Base_Color": DARK, "Roughness": 0.0}, False),
        ("BsdfPrincipled", {"Metallic": 1.0, "Roughness": 0.1}, True),
        ("BsdfPrincipled", {"Metallic": 1.0, "Roughness": 0.2}, False),
        ("BsdfPrincipled", {"Metallic": 1.0, "Roughness": 0.0, "Base_Color": DARK}, False),
        ("BsdfPrincipled", {"Metallic": 0.1, "Roughness": 0.0}, False),
        ("BsdfPrincipled", {"Roughness": 0.0}, False),
        ("BsdfPrincipled", {"Roughness": 0.0, "Specular_IOR_Level": 1.0}, False),
        ("BsdfPrincipled", {"Roughness": 0.0, "Coat_Weight": 1.0}, False),
        ("BsdfPrincipled", {"Roughness": 0.0, "IOR": 10.0}, True),
        ("BsdfPrincipled", {"Roughness": 0.0, "Thin_Film_Thickness": 300.0}, True),
        ("BsdfPrincipled", {"Metallic": 0.9, "Roughness": 0.0, "Transmission_Weight": 0.5}, False),
        ("BsdfGlass", {"Roughness": 0.0}, False),
        ("BsdfSheen", {"Color": GREY, "Roughness": 0.0}, False),
        ("BsdfHair", {"Color": GREY}, False),
        ("BsdfDiffuse", {"Roughness": 1.0}, False),
    ],
)
def test_what_may_be_a_flat_mirror_reflects_much_and_smoothly_and_lets_nothing_through(scene, kind, inputs, may_mirror):
    thing = add_plane(scene, shaded("a", kind, **inputs), location=AHEAD)
    assert plan(scene).may_mirror == may_mirror
    thing.hide_render = True
    assert not plan(scene).may_mirror, "it cannot be seen"


@pytest.mark.parametrize("name", ["Base Color", "Roughness", "Metallic", "IOR"])
def test_an_input_that_is_fed_may_make_a_mirror(scene, name):
    values = {"Base Color": DARK, "Roughness": 0.5, "Metallic": 0.0, "IOR": 1.5}
    mirror = {"Base Color": GREY, "Roughness": 0.0, "Metallic": float(name != "IOR"), "IOR": 1.5}
    inputs = {key.replace(" ", "_"): value for key, value in {**mirror, name: values[name]}.items()}
    material = shaded("a", "BsdfPrincipled", **inputs)
    add_plane(scene, material, location=AHEAD)
    assert not plan(scene).may_mirror
    fed(material, name, "TexNoise")
    assert plan(scene).may_mirror


@pytest.mark.parametrize(("roughness", "may_mirror"), [(0.05, True), (0.5, False)])
def test_a_value_node_makes_a_mirror_as_the_value_does(scene, roughness, may_mirror):
    material = fed(shaded("a", "BsdfGlossy", Color=GREY), "Roughness", "Value")
    shader_of(material).inputs["Roughness"].links[0].from_node.outputs[0].default_value = roughness
    add_plane(scene, material, location=AHEAD)
    assert plan(scene).may_mirror == may_mirror


@pytest.mark.parametrize("colour", [DARK, (0.0, 0.0, 0.0, 1.0)])
def test_a_conductor_s_colour_is_in_its_refraction(scene, colour):
    material = shaded("a", "BsdfMetallic", Base_Color=colour, Roughness=0.0)
    add_plane(scene, material, location=AHEAD)
    assert not plan(scene).may_mirror
    shader_of(material).fresnel_type = "PHYSICAL_CONDUCTOR"
    assert plan(scene).may_mirror


@pytest.mark.parametrize(
    ("kind", "factor", "may_mirror"),
    [
        ("MixShader", 0.5, True),
        ("MixShader", 0.3, False),
        ("MixShader", None, True),
        ("AddShader", None, True),
    ],
)
def test_of_a_mirror_in_a_mix_counts_its_share(scene, kind, factor, may_mirror):
    """A factor of None is one from a texture."""
    material = Material("mixed")
    mix = material.node(kind)
    shaders = (material.node("BsdfDiffuse"), material.node("BsdfGlossy", Color=GREY, Roughness=0.0))
    sockets = [socket for socket in mix.inputs if socket.type == "SHADER"]
    for shader, socket in zip(shaders, sockets, strict=True):
        material.link(shader.outputs[0], socket)
    if factor is not None:
        mix.inputs[0].default_value = factor
    elif kind == "MixShader":
        material.link(material.node("TexNoise").outputs[0], mix.inputs[0])
    add_plane(scene, material.surface(mix), location=AHEAD)
    assert plan(scene).may_mirror == may_mirror


def test_eevee_s_reflections_are_not_looked_for(scene):
    add_plane(scene, shaded("a", "BsdfGlossy", Color=GREY, Roughness=0.0), location=AHEAD)
    assert plan(scene).may_mirror
    assert not plan(scene, source_engine="eevee").may_mirror


@pytest.mark.parametrize(
    ("inputs", "effects"),
    [
        ({}, NOTHING),
        ({"Specular_IOR_Level": 0.5}, Effect.GLOSSY),
        ({"Specular_IOR_Level": 0.5, "IOR": 1.0}, NOTHING),
        ({"Metallic": 1.0}, Effect.GLOSSY),
        ({"Coat_Weight": 0.5}, Effect.GLOSSY),
        ({"Sheen_Weight": 0.5}, Effect.GLOSSY),
        ({"Transmission_Weight": 1.0}, Effect.GLOSSY | Effect.TRANSMISSION),
        ({"Transmission_Weight": 1.0, "Metallic": 1.0}, Effect.GLOSSY),
        ({"Alpha": 0.5}, Effect.ALPHA),
        ({"Subsurface_Weight": 0.5}, Effect.SUBSURFACE),
        ({"Subsurface_Weight": 0.5, "Subsurface_Scale": 0.0}, NOTHING),
        ({"Diffuse_Roughness": 0.5}, Effect.GLOSSY),
        ({"Emission_Strength": 3.0}, NOTHING),
        ({"Metallic": 1.0, "Roughness": 0.1}, GLOSSY_SHARP),
    ],
)
def test_principled_counts_what_has_a_weight(scene, inputs, effects):
    assert worn(scene, matte(**inputs)) == effects


def test_an_input_that_is_fed_may_have_any_value(scene):
    assert worn(scene, fed(matte(), "Alpha", "TexNoise")) == Effect.ALPHA


def test_a_value_node_is_as_good_as_the_value(scene):
    material = fed(matte(Alpha=0.2), "Alpha", "Value")
    value = shader_of(material).inputs["Alpha"].links[0].from_node
    value.outputs[0].default_value = 1.0
    add_plane(scene, material, location=AHEAD)
    assert called_for(scene) == NOTHING
    value.outputs[0].default_value = 0.5
    assert called_for(scene) == Effect.ALPHA


@pytest.mark.parametrize(("operation", "effects"), [("MULTIPLY", NOTHING), ("ADD", Effect.GLOSSY)])
def test_a_texture_times_0_is_0(scene, operation, effects):
    """So glTF's importer leaves a metallic texture that does not count."""
    material = fed(matte(), "Metallic", "Math")
    math = shader_of(material).inputs["Metallic"].links[0].from_node
    math.operation, math.inputs[1].default_value = operation, 0.0
    material.link(material.node("TexNoise").outputs[0], math.inputs[0])
    assert worn(scene, material) == effects


def test_an_animated_value_counts_as_it_is_in_the_frame(scene):
    material = matte()
    add_plane(scene, material, location=AHEAD)
    keyframes_of_socket(material.tree, shader_of(material).inputs["Alpha"], {1: 1.0, 10: 0.5})
    assert plan(scene, frame=1).called_for == NOTHING
    assert plan(scene, frame=10).called_for == Effect.ALPHA


def keyframes_of_socket(tree, socket, values):
    for frame, value in values.items():
        socket.default_value = value
        socket.keyframe_insert("default_value", frame=frame)


# Node trees


def mixed(name, factor, first, second):
    material = Material(name)
    mix = material.node("MixShader")
    mix.inputs[0].default_value = factor
    for place, kind in ((1, first), (2, second)):
        material.link(material.node(kind).outputs[0], mix.inputs[place])
    return material.surface(mix)


@pytest.mark.parametrize(
    ("factor", "effects"),
    [(0.0, NOTHING), (0.5, Effect.ALPHA | Effect.SUBSURFACE), (1.0, Effect.ALPHA | Effect.SUBSURFACE)],
)
def test_of_a_mix_counts_what_shows(scene, factor, effects):
    outer = mixed("mixed", factor, "BsdfDiffuse", "BsdfDiffuse")
    inner = outer.node("AddShader")
    for place, kind in enumerate(("BsdfTransparent", "SubsurfaceScattering")):
        outer.link(outer.node(kind).outputs[0], inner.inputs[place])
    outer.link(inner.outputs[0], shader_of(outer).inputs[2])
    assert worn(scene, outer) == effects


def test_a_node_that_does_not_reach_the_output_does_not_count(scene):
    material = diffuse("plain")
    glossy, spare = material.node("BsdfGlossy"), material.node("OutputMaterial")
    material.link(glossy.outputs[0], spare.inputs["Surface"])
    material.output.is_active_output = True
    assert worn(scene, material) == NOTHING
    spare.is_active_output = True
    assert called_for(scene) == Effect.GLOSSY


def test_reroutes_and_muted_nodes_are_followed(scene):
    material = mixed("mixed", 0.5, "BsdfTransparent", "SubsurfaceScattering")
    mix = shader_of(material)
    reroute = material.tree.nodes.new("NodeReroute")
    material.link(mix.outputs[0], reroute.inputs[0])
    material.link(reroute.outputs[0], material.output.inputs["Surface"])
    add_plane(scene, material, location=AHEAD)
    assert called_for(scene) == Effect.ALPHA | Effect.SUBSURFACE
    mix.mute = True
    assert called_for(scene) == Effect.ALPHA


def test_a_muted_link_feeds_nothing(scene):
    material = fed(matte(), "Alpha", "TexNoise")
    shader_of(material).inputs["Alpha"].links[0].is_muted = True
    assert worn(scene, material) == NOTHING


def group_with_alpha():
    """A group that hands its input on to the alpha of the shader inside."""
    group = bpy.data.node_groups.new("inner", "ShaderNodeTree")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    group.interface.new_socket("Strength", in_out="INPUT", socket_type="NodeSocketFloat")
    shader = group.nodes.new("ShaderNodeBsdfPrincipled")
    shader.inputs["Specular IOR Level"].default_value = 0.0
    given, output = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    group.links.new(given.outputs[0], shader.inputs["Alpha"])
    group.links.new(shader.outputs[0], output.inputs[0])
    return group


def test_a_group_is_looked_into_and_given_its_inputs(scene):
    material = Material("grouped")
    node = material.node("Group")
    node.node_tree = group_with_alpha()
    node.inputs["Strength"].default_value = 1.0
    add_plane(scene, material.surface(node), location=AHEAD)
    assert called_for(scene) == NOTHING
    node.inputs["Strength"].default_value = 0.5
    assert called_for(scene) == Effect.ALPHA
    material.link(material.node("Fresnel").outputs[0], node.inputs["Strength"])
    assert called_for(scene) == Effect.ALPHA | Effect.CAMERA_DEPENDENT


def test_a_group_inside_a_group(scene):
    outer = bpy.data.node_groups.new("outer", "ShaderNodeTree")
    outer.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    inner, output = outer.nodes.new("ShaderNodeGroup"), outer.nodes.new("NodeGroupOutput")
    inner.node_tree = group_with_alpha()
    inner.inputs["Strength"].default_value = 0.5
    outer.links.new(inner.outputs[0], output.inputs[0])
    material = Material("grouped")
    node = material.node("Group")
    node.node_tree = outer
    assert worn(scene, material.surface(node)) == Effect.ALPHA


# What a shader knows of the camera


@pytest.mark.parametrize(
    ("kind", "output", "effects"),
    [
        ("LightPath", "Is Camera Ray", NOTHING),
        ("LightPath", "Is Shadow Ray", NOTHING),
        ("LightPath", "Is Glossy Ray", NOTHING),
        ("LightPath", "Ray Length", Effect.CAMERA_DEPENDENT),
        ("LightPath", "Transparent Depth", Effect.CAMERA_DEPENDENT),
        ("Fresnel", 0, Effect.CAMERA_DEPENDENT),
        ("LayerWeight", "Facing", Effect.CAMERA_DEPENDENT),
        ("CameraData", "View Z Depth", Effect.CAMERA_DEPENDENT),
        ("NewGeometry", "Incoming", Effect.CAMERA_DEPENDENT),
        ("NewGeometry", "Normal", NOTHING),
        ("TexCoord", "Camera", Effect.CAMERA_DEPENDENT),
        ("TexCoord", "Window", Effect.CAMERA_DEPENDENT),
        ("TexCoord", "Reflection", Effect.CAMERA_DEPENDENT),
        ("TexCoord", "Object", NOTHING),
    ],
)
def test_what_a_shader_is_told_of_the_camera(scene, kind, output, effects):
    """Through a texture, as it is usual; a camera ray is one for both eyes."""
    material = diffuse("telling")
    texture = material.node("TexNoise")
    material.link(material.node(kind).outputs[output], texture.inputs["Vector"])
    material.link(texture.outputs["Color"], shader_of(material).inputs["Color"])
    assert worn(scene, material) == effects


def test_a_script_may_know_everything(scene):
    assert worn(scene, fed_by_script()) == Effect.CAMERA_DEPENDENT


def fed_by_script():
    material = diffuse("scripted")
    script = material.node("Script")
    script.mode = "INTERNAL"
    script.outputs.new("NodeSocketColor", "Colour")
    material.link(script.outputs[0], shader_of(material).inputs["Color"])
    return material


def test_of_a_camera_ray_trick_counts_what_the_camera_sees(scene):
    """Glass that throws no shadow: what shadow rays see of it is nothing to either eye."""
    material = mixed("trick", 0.5, "BsdfGlass", "BsdfTransparent")
    material.link(material.node("LightPath").outputs["Is Shadow Ray"], shader_of(material).inputs[0])
    assert worn(scene, material) == GLASS


@pytest.mark.parametrize("name", ["Color", "Strength"])
def test_a_light_that_shines_as_it_is_seen(scene, name):
    material = fed(shaded("lamp", "Emission"), name, "LayerWeight")
    assert worn(scene, material) == Effect.CAMERA_DEPENDENT | Effect.DIRECTIONAL_EMISSION


def test_a_light_that_is_mixed_in_as_it_is_seen(scene):
    material = mixed("lamp", 0.5, "BsdfDiffuse", "Emission")
    material.link(material.node("Fresnel").outputs[0], shader_of(material).inputs[0])
    assert worn(scene, material) == Effect.CAMERA_DEPENDENT | Effect.DIRECTIONAL_EMISSION


def test_a_lamp_that_the_camera_sees_has_no_depth(scene):
    lamp = add(scene, bpy.data.objects.new("Bulb", bpy.data.lights.new("Bulb", "POINT")))
    lamp.location, lamp.visible_camera = AHEAD, False
    assert called_for(scene) == NOTHING
    lamp.visible_camera = True
    assert by(scene, Effect.DIRECTIONAL_EMISSION) == ("light 'Bulb'",)


# Bump and displacement


def with_bump(strength=1.0):
    material = diffuse("rough")
    bump = material.node("Bump", Strength=strength)
    material.link(material.node("TexNoise").outputs[0], next(s for s in bump.inputs if s.identifier == "Height"))
    material.link(bump.outputs[0], shader_of(material).inputs["Normal"])
    return material


def test_bump_is_called_for_and_needs_no_probe(scene):
    assert worn(scene, with_bump()) == Effect.BUMP
    assert plan(scene).view_dependent == ()


def test_bump_of_no_strength_is_none(scene):
    assert worn(scene, with_bump(strength=0.0)) == NOTHING


def displaced(method):
    material = diffuse("displaced")
    node = material.node("Displacement")
    material.link(material.node("TexNoise").outputs[0], node.inputs["Height"])
    material.link(node.outputs[0], material.output.inputs["Displacement"])
    material.block.displacement_method = method
    return material


def test_displacement_is_called_for(scene):
    assert worn(scene, displaced("BUMP")) == Effect.BUMP


def test_what_is_displaced_may_come_into_view(scene):
    for method, seen in (("BUMP", NOTHING), ("DISPLACEMENT", Effect.BUMP)):
        plane = add_plane(scene, displaced(method), location=(0.0, 0.0, 20.0))
        assert called_for(scene) == seen, method
        bpy.data.objects.remove(plane)


# Volumes


def world_output(scene):
    return next(node for node in scene.world.node_tree.nodes if node.bl_idname == "ShaderNodeOutputWorld")


def fill_the_air(scene, density=1.0):
    tree = scene.world.node_tree
    node = tree.nodes.new("ShaderNodeVolumeScatter")
    node.inputs["Density"].default_value = density
    tree.links.new(node.outputs[0], world_output(scene).inputs["Volume"])


def test_the_world_s_volume(scene):
    fill_the_air(scene)
    assert by(scene, Effect.VOLUME) == ("world 'World'",)


def test_a_volume_without_density_is_none(scene):
    fill_the_air(scene, density=0.0)
    assert called_for(scene) == NOTHING


def test_a_material_s_volume(scene):
    material = Material("fog")
    material.link(material.node("VolumePrincipled").outputs[0], material.output.inputs["Volume"])
    assert worn(scene, material) == Effect.VOLUME


def test_a_volume_object(scene):
    smoke = add(scene, bpy.data.objects.new("Smoke", bpy.data.volumes.new("Smoke")))
    smoke.location = AHEAD
    assert by(scene, Effect.VOLUME) == ("volume 'Smoke'",)


def test_a_world_that_knows_the_camera(scene):
    tree = scene.world.node_tree
    background = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBackground")
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], background.inputs["Color"])
    assert called_for(scene) == NOTHING
    tree.links.new(coordinates.outputs["Window"], background.inputs["Color"])
    assert by(scene, Effect.CAMERA_DEPENDENT) == ("world 'World'",)


# Hair


def test_hair_curves(scene):
    fur = add(scene, bpy.data.objects.new("Fur", strands()))
    fur.location = AHEAD
    assert by(scene, Effect.HAIR) == ("curves 'Fur'",)
    assert plan(scene).materials["default_surface"] == Effect.HAIR


def strands():
    curves = bpy.data.hair_curves.new("Fur")
    curves.add_curves([2])
    curves.attributes["position"].data.foreach_set("vector", [0.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    return curves


def test_particle_hair_and_its_material(scene):
    wall = scene.objects["Wall"]
    wall.data.materials.append(diffuse("fur").block)
    system = wall.modifiers.new("Hair", "PARTICLE_SYSTEM").particle_system.settings
    system.type, system.count, system.material = "HAIR", 4, 2
    assert by(scene, Effect.HAIR) == ("hair on 'Wall'",)
    assert plan(scene).materials == {"matte": NOTHING, "fur": Effect.HAIR}
    system.render_type = "NONE"
    assert called_for(scene) == NOTHING


# Lens and shutter


def test_depth_of_field(scene):
    camera = scene.camera.data
    camera.dof.aperture_fstop = 2.8
    assert called_for(scene) == NOTHING
    camera.dof.use_dof = True
    assert by(scene, Effect.DEPTH_OF_FIELD) == ("the camera's aperture, f/2.8",)


def test_motion_blur_only_of_what_moves(scene):
    scene.render.use_motion_blur = True
    assert called_for(scene) == NOTHING
    keyframes(scene.objects["Wall"], "location", {1: (0.0, 0.0, -8.0), 10: (1.0, 0.0, -8.0)})
    assert by(scene, Effect.MOTION_BLUR) == ("mesh 'Wall'",)
    scene.render.use_motion_blur = False
    assert called_for(scene) == NOTHING


def test_what_moves_within_instances_of_collections_blurs(scene):
    """Two deep, and also where only a parent moves that is in no collection of the scene."""
    scene.render.use_motion_blur = True
    inner, outer = (bpy.data.collections.new(name) for name in ("Inner", "Outer"))
    wheel = add_plane(scene, diffuse("wheel"))
    wheel.name = "Wheel"
    scene.collection.objects.unlink(wheel)
    inner.objects.link(wheel)
    for name, shown, owner in (("Axle", inner, outer), ("Car", outer, scene.collection)):
        empty = bpy.data.objects.new(name, None)
        empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", shown, AHEAD
        owner.objects.link(empty)
    assert called_for(scene) == NOTHING
    keyframes(wheel, "location", {1: (0.0, 0.0, 0.0), 10: (1.0, 0.0, 0.0)})
    assert by(scene, Effect.MOTION_BLUR) == ("mesh 'Wheel'",)
    wheel.animation_data_clear()
    wheel.parent = bpy.data.objects.new("Crane", None)
    assert called_for(scene) == NOTHING
    keyframes(wheel.parent, "location", {1: (0.0, 0.0, 0.0), 10: (1.0, 0.0, 0.0)})
    assert by(scene, Effect.MOTION_BLUR) == ("empty 'Crane'",)


def test_a_camera_that_moves_blurs(scene):
    scene.render.use_motion_blur = True
    keyframes(scene.camera, "location", {1: (0.0, 0.0, 0.0), 10: (1.0, 0.0, 0.0)})
    assert by(scene, Effect.MOTION_BLUR) == ("the camera",)


# Catchers and holdouts


@pytest.mark.parametrize("flag", ["is_shadow_catcher", "is_holdout"])
def test_catchers_and_holdouts(scene, flag):
    setattr(scene.objects["Wall"], flag, True)
    assert by(scene, Effect.CATCHER) == ("mesh 'Wall'",)
    assert plan(scene).materials["matte"] == Effect.CATCHER


def test_a_collection_that_is_held_out(scene):
    collection = bpy.data.collections.new("masks")
    scene.collection.children.link(collection)
    card = add_plane(scene, diffuse("card"), location=AHEAD)
    scene.collection.objects.unlink(card)
    collection.objects.link(card)
    assert called_for(scene) == NOTHING
    scene.view_layers[0].layer_collection.children["masks"].holdout = True
    assert by(scene, Effect.CATCHER) == ("mesh 'Plane'",)


# Caustics


def test_caustics_that_are_switched_off(scene):
    add_plane(scene, shaded("glass", "BsdfGlass"), location=AHEAD)
    assert by(scene, Effect.CAUSTICS) == ("material 'glass' on 'Plane'",)
    scene.cycles.caustics_reflective = scene.cycles.caustics_refractive = False
    assert by(scene, Effect.CAUSTICS) == ()


def test_shadow_caustics(scene):
    scene.objects["Sun"].data.cycles.is_caustics_light = True
    assert by(scene, Effect.CAUSTICS) == ("light 'Sun'",)


# What the user's settings ask for


def test_view_layers_and_denoising_are_the_user_s(scene):
    scene.view_layers.new("Backdrop")
    scene.cycles.use_denoising = True
    assert by(scene, Effect.VIEW_LAYERS) == ("view layer 'Backdrop'",)
    assert len(by(scene, Effect.DENOISING)) == 1
    assert plan(scene).view_dependent == ()
    scene.view_layers["Backdrop"].use = scene.cycles.use_denoising = False
    assert called_for(scene) == NOTHING


def test_how_each_effect_is_handled(scene):
    scene.cycles.use_denoising = True
    add_plane(scene, shaded("polished", "BsdfGlossy"), location=AHEAD)
    told = {finding.effect: finding.handling for finding in plan(scene).findings}
    assert told[Effect.GLOSSY] == HANDLING[Effect.GLOSSY]
    assert told[Effect.HAIR] == NOT_CALLED_FOR
    scene.render.engine = "BLENDER_EEVEE_NEXT" if bpy.app.version < (5, 0) else "BLENDER_EEVEE"
    told = {finding.effect: finding.handling for finding in plan(scene).findings}
    assert told[Effect.GLOSSY] == EEVEE_HANDLING


# Materials without nodes


def test_a_material_without_nodes_is_diffuse_in_cycles(scene):
    """From 5.0 on every material has them: then it is one in which they are all deleted."""
    material = bpy.data.materials.new("bare")
    material.metallic = 1.0
    if material.node_tree is not None:
        material.node_tree.nodes.clear()
    scene.objects["Wall"].data.materials[0] = material
    assert called_for(scene) == NOTHING


# What the cameras can see

GLOSSY = ("material 'polished' on 'Plane'",)


def polished(scene, location, **options):
    return add_plane(scene, shaded("polished", "BsdfGlossy"), location=location, **options)


@pytest.mark.parametrize(
    ("location", "seen"),
    [
        ((0.0, 0.0, -5.0), True),
        ((0.0, 0.0, 5.0), False),
        ((9.0, 0.0, -5.0), False),
        ((0.0, -9.0, -5.0), False),
        ((0.0, 0.0, -2000.0), False),
        ((3.4, 0.0, -5.0), True),
    ],
    ids=["ahead", "behind", "beside", "below", "beyond the clip end", "at the edge"],
)
def test_what_is_out_of_view_does_not_count(scene, location, seen):
    polished(scene, location)
    assert by(scene, Effect.GLOSSY) == (GLOSSY if seen else ())


def test_what_only_the_other_eye_sees_counts(scene):
    scene.camera.data.stereo.interocular_distance = 8.0
    scene.camera.data.stereo.convergence_mode = "PARALLEL"
    polished(scene, (9.0, 0.0, -5.0))
    assert by(scene, Effect.GLOSSY) == GLOSSY


def test_a_wide_lens_sees_around_the_corner(scene):
    polished(scene, (3.9, 0.0, -5.0))
    assert by(scene, Effect.GLOSSY) == ()
    dof = scene.camera.data.dof
    dof.use_dof, dof.aperture_fstop, dof.focus_distance = True, 0.1, 1.0
    scene.camera.data.lens = 35.0
    assert by(scene, Effect.GLOSSY) == GLOSSY


def test_what_may_move_into_view_counts(scene):
    plane = polished(scene, (9.0, 0.0, -5.0))
    keyframes(plane, "location", {1: (9.0, 0.0, -5.0), 2: (0.0, 0.0, -5.0)})
    assert by(scene, Effect.GLOSSY) == ()
    scene.render.use_motion_blur = True
    assert by(scene, Effect.GLOSSY) == GLOSSY


@pytest.mark.parametrize("switch", ["hide_render", "visible_camera"])
def test_what_is_hidden_does_not_count(scene, switch):
    setattr(polished(scene, AHEAD), switch, switch == "hide_render")
    assert by(scene, Effect.GLOSSY) == ()


@pytest.mark.parametrize("how", ["collection hidden", "collection excluded", "indirect only"])
def test_what_the_view_layer_leaves_out_does_not_count(scene, how):
    collection = bpy.data.collections.new("aside")
    scene.collection.children.link(collection)
    plane = polished(scene, AHEAD)
    scene.collection.objects.unlink(plane)
    collection.objects.link(plane)
    assert by(scene, Effect.GLOSSY) == GLOSSY
    in_layer = scene.view_layers[0].layer_collection.children["aside"]
    if how == "collection hidden":
        collection.hide_render = True
    else:
        setattr(in_layer, "exclude" if how == "collection excluded" else "indirect_only", True)
    assert by(scene, Effect.GLOSSY) == ()


def test_what_only_the_viewport_hides_counts(scene):
    """In doubt, wherever it is: the viewport's scene does not have it."""
    polished(scene, AHEAD).hide_viewport = True
    assert by(scene, Effect.GLOSSY) == GLOSSY


def test_an_unused_slot_does_not_count(scene):
    wall = scene.objects["Wall"]
    wall.data.materials.append(shaded("polished", "BsdfGlossy").block)
    assert called_for(scene) == NOTHING
    wall.data.polygons[0].material_index = 1
    assert by(scene, Effect.GLOSSY) == ("material 'polished' on 'Wall'",)


def test_a_slot_of_the_object_wins(scene):
    wall = scene.objects["Wall"]
    wall.material_slots[0].link = "OBJECT"
    wall.material_slots[0].material = shaded("polished", "BsdfGlossy").block
    assert by(scene, Effect.GLOSSY) == ("material 'polished' on 'Wall'",)


def test_a_material_override_wears_all(scene):
    scene.view_layers[0].material_override = shaded("clay", "BsdfGlossy").block
    assert by(scene, Effect.GLOSSY) == ("material 'clay' on 'Wall'",)


def hidden_collection(scene):
    """A polished cube in a collection that is in no scene."""
    collection = bpy.data.collections.new("hidden away")
    cube = add_cube(scene, shaded("polished", "BsdfGlossy"), location=(0.0, 0.0, 0.0))
    scene.collection.objects.unlink(cube)
    collection.objects.link(cube)
    return collection


def test_an_instance_counts_where_it_stands(scene):
    empty = add(scene, bpy.data.objects.new("instance", None))
    empty.instance_type, empty.instance_collection = "COLLECTION", hidden_collection(scene)
    empty.location = (0.0, 0.0, 5.0)
    assert by(scene, Effect.GLOSSY) == ()
    empty.location = AHEAD
    assert by(scene, Effect.GLOSSY) == ("material 'polished' on 'Cube'",)
    empty.hide_render = True
    assert by(scene, Effect.GLOSSY) == ()


def test_an_instance_of_an_instance_counts(scene):
    collection = bpy.data.collections.new("outer")
    inner = bpy.data.objects.new("inner", None)
    inner.instance_type, inner.instance_collection = "COLLECTION", hidden_collection(scene)
    collection.objects.link(inner)
    outer = add(scene, bpy.data.objects.new("outer", None))
    outer.instance_type, outer.instance_collection = "COLLECTION", collection
    outer.location = (0.0, 0.0, 5.0)
    assert by(scene, Effect.GLOSSY) == ()
    outer.location = AHEAD
    assert by(scene, Effect.GLOSSY) == ("material 'polished' on 'Cube'",)
    outer.hide_viewport = True
    assert by(scene, Effect.GLOSSY) == ("material 'polished' on 'Cube'",)


def scattering_group(collection):
    """Geometry nodes that put the collection in the place of what they are given."""
    group = bpy.data.node_groups.new("scatter", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    info, output = group.nodes.new("GeometryNodeCollectionInfo"), group.nodes.new("NodeGroupOutput")
    info.inputs["Collection"].default_value = collection
    group.links.new(info.outputs[0], output.inputs[0])
    return group


def test_instances_of_geometry_nodes_count(scene):
    wall = scene.objects["Wall"]
    modifier = wall.modifiers.new("scatter", "NODES")
    modifier.node_group = scattering_group(hidden_collection(scene))
    assert by(scene, Effect.GLOSSY) == ("material 'polished' on 'Cube'",)
    assert "matte" not in plan(scene).materials


def test_nodes_that_only_the_render_runs_may_bring_anything(scene):
    modifier = scene.objects["Wall"].modifiers.new("scatter", "NODES")
    modifier.node_group = scattering_group(hidden_collection(scene))
    modifier.show_viewport = False
    assert by(scene, Effect.GLOSSY) == ("material 'polished' on 'Wall'",)


def test_particles_that_are_objects_count(scene):
    wall = scene.objects["Wall"]
    cube = hidden_collection(scene).objects[0]
    system = wall.modifiers.new("Hair", "PARTICLE_SYSTEM").particle_system.settings
    system.type, system.count = "HAIR", 4
    system.render_type, system.instance_object = "OBJECT", cube
    assert by(scene, Effect.GLOSSY) == ("material 'polished' on 'Cube'",)
    wall.modifiers["Hair"].show_viewport = False
    assert by(scene, Effect.GLOSSY) == ("material 'polished' on 'Cube'",)


def test_all_that_call_for_an_effect_are_named_each_material_once_first(scene):
    for name in ("rare", "common", "common"):
        material = bpy.data.materials.get(name) or shaded(name, "BsdfGlossy").block
        plane = polished(scene, AHEAD)
        plane.data.materials[0] = material
        plane.name = name
    first, second, third = by(scene, Effect.GLOSSY)
    assert {first, second} == {"material 'rare' on 'rare'", "material 'common' on 'common'"}
    assert third == "material 'common' on 'common.001'"


# Scenes that others made


@pytest.mark.parametrize(
    ("name", "calls_for", "not_for"),
    [
        ("cornell-box", NOTHING, ~Effect.DENOISING),
        ("bathroom", Effect.GLOSSY | Effect.CAUSTICS, Effect.VOLUME | Effect.HAIR | Effect.DEPTH_OF_FIELD),
        ("volumetric-caustic", Effect.VOLUME | Effect.TRANSMISSION, Effect.HAIR),
        ("fur-ball", Effect.HAIR, Effect.VOLUME | Effect.ALPHA),
        ("bmw27", Effect.DEPTH_OF_FIELD | Effect.BUMP | Effect.CAMERA_DEPENDENT, Effect.HAIR | Effect.MOTION_BLUR),
        ("meadow", Effect.ALPHA, Effect.HAIR | Effect.VOLUME),
        ("broken-window", Effect.TRANSMISSION, Effect.VOLUME),
    ],
)
def test_a_scene_that_others_made(shared_scenes, name, calls_for, not_for):
    found = called_for(open_blend(shared_scenes / name / f"{name}.blend"))
    assert found & calls_for == calls_for
    assert found & not_for == NOTHING
