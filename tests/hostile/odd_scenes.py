"""Makers of odd scenes. Each gets a small scene that renders, makes one thing of it odd, and says how a run must end.

Where nothing is said a pair must come of it: Blender renders such a scene too.
"""

# What is odd about a scene is said in the case's name; a function's name would only repeat it.
# ruff: noqa: ANN001, ANN202, D103

from __future__ import annotations

import math
import struct

import bpy

from tests.blender.toolbox import (
    Material,
    add,
    add_compositor,
    add_cube,
    add_plane,
    add_sphere,
    diffuse,
    emission,
    keyframes,
    set_border,
)
from tests.hostile.blends import DONE, EITHER, REFUSED, NotInThisBlenderError, odd

NAN, INFINITE, HUGE = math.nan, math.inf, 1e30
MODERN = bpy.app.version >= (5, 0)


def material(scene) -> Material:
    """A new material on the cube."""
    made = Material("odd")
    scene.objects["Cube"].data.materials[0] = made.block
    return made


def broken_number(made: Material, kind: str):
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


def mesh_of(scene, vertices, edges=(), faces=()):
    mesh = bpy.data.meshes.new("Odd")
    mesh.from_pydata(vertices, list(edges), list(faces))
    return add(scene, bpy.data.objects.new("Odd", mesh))


def several(name, values, statuses=DONE, *words, **more):
    """Cases that differ in a value alone: the maker gets the scene and the value."""

    def register(maker):
        for value in values:
            odd(f"{name}: {value}", statuses, *words, **more)(lambda scene, value=value: maker(scene, value))
        return maker

    return register


# Nothing there


@odd("no objects at all, no camera", REFUSED, "camera")
def _(scene):
    for item in list(scene.objects):
        bpy.data.objects.remove(item)


@odd("a camera and nothing else")
def _(scene):
    for item in list(scene.objects):
        if item.type != "CAMERA":
            bpy.data.objects.remove(item)


@odd("a camera and a world of a texture")
def _(scene):
    for item in list(scene.objects):
        if item.type != "CAMERA":
            bpy.data.objects.remove(item)
    tree = scene.world.node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    tree.links.new(sky.outputs[0], tree.nodes["Background"].inputs[0])


@odd("no world")
def _(scene):
    scene.world = None


@odd("a world without nodes in its tree")
def _(scene):
    scene.world.node_tree.nodes.clear()


@odd("everything is hidden in renders")
def _(scene):
    for item in scene.objects:
        item.hide_render = item.type != "CAMERA"


@odd("the camera is hidden in renders")
def _(scene):
    scene.camera.hide_render = True


@odd("all collections are excluded", EITHER)
def _(scene):
    collection = bpy.data.collections.new("All")
    scene.collection.children.link(collection)
    for item in list(scene.objects):
        scene.collection.objects.unlink(item)
        collection.objects.link(item)
    scene.view_layers[0].layer_collection.children[0].exclude = True


@odd("the camera is in no collection of the scene")
def _(scene):
    camera = scene.camera
    scene.collection.objects.unlink(camera)
    scene.camera = camera


@several("the scene's camera is no camera", ["Cube", "Sun"], EITHER)
def _(scene, name):
    scene.camera = scene.objects[name]


@odd("the scene's camera is an empty", EITHER)
def _(scene):
    scene.camera = add(scene, bpy.data.objects.new("Nothing", None))


@odd("an empty text, a metaball, a lattice, a speaker, an armature")
def _(scene):
    add(scene, bpy.data.objects.new("Text", bpy.data.curves.new("Text", "FONT")))
    add(scene, bpy.data.objects.new("Ball", bpy.data.metaballs.new("Ball")))
    add(scene, bpy.data.objects.new("Lattice", bpy.data.lattices.new("Lattice")))
    add(scene, bpy.data.objects.new("Speaker", bpy.data.speakers.new("Speaker")))
    add(scene, bpy.data.objects.new("Armature", bpy.data.armatures.new("Armature")))


# The camera


@odd("the camera is inside the cube")
def _(scene):
    scene.objects["Cube"].location = (0.1, 0.1, 0.0)


@odd("the camera lies in the plane of the wall")
def _(scene):
    scene.objects["Plane"].location = (0.0, 0.0, 0.0)
    scene.objects["Plane"].rotation_euler = (0.0, math.pi / 2, 0.0)


