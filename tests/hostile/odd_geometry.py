"""Makers of scenes with odd geometry, instances, drivers and lamps.

Where no exit status is named a pair must come of it: Blender renders such a scene too. What is odd about a scene is
said in the case's name, and so the makers have none.
"""

from __future__ import annotations

import math

import bpy

from tests.blender.toolbox import add
from tests.hostile.blends import DONE, EITHER, odd, several
from tests.hostile.small_scenes import HUGE, INFINITE, NAN, add_mesh, drive

# Geometry


@several("a vertex at", [NAN, INFINITE, -INFINITE, HUGE, 3.4e38])
def _(scene, where):
    scene.objects["Cube"].data.vertices[0].co = (where, 0.0, 0.0)


@several("all vertices at", [NAN, INFINITE])
def _(scene, where):
    mesh = scene.objects["Cube"].data
    mesh.vertices.foreach_set("co", [where] * 3 * len(mesh.vertices))


@several("an object at", [NAN, HUGE, 1e20])
def _(scene, where):
    scene.objects["Cube"].location.x = where


@several("an object's scale", [0.0, NAN, HUGE, -1.0, 1e-30])
def _(scene, scale):
    scene.objects["Cube"].scale = (scale, 1.0, 1.0)


@odd("meshes of nothing, of a vertex, of an edge, of faces without area")
def _(scene):
    add_mesh(scene, [])
    add_mesh(scene, [(0.0, 0.0, -4.0)])
    add_mesh(scene, [(0.0, 0.0, -4.0), (1.0, 0.0, -4.0)], [(0, 1)])
    add_mesh(scene, [(0.0, 0.0, -4.0)] * 4, faces=[(0, 1, 2, 3)])
    add_mesh(scene, [(0.0, 0.0, -4.0), (1.0, 0.0, -4.0), (2.0, 0.0, -4.0)], faces=[(0, 1, 2)])


@odd("faces whose corners are one vertex")
def _(scene):
    add_mesh(scene, [(0.0, 0.0, -4.0), (1.0, 0.0, -4.0), (1.0, 1.0, -4.0)], faces=[(0, 0, 0), (0, 1, 1), (0, 1, 2)])


@odd("a face with a thousand corners, folded over")
def _(scene):
    corners = [(math.sin(7.0 * k), math.cos(11.0 * k), -4.0) for k in range(1000)]
    add_mesh(scene, corners, faces=[tuple(range(1000))])


@odd("normals of NaN", EITHER)
def _(scene):
    mesh = scene.objects["Cube"].data
    mesh.normals_split_custom_set([(NAN, NAN, NAN)] * len(mesh.loops))


@odd("texture coordinates of NaN")
def _(scene):
    mesh = scene.objects["Cube"].data
    mesh.uv_layers[0].data.foreach_set("uv", [NAN] * 2 * len(mesh.loops))


@odd("a material slot without a material, and a face of a slot that is not there")
def _(scene):
    mesh = scene.objects["Cube"].data
    mesh.materials.append(None)
    mesh.polygons[0].material_index = 1
    mesh.polygons[1].material_index = 30000


@odd("five collections, each an instance in the next")
def _(scene):
    inner = bpy.data.collections.new("0")
    scene.collection.objects.unlink(scene.objects["Cube"])
    inner.objects.link(bpy.data.objects["Cube"])
    for level in range(5):
        instance = bpy.data.objects.new(f"Instance {level}", None)
        instance.instance_type, instance.instance_collection = "COLLECTION", inner
        inner = bpy.data.collections.new(str(level + 1))
        inner.objects.link(instance)
        again = instance.copy()
        again.location.x = 0.5
        inner.objects.link(again)
    scene.collection.children.link(inner)


@odd("an instance of the collection that it is in", EITHER)
def _(scene):
    collection = bpy.data.collections.new("Loop")
    scene.collection.children.link(collection)
    instance = bpy.data.objects.new("Instance", None)
    collection.objects.link(instance)
    instance.instance_type = "COLLECTION"
    instance.instance_collection = collection


@odd("instances on vertices and faces, without a scale")
def _(scene):
    wall = scene.objects["Plane"]
    scene.objects["Cube"].parent = wall
    wall.instance_type = "FACES"
    wall.use_instance_faces_scale = True
    wall.instance_faces_scale = 0.0


@odd("objects that are constrained to each other in a circle")
def _(scene):
    first, second = scene.objects["Cube"], scene.objects["Plane"]
    for item, target in ((first, second), (second, first)):
        item.constraints.new("COPY_LOCATION").target = target


@odd("the camera tracks an object that is its child")
def _(scene):
    scene.objects["Cube"].parent = scene.camera
    constraint = scene.camera.constraints.new("TRACK_TO")
    constraint.target = scene.objects["Cube"]
    constraint.track_axis, constraint.up_axis = "TRACK_NEGATIVE_Z", "UP_Y"


@odd("drivers in a circle")
def _(scene):
    first, second = scene.objects["Cube"], scene.objects["Plane"]
    drive(first, "location", "value + 1", index=0, target=second, target_path="location.x")
    drive(second, "location", "value + 1", index=0, target=first, target_path="location.x")


