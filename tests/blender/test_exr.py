"""A multi-view EXR of ours is one to Blender: it finds both views, and in each the pixels that belong there."""

import bpy
import numpy as np
import OpenEXR

from stereo_reproject.exr import write_stereo
from stereo_reproject.passes import COLOUR_PASS, DEPTH_PASS
from tests.blender.toolbox import empty_compositor

WIDTH, HEIGHT = 24, 16


def eye(seed):
    random = np.random.default_rng(seed)
    colour = random.random((HEIGHT, WIDTH, 4), np.float32)
    colour[..., 3] = 1.0
    return {COLOUR_PASS: colour, DEPTH_PASS: random.random((HEIGHT, WIDTH, 1), np.float32)}


def passing_on(image, output):
    """A scene whose compositor hands a pass of the image on."""
    scene = bpy.data.scenes.new("compositing")
    tree, end = empty_compositor(scene)
    node = tree.nodes.new("CompositorNodeImage")
    node.image = image
    tree.links.new(node.outputs[output], end)
    return scene


def composited(scene, path):
    """(H, W) by view: the first channel of what the scene's compositor makes of it."""
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    render = scene.render
    render.engine, scene.cycles.samples, render.use_compositing = "CYCLES", 1, True
    render.resolution_x, render.resolution_y, render.resolution_percentage = WIDTH, HEIGHT, 100
    render.use_multiview, render.views_format = True, "STEREO_3D"
    settings = render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth, settings.views_format = "OPEN_EXR", "32", "MULTIVIEW"
    render.filepath = str(path)
    bpy.ops.render.render(scene=scene.name, write_still=True)
    # A part for each view in 5.2, names with the view in them in 4.5.
    found = {}
    with OpenEXR.File(str(path), separate_channels=True) as file:
        for part in file.parts:
            for name, channel in part.channels.items():
                *view, letter = name.split(".")
                if letter == "R":
                    found[part.header.get("view", "".join(view) or "left")] = np.array(channel.pixels)
    return found


def test_blender_reads_both_views(tmp_path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    eyes = {"left": eye(1), "right": eye(2)}
    write_stereo(tmp_path / "stereo.exr", eyes)
    image = bpy.data.images.load(str(tmp_path / "stereo.exr"))
    assert len(image.pixels) == 0, "a multilayer picture has none of its own; asking for them loads it"
    assert (image.type, image.is_multiview, image.is_stereo_3d) == ("MULTILAYER", True, True)
    for output, name in (("Combined", COLOUR_PASS), ("Depth", DEPTH_PASS)):
        shown = composited(passing_on(image, output), tmp_path / "composited.exr")
        assert set(shown) == {"left", "right"}
        for view, passes in eyes.items():
            np.testing.assert_array_equal(shown[view], passes[name][..., 0])