@several("the camera's scale", [(0.0, 0.0, 0.0), (0.0, 1.0, 1.0)], EITHER)
@several("the camera's scale", [(-1.0, 1.0, 1.0), (1e-20, 1e-20, 1e-20), (1e10, 1e10, 1e10), (1.0, 5.0, 0.1)])
def _(scene, scale):
    scene.camera.scale = scale


@several("the camera's place", [(NAN, 0.0, 0.0), (INFINITE, 0.0, 0.0), (0.0, 0.0, HUGE)], EITHER)
@several("the camera's place", [(1e6, 1e6, 1e6)])
def _(scene, place):
    scene.camera.location = place


@odd("the camera is turned by NaN", EITHER)
def _(scene):
    scene.camera.rotation_euler = (0.0, NAN, 0.0)


@odd("the camera is sheared by its parent")
def _(scene):
    parent = scene.objects["Cube"]
    parent.scale = (5.0, 0.2, 1.0)
    parent.hide_render = True
    scene.camera.parent = parent


@several("clip range", [(100.0, 0.1), (1.0, 1.0), (1e-6, 1e20), (50.0, 60.0), (1e-6, 2e-6)], EITHER)
def _(scene, clip):
    scene.camera.data.clip_start, scene.camera.data.clip_end = clip


@several("orthographic scale", [0.0], REFUSED, "orthographic")
@several("orthographic scale", [1e-6, 1e6, 1e20], EITHER)
def _(scene, scale):
    scene.camera.data.type = "ORTHO"
    scene.camera.data.ortho_scale = scale


@several("lens in mm", [1.0, 5000.0, 100000.0], EITHER)
def _(scene, lens):
    scene.camera.data.lens = lens


@several("sensor", [(1.0, 1.0), (100.0, 100.0), (0.0, 0.0)], EITHER)
def _(scene, sensor):
    scene.camera.data.sensor_width, scene.camera.data.sensor_height = sensor


@odd("the sensor fits vertically in a wide picture", options=("--size", "64x8"))
def _(scene):
    scene.camera.data.sensor_fit = "VERTICAL"


@several("lens shift", [(10.0, 0.0), (0.0, -10.0), (-0.5, 0.5)])
@several("lens shift", [(NAN, 0.0), (1e20, 0.0)], EITHER)
def _(scene, shift):
    scene.camera.data.shift_x, scene.camera.data.shift_y = shift


PANORAMAS = [
    "EQUIRECTANGULAR",
    "EQUIANGULAR_CUBEMAP_FACE",
    "FISHEYE_EQUIDISTANT",
    "FISHEYE_EQUISOLID",
    "FISHEYE_LENS_POLYNOMIAL",
    "MIRRORBALL",
    "CENTRAL_CYLINDRICAL",
]


@several("panoramic camera", PANORAMAS, REFUSED, "panoram")
def _(scene, kind):
    scene.camera.data.type = "PANO"
    owner = scene.camera.data if hasattr(scene.camera.data, "panorama_type") else scene.camera.data.cycles
    owner.panorama_type = kind


@odd("a camera with a shader of its own", EITHER)
def _(scene):
    if not MODERN:
        raise NotInThisBlenderError
    scene.camera.data.type = "CUSTOM"


@several("aperture", [1e-9, 1e9, 0.0], EITHER)
def _(scene, stop):
    dof = scene.camera.data.dof
    dof.use_dof, dof.aperture_fstop, dof.focus_distance = True, stop, 5.0


@several("focus distance", [0.0, 1e20, NAN], EITHER)
def _(scene, distance):
    dof = scene.camera.data.dof
    dof.use_dof, dof.aperture_fstop, dof.focus_distance = True, 2.0, distance


@odd("the camera is focused on itself", EITHER)
def _(scene):
    scene.camera.data.dof.use_dof = True
    scene.camera.data.dof.focus_object = scene.camera


@odd("the camera is focused on an object of another scene")
def _(scene):
    other = bpy.data.scenes.new("Other")
    item = bpy.data.objects.new("Far", None)
    other.collection.objects.link(item)
    scene.camera.data.dof.use_dof = True
    scene.camera.data.dof.focus_object = item


@odd("a background picture of the camera that is missing")
def _(scene):
    scene.camera.data.show_background_images = True
    background = scene.camera.data.background_images.new()
    image = bpy.data.images.new("gone", 4, 4)
    image.source, image.filepath = "FILE", "//gone.png"
    background.image = image


# The frame


@several("render border", [(0.5, 0.5, 0.5, 0.5), (0.0, 0.01, 0.0, 0.01)], REFUSED, "border")
@several("render border", [(0.9, 0.1, 0.9, 0.1)], EITHER)
@several("render border", [(0.0, 0.5, 0.25, 0.75), (0.3, 0.95, 0.0, 1.0)])
def _(scene, border):
    set_border(scene, border)


