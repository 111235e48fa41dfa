"""Makers of scenes with odd settings of engines, output and compositor, and with several odd things at once.

Where no exit status is named a pair must come of it: Blender renders such a scene too. What is odd about a scene is
said in the case's name, and so the makers have none.
"""

from __future__ import annotations

import math

import bpy

from tests.blender.toolbox import Material, add, add_compositor, add_plane, diffuse, keyframes
from tests.hostile.blends import DONE, EITHER, REFUSED, odd, several
from tests.hostile.small_scenes import MODERN, NAN, odd_material

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


@odd("strips in the sequencer", DONE, "Video Sequencer")
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
    blocks = bpy.data.grease_pencils if MODERN else bpy.data.grease_pencils_v3
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
    made = odd_material(scene)
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