@several("a driver that says", ["1/0", "nothing_known", "float('nan')", "1e400", "(", "''"], EITHER)
def _(scene, expression):
    drive(scene.camera, "location", expression, index=0)


@odd("a driver of a property that is not there, with a target that is not there")
def _(scene):
    curve = drive(scene.objects["Cube"], "location", "value", index=1)
    curve.data_path = "no_such_property"
    curve.driver.variables.new()


@odd("the stereo setting driven by NaN", EITHER)
def _(scene):
    drive(scene.camera.data, "stereo.interocular_distance", "sqrt(-1 * frame)")


@odd("hair without a strand, and hair of none")
def _(scene):
    scene.objects["Cube"].modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = scene.objects["Cube"].particle_systems[0].settings
    settings.type, settings.count = "HAIR", 0
    add(scene, bpy.data.objects.new("Curves", bpy.data.hair_curves.new("Curves")))


@several("hair as thick as", [0.0, 1e6])
def _(scene, radius):
    scene.objects["Cube"].modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = scene.objects["Cube"].particle_systems[0].settings
    settings.type, settings.count, settings.root_radius = "HAIR", 20, radius


@odd("particles that show the object that sends them out", EITHER)
def _(scene):
    cube = scene.objects["Cube"]
    cube.modifiers.new("Dust", "PARTICLE_SYSTEM")
    settings = cube.particle_systems[0].settings
    settings.render_type, settings.instance_object, settings.count = "OBJECT", cube, 10


@odd("an empty point cloud and a volume without its file", EITHER)
def _(scene):
    add(scene, bpy.data.objects.new("Points", bpy.data.pointclouds.new("Points")))
    volume = bpy.data.volumes.new("Smoke")
    volume.filepath = "//gone.vdb"
    add(scene, bpy.data.objects.new("Smoke", volume))


@odd("modifiers that point at nothing, and at one that is hidden")
def _(scene):
    cube = scene.objects["Cube"]
    for kind in ("BOOLEAN", "ARRAY", "SHRINKWRAP", "HOOK", "LATTICE", "NODES", "MESH_DEFORM", "DATA_TRANSFER"):
        cube.modifiers.new(kind, kind)
    cube.modifiers.new("Screw", "SCREW").object = scene.objects["Plane"]


@odd("geometry nodes in an endless group of nothing", EITHER)
def _(scene):
    tree = bpy.data.node_groups.new("Geometry", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    tree.nodes.new("NodeGroupOutput")
    tree.nodes.new("GeometryNodeGroup")
    scene.objects["Cube"].modifiers.new("Nodes", "NODES").node_group = tree


@odd("shape keys that drive each other, of NaN")
def _(scene):
    cube = scene.objects["Cube"]
    cube.shape_key_add(name="Basis")
    key = cube.shape_key_add(name="Odd")
    key.data[0].co = (NAN, NAN, NAN)
    key.value = 1.0


@odd("subdivision as deep as it goes, simplified to none")
def _(scene):
    modifier = scene.objects["Cube"].modifiers.new("Subdivision", "SUBSURF")
    modifier.render_levels = 11
    scene.render.use_simplify = True
    scene.render.simplify_subdivision_render = 0


@odd("simulations that are not baked", DONE, "not baked")
def _(scene):
    scene.objects["Cube"].modifiers.new("Cloth", "CLOTH")
    bpy.context.view_layer.objects.active = scene.objects["Plane"]
    scene.objects["Plane"].modifiers.new("Soft", "SOFT_BODY")


# Light


@several("a lamp's power", [0.0, -10.0, 1e30, NAN, INFINITE])
def _(scene, power):
    scene.objects["Sun"].data.energy = power


@several("a lamp of no size", ["POINT", "SPOT", "AREA", "SUN"])
def _(scene, kind):
    lamp = bpy.data.lights.new("Tiny", kind)
    lamp.energy = 10.0
    if kind == "AREA":
        lamp.shape = "RECTANGLE"
        lamp.size = lamp.size_y = 0.0
    elif kind == "SUN":
        lamp.angle = 0.0
    else:
        lamp.shadow_soft_size = 0.0
    if kind == "SPOT":
        lamp.spot_size, lamp.spot_blend = 0.0, 0.0
    add(scene, bpy.data.objects.new("Tiny", lamp)).location = (1.0, 1.0, -3.0)


@odd("a lamp's colour is negative")
def _(scene):
    scene.objects["Sun"].data.color = (-1.0, 2.0, -3.0)


@odd("forty lamps in one place, in light groups that are not there")
def _(scene):
    for number in range(40):
        lamp = bpy.data.lights.new("Lamp", "POINT")
        item = add(scene, bpy.data.objects.new("Lamp", lamp))
        item.lightgroup = f"group {number}"


@odd("light linking to an empty collection")
def _(scene):
    lamp = scene.objects["Sun"]
    lamp.light_linking.receiver_collection = bpy.data.collections.new("Nobody")
    lamp.light_linking.blocker_collection = bpy.data.collections.new("Nothing")
