"""Makers of scenes with odd cameras, frames, view layers and stereo settings, or with next to nothing in them.

Where no exit status is named a pair must come of it: Blender renders such a scene too. What is odd about a scene is
said in the case's name, and so the makers have none.
"""

from __future__ import annotations

import math
import struct

import bpy

from tests.blender.toolbox import add, emission, keyframes, set_border
from tests.hostile.blends import EITHER, REFUSED, NotInThisBlenderError, odd, several
from tests.hostile.small_scenes import HUGE, INFINITE, MODERN, NAN

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
    # Or it would not be saved.
    camera.use_fake_user = True
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


@several("panoramic camera", PANORAMAS, EITHER)
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


@odd("a border that is not cropped", (0,), "Crop to Render Region")
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


@odd("spherical stereo and poles that merge, of a plain camera", EITHER)
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


@several("suffixes of files", [("", ""), ("_X", "_X"), ("_x", "_X")], REFUSED, "same file", command="animate")
@several("suffixes of files", [("/../_L", "_R"), ("_R", "_L")], EITHER, command="animate")
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