@odd("a border that is not cropped")
def _(scene):
    set_border(scene, (0.25, 0.75, 0.25, 0.75))
    scene.render.use_crop_to_border = False


@several("resolution", [(1, 1), (4, 4), (5, 7), (4, 500), (700, 4)])
def _(scene, size):
    scene.render.resolution_x, scene.render.resolution_y = size


@several("aspect of a pixel", [(1.0, 200.0), (200.0, 1.0), (1.5, 1.0)])
def _(scene, aspect):
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = aspect


@odd("one per cent of the resolution")
def _(scene):
    scene.render.resolution_x = scene.render.resolution_y = 800
    scene.render.resolution_percentage = 1


@odd("one per cent of a small resolution", REFUSED, "percentage")
def _(scene):
    scene.render.resolution_percentage = 1


@several("current frame", [-1, -1000, 1048574, 0])
def _(scene, frame):
    scene.frame_set(frame)


@several("frame and subframe", [(-10, 0.5), (3, 0.999), (0, 0.25)])
def _(scene, place):
    scene.frame_set(place[0], subframe=place[1])


@several("empty frame range", [(10, 1), (1048574, 0), (0, -1)], REFUSED, "frame range", command="animate")
def _(scene, ends):
    # Setting one end moves the other, so the file is changed: the two lie side by side in it.
    scene.frame_start, scene.frame_end = 77701, 77702
    return {struct.pack("<ii", 77701, 77702): struct.pack("<ii", *ends)}


@odd("frames in steps longer than the range", command="animate")
def _(scene):
    scene.frame_end, scene.frame_step = 3, 100


@several("frames per second", [(1, 1.0), (32767, 1e-5), (24, 1e6)], command="animate")
def _(scene, rate):
    scene.render.fps, scene.render.fps_base = rate


@odd("remapped time", command="animate")
def _(scene):
    scene.render.frame_map_old, scene.render.frame_map_new = 100, 900
    keyframes(scene.objects["Cube"], "location", {1: (0.0, 0.0, -5.0), 10: (1.0, 0.0, -5.0)})


@several("length of the scene's unit", [0.0, 1e-9, 1e9])
def _(scene, length):
    scene.unit_settings.scale_length = length


# View layers, holdouts


@odd("all view layers are off", REFUSED, "view layer")
def _(scene):
    scene.view_layers[0].use = False


@odd("eight view layers")
def _(scene):
    for number in range(7):
        scene.view_layers.new(f"Layer {number}")


@odd("the first view layer is off, the second single")
def _(scene):
    scene.view_layers.new("Second")
    scene.view_layers[0].use = False
    scene.render.use_single_layer = True


@several("all that is seen", ["holdout", "indirect_only"])
def _(scene, how):
    collection = bpy.data.collections.new("All")
    scene.collection.children.link(collection)
    for item in list(scene.collection.objects):
        if item.type == "MESH":
            scene.collection.objects.unlink(item)
            collection.objects.link(item)
    setattr(scene.view_layers[0].layer_collection.children[0], how, True)


@several("every object is", ["is_holdout", "is_shadow_catcher"])
def _(scene, how):
    for item in scene.objects:
        setattr(item, how, True)


@odd("objects that no ray sees")
def _(scene):
    for item in scene.objects:
        for ray in ("camera", "diffuse", "glossy", "transmission", "shadow", "volume_scatter"):
            setattr(item, f"visible_{ray}", False)


@odd("all passes are switched on")
def _(scene):
    layer = scene.view_layers[0]
    for owner in (layer, layer.cycles):
        for entry in owner.bl_rna.properties:
            if entry.identifier.startswith(("use_pass", "pass_", "denoising_store")) and entry.type == "BOOLEAN":
                setattr(owner, entry.identifier, True)


@odd("no pass at all")
def _(scene):
    layer = scene.view_layers[0]
    for entry in layer.bl_rna.properties:
        if entry.identifier.startswith("use_pass") and entry.type == "BOOLEAN":
            setattr(layer, entry.identifier, False)


@odd("a view layer with a material and a world of its own")
def _(scene):
    layer = scene.view_layers[0]
    layer.material_override = emission("over").block
    if hasattr(layer, "world_override"):
        layer.world_override = bpy.data.worlds.new("over")
    layer.samples = 2


