"""A small scene with something of each kind that a scene is made of."""

import bpy

from stereo_reproject.blender.scene.working import open_blend
from tests.blender.toolbox import (
    Material,
    add,
    add_camera,
    add_cube,
    add_plane,
    add_sun,
    diffuse,
    empty_compositor,
    empty_scene,
    keyframes,
    noise_image,
)


def object_of(scene, name, data, **place):
    item = add(scene, bpy.data.objects.new(name, data))
    for prop, value in place.items():
        setattr(item, prop, value)
    return item


def add_mesh_with_everything(scene, material):
    cube = add_cube(scene, material, location=(0.0, 0.0, -6.0))
    cube.name = cube.data.name = "Cube"
    cube.vertex_groups.new(name="Group").add([0, 1], 0.5, "REPLACE")
    cube.shape_key_add(name="Basis")
    cube.shape_key_add(name="Key").value = 0.5
    cube.modifiers.new("Subdivision", "SUBSURF")
    cube.constraints.new("COPY_LOCATION").influence = 0.0
    cube["custom"] = 1.0
    cube.data.polygons[0].material_index = 0  # there is no list of them before the first is set
    return cube


def add_curves(scene):
    curve = bpy.data.curves.new("Curve", "CURVE")
    curve.splines.new("POLY").points.add(2)
    curve.splines.new("BEZIER").bezier_points.add(1)
    object_of(scene, "Curve", curve)
    text = bpy.data.curves.new("Words", "FONT")
    text.body = "words"
    object_of(scene, "Words", text)
    ball = bpy.data.metaballs.new("Ball")
    ball.elements.new()
    object_of(scene, "Ball", ball)
    object_of(scene, "Lattice", bpy.data.lattices.new("Lattice"))
    hair = bpy.data.hair_curves.new("Hair")
    hair.add_curves([3, 2])
    object_of(scene, "Hair", hair)


def add_armature(scene):
    armature = object_of(scene, "Armature", bpy.data.armatures.new("Armature"))
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    bone = armature.data.edit_bones.new("Bone")
    bone.tail = (0.0, 0.0, 1.0)
    bpy.ops.object.mode_set(mode="OBJECT")
    armature.pose.bones["Bone"].constraints.new("LIMIT_ROTATION")


def add_geometry_nodes(item):
    tree = bpy.data.node_groups.new("Geometry", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Size", in_out="INPUT", socket_type="NodeSocketFloat")
    tree.interface.new_socket("Which", in_out="INPUT", socket_type="NodeSocketObject")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    ends = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    tree.links.new(ends[0].outputs[0], ends[1].inputs[0])
    item.modifiers.new("Nodes", "NODES").node_group = tree


def geometry_input(scene, name):
    """The struct and the property of an input of the geometry nodes, which Blender 5 gives a type."""
    modifier = scene.objects["Plane"].modifiers["Nodes"]
    interface = modifier.node_group.interface.items_tree
    identifier = next(item.identifier for item in interface if item.name == name)
    if bpy.app.version < (5, 0):
        return modifier, identifier
    return getattr(modifier.properties.inputs, identifier), "value"


def add_nested_groups(material):
    inner, outer = (bpy.data.node_groups.new(name, "ShaderNodeTree") for name in ("Inner", "Outer"))
    inner.nodes.new("ShaderNodeValue").name = "Value"
    outer.nodes.new("ShaderNodeGroup").node_tree = inner
    material.node("Group").node_tree = outer


def add_animation(scene):
    sun = add_sun(scene)
    keyframes(sun, "location", {1: (0.0, 0.0, 0.0), 40: (1.0, 2.0, 3.0)})
    keyframes(sun.data, "energy", {1: 1.0, 40: 3.0})
    driver = sun.driver_add("rotation_euler", 0).driver
    driver.expression = "frame * 0.01"
    track = scene.camera.animation_data_create().nla_tracks.new()
    keyframes(scene.camera, "scale", {1: (1.0, 1.0, 1.0), 40: (2.0, 1.0, 1.0)})
    action, slot = scene.camera.animation_data.action, scene.camera.animation_data.action_slot
    scene.camera.animation_data.action = None
    track.strips.new("Strip", 1, action).action_slot = slot
    scene.objects["Cube"].data.shape_keys.key_blocks["Key"].keyframe_insert("slider_max", frame=1)


def scene_with_everything(folder):
    """Something of each kind that a scene is made of, saved to scene.blend there with a file beside it, and loaded."""
    scene = empty_scene(32, 18)
    add_camera(scene)
    textures = folder / "textures"
    textures.mkdir()
    material = diffuse("textured", image=noise_image(textures))
    packed = noise_image(textures, seed=2, name="packed")
    packed.pack()
    material.node("TexImage").image = packed
    generated = bpy.data.images.new("generated", 8, 8)
    material.node("TexImage").image = generated
    material.node("ValToRGB").name = "Ramp"
    add_nested_groups(material)
    text = bpy.data.texts.new("lamp.ies")
    text.write("IESNA\n")
    material.node("TexIES").ies = text
    add_mesh_with_everything(scene, material)
    plane = add_plane(scene, Material("wall"), size=(20, 20), location=(0, 0, -9))
    plane.name = "Plane"
    add_geometry_nodes(plane)
    plane.modifiers.new("Hair", "PARTICLE_SYSTEM")
    add_curves(scene)
    add_armature(scene)
    add_animation(scene)
    inside = bpy.data.collections.new("Inside")
    inside.objects.link(bpy.data.objects.new("Instanced", plane.data.copy()))
    holder = object_of(scene, "Holder", None)
    holder.instance_type, holder.instance_collection = "COLLECTION", inside
    scene.collection.children.link(bpy.data.collections.new("Child"))
    tree, _ = empty_compositor(scene)
    tree.nodes.new("CompositorNodeBlur").name = "Blur"
    scene.timeline_markers.new("Cut", frame=5).camera = scene.camera
    scene.view_layers.new("Second")
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"), check_existing=False)
    bpy.ops.file.make_paths_relative()
    bpy.ops.wm.save_mainfile()
    return open_blend(folder / "scene.blend")


def tree_of(name="textured"):
    return bpy.data.materials[name].node_tree


def node(kind):
    return next(node for node in tree_of().nodes if node.bl_idname == f"ShaderNode{kind}")