@odd("another scene as background set, which has this one as its own", EITHER)
def _(scene):
    other = bpy.data.scenes.new("Other")
    scene.background_set = other
    try:
        other.background_set = scene
    except (RuntimeError, ValueError):
        scene.background_set = other


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
    mesh_of(scene, [])
    mesh_of(scene, [(0.0, 0.0, -4.0)])
    mesh_of(scene, [(0.0, 0.0, -4.0), (1.0, 0.0, -4.0)], [(0, 1)])
    mesh_of(scene, [(0.0, 0.0, -4.0)] * 4, faces=[(0, 1, 2, 3)])
    mesh_of(scene, [(0.0, 0.0, -4.0), (1.0, 0.0, -4.0), (2.0, 0.0, -4.0)], faces=[(0, 1, 2)])


@odd("faces whose corners are one vertex")
def _(scene):
    mesh_of(scene, [(0.0, 0.0, -4.0), (1.0, 0.0, -4.0), (1.0, 1.0, -4.0)], faces=[(0, 0, 0), (0, 1, 1), (0, 1, 2)])


@odd("a face with a thousand corners, folded over")
def _(scene):
    corners = [(math.sin(7.0 * k), math.cos(11.0 * k), -4.0) for k in range(1000)]
    mesh_of(scene, corners, faces=[tuple(range(1000))])


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


def drive(item, path, expression, *, index=-1, target=None, target_path=""):
    curve = item.driver_add(path, index) if index >= 0 else item.driver_add(path)
    curve.driver.expression = expression
    if target is not None:
        variable = curve.driver.variables.new()
        variable.name = "value"
        variable.targets[0].id_type = target.id_type if hasattr(target, "id_type") else "OBJECT"
        variable.targets[0].id = target
        variable.targets[0].data_path = target_path
    return curve


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


# Materials


@several("emission of", ["infinite", "nan"])
def _(scene, kind):
    made = material(scene)
    shader = made.node("Emission")
    made.link(broken_number(made, kind), shader.inputs["Strength"])
    made.surface(shader)


@several("colour of", ["infinite", "nan"])
def _(scene, kind):
    made = material(scene)
    shader = made.node("BsdfDiffuse")
    made.link(broken_number(made, kind), shader.inputs["Color"])
    made.surface(shader)


@several("bump of", ["infinite", "nan"])
def _(scene, kind):
    made = material(scene)
    shader = made.node("BsdfPrincipled")
    bump = made.node("Bump")
    made.link(broken_number(made, kind), bump.inputs["Height"])
    made.link(bump.outputs[0], shader.inputs["Normal"])
    made.surface(shader)


@several("displacement of", ["infinite", "nan"])
def _(scene, kind):
    made = material(scene)
    made.surface(made.node("BsdfPrincipled"))
    made.block.displacement_method = "DISPLACEMENT"
    made.link(broken_number(made, kind), made.output.inputs["Displacement"])


@several("refraction index", [0.0, -1.0, 1e20])
def _(scene, index):
    made = material(scene)
    made.surface(made.node("BsdfGlass", IOR=index))


@several("roughness of a mirror", [-1.0, 1e20])
def _(scene, roughness):
    made = material(scene)
    made.surface(made.node("BsdfGlossy", Roughness=roughness))


@several("strength of emission", [-5.0, 1e30])
def _(scene, strength):
    made = material(scene)
    made.surface(made.node("Emission", Strength=strength))


@odd("a world that shines NaN")
def _(scene):
    tree = scene.world.node_tree
    node = tree.nodes.new("ShaderNodeMath")
    node.operation = "SUBTRACT"
    for socket in node.inputs[:2]:
        huge = tree.nodes.new("ShaderNodeMath")
        huge.operation = "MULTIPLY"
        huge.inputs[0].default_value = huge.inputs[1].default_value = 3e38
        tree.links.new(huge.outputs[0], socket)
    tree.links.new(node.outputs[0], tree.nodes["Background"].inputs["Strength"])


@odd("an AOV of NaN")
def _(scene):
    scene.view_layers[0].aovs.add().name = "odd"
    made = material(scene)
    made.surface(made.node("BsdfDiffuse"))
    aov = made.node("OutputAOV")
    aov.aov_name = "odd"
    made.link(broken_number(made, "nan"), aov.inputs["Color"])


@odd("shader nodes linked in a circle")
def _(scene):
    made = material(scene)
    first, second = made.node("MixShader"), made.node("MixShader")
    made.link(first.outputs[0], second.inputs[1])
    made.link(second.outputs[0], first.inputs[1])
    made.surface(first)


@odd("reroutes linked in a circle")
def _(scene):
    made = material(scene)
    first, second = made.tree.nodes.new("NodeReroute"), made.tree.nodes.new("NodeReroute")
    made.link(first.outputs[0], second.inputs[0])
    made.link(second.outputs[0], first.inputs[0])
    made.link(second.outputs[0], made.output.inputs["Surface"])


@odd("a node group that is in itself", EITHER)
def _(scene):
    made = material(scene)
    tree = bpy.data.node_groups.new("Loop", "ShaderNodeTree")
    inner = tree.nodes.new("ShaderNodeGroup")
    outer = made.tree.nodes.new("ShaderNodeGroup")
    outer.node_tree = tree
    inner.node_tree = tree
    made.surface(made.node("Emission"))


@odd("a node group of nothing, muted nodes, a shader where a number belongs")
def _(scene):
    made = material(scene)
    group, shader = made.tree.nodes.new("ShaderNodeGroup"), made.node("BsdfDiffuse")
    shader.mute = True
    made.link(shader.outputs[0], made.output.inputs["Displacement"])
    made.surface(shader)
    made.node("Value")
    assert group.node_tree is None


@odd("node groups forty deep")
def _(scene):
    tree = None
    for level in range(40):
        outer = bpy.data.node_groups.new(f"Level {level}", "ShaderNodeTree")
        outer.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
        end = outer.nodes.new("NodeGroupOutput")
        inner = outer.nodes.new("ShaderNodeEmission" if tree is None else "ShaderNodeGroup")
        if tree is not None:
            inner.node_tree = tree
        outer.links.new(inner.outputs[0], end.inputs[0])
        tree = outer
    made = material(scene)
    group = made.tree.nodes.new("ShaderNodeGroup")
    group.node_tree = tree
    made.surface(group)


@odd("a node of a kind that nobody knows")
def _(scene):
    class Unknown(bpy.types.ShaderNodeCustomGroup):
        bl_idname, bl_label = "ShaderNodeNobodyKnows", "Unknown"

    bpy.utils.register_class(Unknown)
    made = material(scene)
    made.tree.nodes.new("ShaderNodeNobodyKnows")
    made.surface(made.node("BsdfDiffuse"))
    bpy.utils.unregister_class(Unknown)


@odd("a script node without its script, a texture without its file", DONE, "missing")
def _(scene):
    scene.cycles.shading_system = True
    made = material(scene)
    script = made.node("Script")
    script.mode, script.filepath = "EXTERNAL", "//gone.osl"
    image = bpy.data.images.new("gone", 4, 4)
    image.source, image.filepath = "FILE", "//gone.png"
    texture = made.node("TexImage")
    texture.image = image
    shader = made.node("BsdfDiffuse")
    made.link(texture.outputs[0], shader.inputs["Color"])
    made.surface(shader)


@several("a picture of", ["no pixels", "tiles that are not there", "a film that is not there"])
def _(scene, what):
    made = material(scene)
    image = bpy.data.images.new("odd", 1, 1, tiled="tiles" in what)
    if "film" in what:
        image.source, image.filepath = "MOVIE", "//gone.mp4"
    if "tiles" in what:
        image.filepath = "//gone.<UDIM>.png"
    texture = made.node("TexImage")
    texture.image = None if what == "no pixels" else image
    shader = made.node("BsdfDiffuse")
    made.link(texture.outputs[0], shader.inputs["Color"])
    made.surface(shader)


@odd("volumes everywhere, one in the other")
def _(scene):
    tree = scene.world.node_tree
    fog = tree.nodes.new("ShaderNodeVolumeScatter")
    fog.inputs["Density"].default_value = 0.1
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputWorld")
    tree.links.new(fog.outputs[0], output.inputs["Volume"])
    for size in (1.0, 3.0, 8.0):
        made = Material("fog")
        made.link(made.node("VolumePrincipled", Density=0.5).outputs[0], made.output.inputs["Volume"])
        add_cube(scene, made, size=size, location=(0.0, 0.0, -5.0))


@several("a volume as dense as", [0.0, 1e20])
@several("a volume as dense as", [NAN, -1.0], EITHER)
def _(scene, density):
    made = material(scene)
    made.link(made.node("VolumeScatter", Density=density).outputs[0], made.output.inputs["Volume"])


@odd("a glass ball in a glass ball in a glass ball, without bounces")
def _(scene):
    for radius in (0.4, 0.6, 0.8):
        made = Material("glass")
        add_sphere(scene, made.surface(made.node("BsdfGlass")), radius=radius, location=(0.0, 0.0, -4.0))
    scene.cycles.max_bounces = 0
    scene.cycles.transparent_max_bounces = 0


# What comes after rendering


@odd("a compositor without an output")
def _(scene):
    tree, _, end = add_compositor(scene)
    tree.nodes.remove(end.node)


@odd("a compositor whose nodes are linked in a circle")
def _(scene):
    tree, layers, end = add_compositor(scene)
    first, second = tree.nodes.new("CompositorNodeBlur"), tree.nodes.new("CompositorNodeBlur")
    tree.links.new(first.outputs[0], second.inputs[0])
    tree.links.new(second.outputs[0], first.inputs[0])
    tree.links.new(layers.outputs[0], end)


@odd("a compositor that shows another scene")
def _(scene):
    tree, layers, end = add_compositor(scene)
    other = scene.copy()
    layers.scene = other
    tree.links.new(layers.outputs[0], end)


@odd("a compositor that shows a scene without a camera", EITHER)
def _(scene):
    tree, layers, end = add_compositor(scene)
    layers.scene = bpy.data.scenes.new("Empty")
    tree.links.new(layers.outputs[0], end)


@odd("a compositor that shows a view layer which is gone")
def _(scene):
    tree, layers, end = add_compositor(scene)
    scene.view_layers.new("Gone")
    layers.layer = "Gone"
    scene.view_layers.remove(scene.view_layers["Gone"])
    tree.links.new(layers.outputs[0], end)


@odd("a compositor with a group of nothing and an image of nothing")
def _(scene):
    tree, layers, end = add_compositor(scene)
    tree.nodes.new("CompositorNodeGroup")
    tree.nodes.new("CompositorNodeImage")
    tree.links.new(layers.outputs[0], end)


@odd("a compositor that makes the picture as small as a pixel", EITHER)
def _(scene):
    tree, layers, end = add_compositor(scene)
    scale = tree.nodes.new("CompositorNodeScale")
    for socket in scale.inputs[1:3]:
        if hasattr(socket, "default_value") and isinstance(socket.default_value, float):
            socket.default_value = 0.001
    tree.links.new(layers.outputs[0], scale.inputs[0])
    tree.links.new(scale.outputs[0], end)


@odd("strips in the sequencer", EITHER)
def _(scene):
    scene.render.use_sequencer = True
    editor = scene.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    strips.new_scene("Self", scene, 1, 1)
    length = {"length": 10} if MODERN else {"frame_end": 10}
    strips.new_effect("Colour", "COLOR", 2, 1, **length)


@odd("Freestyle with a line set of nothing", DONE, "Freestyle")
def _(scene):
    scene.render.use_freestyle = True
    scene.view_layers[0].use_freestyle = True
    scene.view_layers[0].freestyle_settings.linesets.new("Lines")


@odd("a drawing of grease pencil", EITHER)
def _(scene):
    blocks = getattr(bpy.data, "grease_pencils_v3", None) or bpy.data.grease_pencils
    add(scene, bpy.data.objects.new("Drawing", blocks.new("Drawing")))


@odd("a display that knows no colours")
def _(scene):
    scene.view_settings.view_transform = "Raw"
    scene.view_settings.exposure = 32.0
    scene.view_settings.gamma = 0.0


@odd("curves on the picture that cross", EITHER)
def _(scene):
    scene.view_settings.use_curve_mapping = True
    for point in scene.view_settings.curve_mapping.curves[3].points:
        point.location = (1.0 - point.location.x, point.location.y)


@several("film exposure", [0.0, 10.0])
def _(scene, exposure):
    scene.cycles.film_exposure = exposure


@several("format of files", ["HDR", "BMP", "CINEON", "DPX", "TARGA", "WEBP"], command="animate")
def _(scene, file_format):
    scene.render.image_settings.file_format = file_format


# Engines and their settings


@odd("Workbench", REFUSED, "Cycles or EEVEE")
def _(scene):
    scene.render.engine = "BLENDER_WORKBENCH"


@odd("an engine that nobody has", EITHER)
def _(scene):
    class Nobody(bpy.types.RenderEngine):
        bl_idname, bl_label = "NOBODY", "Nobody"

    bpy.utils.register_class(Nobody)
    scene.render.engine = "NOBODY"


@odd("EEVEE, which needs a GPU", EITHER)
def _(scene):
    scene.render.engine = "BLENDER_EEVEE" if MODERN else "BLENDER_EEVEE_NEXT"


@several("samples", [0, 1, 16777216], options=("--samples", "1"))
def _(scene, samples):
    scene.cycles.samples = samples


@odd("a million samples within a second")
def _(scene):
    scene.cycles.samples = 1_000_000
    scene.cycles.time_limit = 1.0


@odd("a time limit that has passed at once")
def _(scene):
    scene.cycles.time_limit = 1e-6


@odd("a time limit of NaN", EITHER)
def _(scene):
    scene.cycles.time_limit = NAN


@several("adaptive sampling", [(0.0, 0), (1.0, 0), (1e-9, 4096), (0.01, 3)])
def _(scene, adaptive):
    scene.cycles.samples = 4
    scene.cycles.use_adaptive_sampling = True
    scene.cycles.adaptive_threshold, scene.cycles.adaptive_min_samples = adaptive


@odd("path guiding from the first sample on")
def _(scene):
    scene.cycles.use_guiding = True
    scene.cycles.guiding_training_samples = 0
    scene.cycles.samples = 4


@several("pattern of samples", ["TABULATED_SOBOL", "BLUE_NOISE", "AUTOMATIC"])
def _(scene, pattern):
    scene.cycles.sampling_pattern = pattern
    scene.cycles.auto_scrambling_distance = True
    scene.cycles.scrambling_distance = 0.0


@several("width of the pixel filter", [0.01, 10.0])
def _(scene, width):
    scene.cycles.filter_width = width


@odd("no bounces at all, clamped to nearly nothing")
def _(scene):
    scene.cycles.max_bounces = 0
    scene.cycles.sample_clamp_direct = 1e-20
    scene.cycles.sample_clamp_indirect = 1e-20


@odd("tiles of eight pixels, one thread, no memory to spare", options=("--size", "70x30"))
def _(scene):
    scene.cycles.use_auto_tile = True
    scene.cycles.tile_size = 8
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.cycles.debug_use_spatial_splits = True


@odd("persistent data, simplified, baking to vertices")
def _(scene):
    scene.render.use_persistent_data = True
    scene.render.use_simplify = True
    scene.cycles.bake_type = "NORMAL"
    scene.render.bake.target = "VERTEX_COLORS"


@odd("a seed that is keyframed, and driven")
def _(scene):
    scene.cycles.seed = 5
    scene.cycles.keyframe_insert("seed", frame=1)
    scene.driver_add("cycles.seed").driver.expression = "frame * 1e12"


@odd("film that is transparent, with holes of glass")
def _(scene):
    scene.render.film_transparent = True
    scene.cycles.film_transparent_glass = True
    made = material(scene)
    made.surface(made.node("BsdfGlass"))


@several("shutter", [0.0, 1e-9, 2.0, 1e6])
def _(scene, shutter):
    scene.render.use_motion_blur = True
    scene.render.motion_blur_shutter = shutter
    keyframes(scene.objects["Cube"], "location", {0: (0.0, 0.0, -5.0), 2: (2.0, 0.0, -5.0)})


@odd("rolling shutter, deformed in 2^7 steps")
def _(scene):
    scene.render.use_motion_blur = True
    scene.cycles.rolling_shutter_type = "TOP"
    scene.objects["Cube"].cycles.motion_steps = 7
    keyframes(scene.objects["Cube"], "rotation_euler", {0: (0.0, 0.0, 0.0), 2: (900.0, 0.0, 0.0)})


# Stereo


@several("interocular distance", [1e20], REFUSED, "interocular")
@several("interocular distance", [0.0, 1e-20, 1e6], EITHER)
@several("interocular distance", [-0.1, NAN], EITHER)
def _(scene, distance):
    scene.camera.data.stereo.interocular_distance = distance


@several("convergence distance", [0.0, 1e-5, 1e20, -1.0, NAN], EITHER)
def _(scene, distance):
    scene.camera.data.stereo.convergence_distance = distance


@several("convergence and pivot", [("PARALLEL", "RIGHT"), ("TOE", "CENTER"), ("OFFAXIS", "RIGHT"), ("TOE", "RIGHT")])
def _(scene, how):
    scene.camera.data.stereo.convergence_mode, scene.camera.data.stereo.pivot = how


@odd("toed-in eyes that look at each other")
def _(scene):
    stereo = scene.camera.data.stereo
    stereo.convergence_mode, stereo.convergence_distance, stereo.interocular_distance = "TOE", 1e-5, 1.0


@odd("orthographic eyes, toed in")
def _(scene):
    scene.camera.data.type = "ORTHO"
    scene.camera.data.stereo.convergence_mode = "TOE"


@odd("spherical stereo and poles that merge, of a plain camera", REFUSED, "spherical")
def _(scene):
    stereo = scene.camera.data.stereo
    stereo.use_spherical_stereo = stereo.use_pole_merge = True
    stereo.pole_merge_angle_from, stereo.pole_merge_angle_to = 1.5, 0.1


@odd("one view alone is used", EITHER)
def _(scene):
    scene.render.use_multiview = True
    scene.render.views["left"].use = False


@odd("no view is used", EITHER)
def _(scene):
    scene.render.use_multiview = True
    for view in scene.render.views:
        view.use = False


@odd("three views, two of them called as eyes are")
def _(scene):
    scene.render.use_multiview = True
    scene.render.views_format = "MULTIVIEW"
    scene.render.views.new("middle").camera_suffix = ""


@odd("views that have other names", EITHER)
def _(scene):
    scene.render.use_multiview = True
    scene.render.views_format = "MULTIVIEW"
    scene.render.views["left"].name = "links"
    scene.render.views["right"].name = "rechts"


@several("suffixes of files", [("", ""), ("_X", "_X"), ("/../_L", "_R"), ("_R", "_L")], EITHER, command="animate")
def _(scene, suffixes):
    scene.render.use_multiview = True
    for view, suffix in zip(("left", "right"), suffixes, strict=True):
        scene.render.views[view].file_suffix = suffix


@several("layout of stereo pictures", ["ANAGLYPH", "INTERLACE", "SIDEBYSIDE", "TOPBOTTOM"], command="animate")
def _(scene, mode):
    scene.render.use_multiview = True
    settings = scene.render.image_settings
    settings.views_format = "STEREO_3D"
    settings.stereo_3d_format.display_mode = mode
    settings.stereo_3d_format.use_squeezed_frame = True


# Several of it


@odd("markers that bind a lamp, a hidden camera and one that is gone", REFUSED, "no camera")
def _(scene):
    hidden = scene.camera.copy()
    scene.collection.objects.link(hidden)
    hidden.hide_render = True
    gone = bpy.data.objects.new("Gone", bpy.data.cameras.new("Gone"))
    for frame, camera in ((0, scene.objects["Sun"]), (1, hidden), (1, gone)):
        scene.timeline_markers.new("odd", frame=frame).camera = camera
    bpy.data.objects.remove(gone)


@odd("a second scene of the same objects is the active one's copy")
def _(scene):
    scene.copy()


@odd("an object in two hundred collections")
def _(scene):
    for number in range(200):
        collection = bpy.data.collections.new(f"C{number}")
        scene.collection.children.link(collection)
        collection.objects.link(scene.objects["Cube"])


@odd("a camera moved by animation to NaN", EITHER, command="animate")
def _(scene):
    scene.frame_end = 3
    keyframes(scene.camera, "location", {1: (0.0, 0.0, 0.0), 2: (NAN, 0.0, 0.0), 3: (0.0, 0.0, 0.0)})


@odd("a camera that looks away in the second of three frames", command="animate")
def _(scene):
    scene.frame_end = 3
    keyframes(scene.camera, "rotation_euler", {1: (0.0, 0.0, 0.0), 2: (math.pi, 0.0, 0.0), 3: (0.0, 0.0, 0.0)})


@odd("a wall of a thousand layers of alpha")
def _(scene):
    made = Material("veil")
    mix = made.node("MixShader", Fac=0.01)
    made.link(made.node("BsdfTransparent").outputs[0], mix.inputs[1])
    made.link(made.node("Emission").outputs[0], mix.inputs[2])
    made.surface(mix)
    for number in range(100):
        add_plane(scene, made, size=(9.0, 9.0), location=(0.0, 0.0, -1.0 - 0.01 * number))
    scene.cycles.transparent_max_bounces = 8


@odd("an object as parent of the camera, as its child's constraint, as its focus")
def _(scene):
    cube = scene.objects["Cube"]
    scene.camera.parent = cube
    cube.constraints.new("CHILD_OF").target = scene.camera
    scene.camera.data.dof.use_dof = True
    scene.camera.data.dof.focus_object = cube


@odd("a wall with a diffuse and a volume of the same material, lit by itself")
def _(scene):
    made = diffuse("both")
    made.link(made.node("VolumeAbsorption").outputs[0], made.output.inputs["Volume"])
    scene.objects["Plane"].data.materials[0] = made.block
