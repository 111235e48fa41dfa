"""The compositor of the scene after our delivery, held against the same after Blender's own multiview.

Both are of the same passes, noise included: those that plain multiview has rendered are what is delivered.
"""

from contextlib import contextmanager

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.output.delivery import deliver_composited, deliver_frames, deliver_to_result
from stereo_reproject.blender.output.pictures import read_png
from stereo_reproject.blender.scene.compositor import compositor_blocker, compositor_tree, is_composited
from stereo_reproject.blender.scene.warnings import scene_warnings
from stereo_reproject.images.exr import CRYPTOMATTE_ATTRIBUTE_PREFIX, _read_parts
from tests.blender.snapshot import everything
from tests.blender.toolbox import (
    add_camera,
    add_compositor,
    add_plane,
    add_sphere,
    add_sun,
    diffuse,
    emission,
    empty_compositor,
    empty_scene,
    noise_image,
    render_plain_layers,
    set_background,
)

WIDTH, HEIGHT = 64, 36

ROUNDING = 1.01 / 255.0
"""A PNG of 8 bits: a value may fall on either side of a step."""

SINGLE_PRECISION = 1e-5
"""Relative: what a compositor's arithmetic leaves of equal numbers."""


@pytest.fixture
def scene(tmp_path):
    """A ball before a wall of noise and before the sky. Dithering is off: it is random."""
    scene = empty_scene(WIDTH, HEIGHT, samples=2)
    scene.view_layers[0].name = "Main"
    add_plane(scene, diffuse("wall", image=noise_image(tmp_path)), size=(9, 6), location=(-2, 0, -8))
    add_sphere(scene, diffuse("paint", colour=(0.9, 0.3, 0.1)), radius=1.0, location=(0.2, 0.1, -5)).name = "Ball"
    set_background(scene, 0.3)
    add_sun(scene, strength=1.5)
    add_camera(scene)
    scene.render.dither_intensity = 0.0
    return scene


def set_png(scene, views="STEREO_3D"):
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth = "PNG", "8"
    settings.color_mode = "RGBA" if scene.render.film_transparent else "RGB"
    settings.views_format = views
    settings.stereo_3d_format.display_mode = "SIDEBYSIDE"


def add_file_output(tree, folder, sockets, *, multilayer=False):
    """A File Output node with one file for each view: of each socket a PNG, or of all an EXR."""
    node = tree.nodes.new("CompositorNodeOutputFile")
    if hasattr(node, "directory"):
        node.directory, node.file_name = f"{folder}/", "node_"
        node.format.media_type = "MULTI_LAYER_IMAGE" if multilayer else "IMAGE"
    else:
        node.base_path = f"{folder}/node_" if multilayer else f"{folder}/"
    node.format.file_format = "OPEN_EXR_MULTILAYER" if multilayer else "PNG"
    node.format.color_depth = "32" if multilayer else "8"
    node.format.views_format = "INDIVIDUAL"
    if not hasattr(node, "directory"):
        node.inputs.clear()
    for k, socket in enumerate(sockets):
        kind = {"VALUE": "FLOAT", "VECTOR": "VECTOR"}.get(socket.type, "RGBA")
        name = socket.name if multilayer else f"{socket.name}_{k}_"
        if hasattr(node, "directory"):
            node.file_output_items.new(kind, name)
        elif multilayer:
            node.layer_slots.new(name)
        else:
            node.file_slots.new(name)
        tree.links.new(socket, node.inputs[k])
    return node


def folder_of(node, folder):
    """Have a File Output node write elsewhere."""
    if hasattr(node, "directory"):
        node.directory = f"{folder}/"
    else:
        node.base_path = f"{folder}/{node.base_path.rpartition('/')[2]}"


def over(tree, below, above):
    """One picture over another."""
    node = tree.nodes.new("CompositorNodeAlphaOver")
    images = [socket for socket in node.inputs if socket.type == "RGBA"]
    tree.links.new(below, images[0])
    tree.links.new(above, images[1])
    return node.outputs["Image"]


def add_layer(scene, name):
    layer = scene.view_layers.new(name)
    layer.use_pass_z = True
    return layer


# Trees: each switches on the passes that it needs, and has File Output nodes


def depth_matte_and_light(scene, folder):
    """Depth as red, the ball's matte as green and its direct light as blue; each in a file besides."""
    layer = scene.view_layers[0]
    layer.use_pass_cryptomatte_object = layer.use_pass_diffuse_direct = True
    tree, layers, result = add_compositor(scene)
    depth = tree.nodes.new("CompositorNodeNormalize")
    tree.links.new(layers.outputs["Depth"], depth.inputs[0])
    matte = tree.nodes.new("CompositorNodeCryptomatteV2")
    matte.scene = scene
    matte.layer_name = "Main.CryptoObject"
    matte.matte_id = "Ball"
    tree.links.new(layers.outputs["Image"], matte.inputs["Image"])
    light = next(socket for socket in layers.outputs if socket.name in ("DiffDir", "Diffuse Direct"))
    colour = tree.nodes.new("CompositorNodeCombineColor")
    for k, socket in enumerate((depth.outputs[0], matte.outputs["Matte"], light)):
        tree.links.new(socket, colour.inputs[k])
    tree.links.new(colour.outputs[0], result)
    return [add_file_output(tree, folder, [depth.outputs[0], matte.outputs["Matte"], matte.outputs["Pick"], light])]


def every_socket(scene, folder):
    """All that a Render Layers node offers, in one multilayer file for each view."""
    layer = scene.view_layers[0]
    for name in PASSES:
        setattr(layer, f"use_pass_{name}", True)
    layer.cycles.denoising_store_passes = True
    layer.aovs.add().name = "Own"
    tree, layers, result = add_compositor(scene)
    sockets = [socket for socket in layers.outputs if socket.enabled and not socket.is_unavailable]
    assert len(sockets) > len(PASSES)
    tree.links.new(layers.outputs["Image"], result)
    return [add_file_output(tree, folder, sockets, multilayer=True)]


PASSES = (
    "mist",
    "normal",
    "position",
    "uv",
    "vector",
    "object_index",
    "material_index",
    "diffuse_direct",
    "diffuse_indirect",
    "diffuse_color",
    "glossy_direct",
    "transmission_color",
    "emit",
    "environment",
    "ambient_occlusion",
    "cryptomatte_object",
    "cryptomatte_material",
    "cryptomatte_asset",
)


def two_layers(scene, folder):
    """The wall in one view layer and the ball in another, with passes of its own, which is put over the first."""
    scene.render.film_transparent = True
    for name in ("Plane", "Ball"):
        collection = bpy.data.collections.new(name)
        scene.collection.children.link(collection)
        collection.objects.link(scene.objects[name])
        scene.collection.objects.unlink(scene.objects[name])
    front = add_layer(scene, "Front")
    scene.view_layers["Main"].layer_collection.children["Ball"].exclude = True
    front.layer_collection.children["Plane"].exclude = True
    front.use_pass_normal = True
    tree, behind, result = add_compositor(scene)
    before = tree.nodes.new("CompositorNodeRLayers")
    before.scene, before.layer = scene, "Front"
    tree.links.new(over(tree, behind.outputs["Image"], before.outputs["Image"]), result)
    return [add_file_output(tree, folder, [before.outputs["Normal"], behind.outputs["Depth"]])]


def an_override(scene, folder):
    """All in clay in a second layer, of which the first shows nothing; the result is half of each."""
    clay = add_layer(scene, "Clay")
    clay.material_override = emission("clay", colour=(0.1, 0.7, 0.9), strength=0.6).block
    clay.samples = 1
    tree, own, result = add_compositor(scene)
    other = tree.nodes.new("CompositorNodeRLayers")
    other.scene, other.layer = scene, "Clay"
    half = tree.nodes.new("CompositorNodeSetAlpha")
    next(socket for socket in half.inputs if socket.name == "Alpha").default_value = 0.5
    tree.links.new(other.outputs["Image"], half.inputs["Image"])
    tree.links.new(over(tree, own.outputs["Image"], half.outputs["Image"]), result)
    return [add_file_output(tree, folder, [other.outputs["Image"]])]


def files_alone(scene, folder):
    """Nothing is linked to the output."""
    tree, layers, _ = add_compositor(scene)
    return [add_file_output(tree, folder, [layers.outputs["Image"], layers.outputs["Depth"]])]


def a_layer_that_is_off(scene, folder):
    """A node that shows a layer that is not rendered gives nothing, after any render."""
    scene.view_layers.new("Off").use = False
    tree, layers, result = add_compositor(scene)
    off = tree.nodes.new("CompositorNodeRLayers")
    off.scene, off.layer = scene, "Off"
    tree.links.new(over(tree, layers.outputs["Image"], off.outputs["Image"]), result)
    return []


def graded(scene, folder):
    """The view transform comes after the compositor."""
    view = scene.view_settings
    view.view_transform, view.look, view.exposure, view.gamma = "Filmic", "High Contrast", 0.7, 1.2
    tree, layers, result = add_compositor(scene)
    exposure = tree.nodes.new("CompositorNodeExposure")
    exposure.inputs["Exposure"].default_value = -1.0
    tree.links.new(layers.outputs["Image"], exposure.inputs["Image"])
    tree.links.new(exposure.outputs["Image"], result)
    return [add_file_output(tree, folder, [exposure.outputs["Image"]])]


TREES = [depth_matte_and_light, every_socket, two_layers, an_override, files_alone, a_layer_that_is_off, graded]


@contextmanager
def without_compositor(scene):
    scene.render.use_compositing = False
    yield
    scene.render.use_compositing = True


def plain_eyes(scene, folder):
    """What plain multiview has rendered, and the texts that say what its cryptomattes hold."""
    texts = {}
    with without_compositor(scene):
        eyes = render_plain_layers(scene, folder, texts=texts)
    return eyes, {key: text for key, text in texts.items() if key.startswith(CRYPTOMATTE_ATTRIBUTE_PREFIX)}


def plain_files(scene, path, *, animation=False):
    """The picture of plain multiview, and the files of its nodes."""
    set_png(scene)
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=not animation, animation=animation)


def held_by(path):
    """The pictures of a file by channel, for an EXR linear numbers, else display values; and what it says of hashes."""
    if path.suffix != ".exr":
        return {"": read_png(path)}, {}
    parts = _read_parts(path)
    texts = {
        key: text for part in parts for key, text in part.header.items() if key.startswith(CRYPTOMATTE_ATTRIBUTE_PREFIX)
    }
    return {name: channel.pixels for part in parts for name, channel in part.channels.items()}, texts


def assert_same_files(ours, plain):
    names = sorted(path.name for path in plain.iterdir()) if plain.exists() else []
    assert (sorted(path.name for path in ours.iterdir()) if ours.exists() else []) == names
    for name in names:
        (found, texts), (expected, own_texts) = held_by(ours / name), held_by(plain / name)
        assert set(found) == set(expected)
        assert texts == own_texts
        for channel, values in expected.items():
            limits = {"rtol": SINGLE_PRECISION, "atol": SINGLE_PRECISION if name.endswith("exr") else ROUNDING}
            np.testing.assert_allclose(found[channel], values, **limits, err_msg=f"{name} {channel}")


@pytest.mark.parametrize("add_tree", TREES)
def test_the_picture_and_all_files_are_those_of_multiview(scene, tmp_path, add_tree):
    writers = add_tree(scene, tmp_path / "plain")
    eyes, metadata = plain_eyes(scene, tmp_path)
    plain_files(scene, tmp_path / "plain.png")
    for writer in writers:
        folder_of(writer, tmp_path / "ours")
    before = everything()
    deliver_composited(scene, eyes, tmp_path / "ours.png", metadata=metadata)
    assert everything() == before
    expected = read_png(tmp_path / "plain.png")
    np.testing.assert_allclose(read_png(tmp_path / "ours.png"), expected, atol=ROUNDING)
    if add_tree is not files_alone:
        assert expected.std() > 0.02, "a picture with something to see"
        assert np.abs(np.subtract(*np.split(expected, 2, axis=1))).mean() > 0.005, "two eyes"
    assert_same_files(tmp_path / "ours", tmp_path / "plain")
    assert len(list((tmp_path / "plain").glob("*"))) % 2 == 0


@pytest.mark.parametrize("add_tree", [depth_matte_and_light, two_layers])
def test_an_animations_frame_is_that_of_multiview(scene, tmp_path, add_tree):
    (writer,) = add_tree(scene, tmp_path / "plain")
    eyes, metadata = plain_eyes(scene, tmp_path)
    scene.frame_end = 1
    plain_files(scene, tmp_path / "shot_", animation=True)
    folder_of(writer, tmp_path / "ours")
    deliver_frames(scene, lambda _: eyes, tmp_path / "frames", frames=range(1, 2), metadata=metadata)
    ours, expected = (read_png(folder / "shot_0001.png") for folder in (tmp_path / "frames", tmp_path))
    np.testing.assert_allclose(ours, expected, atol=ROUNDING)
    assert_same_files(tmp_path / "ours", tmp_path / "plain")


def test_what_is_only_looked_at_writes_no_files(scene, tmp_path):
    (writer,) = two_layers(scene, tmp_path / "plain")
    eyes, metadata = plain_eyes(scene, tmp_path)
    plain_files(scene, tmp_path / "plain.png")
    folder_of(writer, tmp_path / "ours")
    before = everything()
    deliver_to_result(scene, eyes, to_look_at=True)
    assert not (tmp_path / "ours").exists()
    deliver_to_result(scene, eyes, metadata=metadata)
    assert_same_files(tmp_path / "ours", tmp_path / "plain")
    assert everything() == before


FORMATS = [
    ("IMAGE", "JPEG", {"color_mode": "BW", "quality": 33}),
    ("IMAGE", "PNG", {"color_mode": "RGBA", "color_depth": "16", "compression": 71}),
    ("IMAGE", "OPEN_EXR", {"color_mode": "RGB", "color_depth": "16", "exr_codec": "DWAA"}),
    ("IMAGE", "TIFF", {"color_mode": "RGBA", "color_depth": "16", "tiff_codec": "LZW"}),
    ("MULTI_LAYER_IMAGE", "OPEN_EXR_MULTILAYER", {"color_depth": "32", "exr_codec": "PIZ"}),
    ("VIDEO", "FFMPEG", {"color_mode": "RGB"}),
]


@pytest.mark.parametrize(("media", "file_format", "more"), FORMATS, ids=[name for _, name, _ in FORMATS])
def test_the_output_settings_are_as_they_were(scene, tmp_path, media, file_format, more):
    graded(scene, tmp_path)
    eyes, _ = plain_eyes(scene, tmp_path)
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = media
    settings.file_format = file_format
    for name, value in more.items():
        setattr(settings, name, value)
    settings.color_management = "OVERRIDE"
    settings.view_settings.exposure = 3.0
    settings.stereo_3d_format.display_mode = "TOPBOTTOM"
    settings.stereo_3d_format.use_squeezed_frame = True
    before = everything()
    deliver_composited(scene, eyes, tmp_path / "ours.png")
    assert everything() == before


def test_the_compositor_stands_at_the_frame_that_is_delivered(scene, tmp_path):
    graded(scene, tmp_path)
    exposure = compositor_tree(scene).nodes["Exposure"].inputs["Exposure"]
    for frame, value in ((1, -3.0), (5, 1.0)):
        exposure.default_value = value
        exposure.keyframe_insert("default_value", frame=frame)
    scene.frame_set(1)
    eyes, _ = plain_eyes(scene, tmp_path)
    before = everything()
    pictures = []
    for frame in (1, 5):
        deliver_composited(scene, eyes, tmp_path / f"{frame}.png", frame=frame)
        assert everything() == before
        pictures.append(read_png(tmp_path / f"{frame}.png"))
    assert pictures[1].mean() > 2.0 * pictures[0].mean()


def test_a_compositor_that_only_writes_files_is_told(scene, tmp_path):
    (writer,) = files_alone(scene, tmp_path)
    assert any("nothing is linked to the compositor's output" in warning for warning in scene_warnings(scene))
    assert is_composited(scene)
    writer.mute = True
    assert not is_composited(scene)


def curve_of(settings):
    return [
        (tuple(point.location), point.handle_type)
        for curve in settings.view_settings.curve_mapping.curves
        for point in curve.points
    ]


@pytest.mark.parametrize("used", [True, False])
def test_curves_of_the_output_are_as_they_were(scene, tmp_path, used):
    graded(scene, tmp_path)
    eyes, _ = plain_eyes(scene, tmp_path)
    settings = scene.render.image_settings
    settings.color_management = "OVERRIDE"
    settings.view_settings.use_curve_mapping = True
    mapping = settings.view_settings.curve_mapping
    for k, curve in enumerate(mapping.curves):
        curve.points.new(0.2 + 0.1 * k, 0.6).handle_type = "VECTOR"
    mapping.curves[0].points.new(0.8, 0.1)
    mapping.update()
    settings.view_settings.use_curve_mapping = used
    before, points = everything(), curve_of(settings)
    deliver_composited(scene, eyes, tmp_path / "ours.png")
    assert everything() == before
    assert curve_of(settings) == points


def test_a_picture_after_the_compositor_has_the_scenes_colours(scene, tmp_path):
    graded(scene, tmp_path)
    eyes, _ = plain_eyes(scene, tmp_path)
    deliver_composited(scene, eyes, tmp_path / "before.png")
    scene.render.image_settings.color_management = "OVERRIDE"
    scene.render.image_settings.view_settings.exposure = 4.0
    deliver_composited(scene, eyes, tmp_path / "after.png")
    np.testing.assert_array_equal(read_png(tmp_path / "after.png"), read_png(tmp_path / "before.png"))


def test_a_node_that_shows_another_scene_leaves_the_compositor_out(scene, tmp_path):
    two_layers(scene, tmp_path / "plain")
    assert is_composited(scene)
    other = bpy.data.scenes.new("Other")
    compositor_tree(scene).nodes["Render Layers"].scene = other
    assert "shows the scene 'Other'" in compositor_blocker(scene)
    assert not is_composited(scene)
    assert any("left out" in warning and "'Other'" in warning for warning in scene_warnings(scene))


def test_a_compositor_without_render_layers(scene, tmp_path):
    """Its picture is its own, and the same for both eyes."""
    tree, result = empty_compositor(scene)
    colour = tree.nodes.new("CompositorNodeRGB")
    colour.outputs[0].default_value = (0.5, 0.25, 0.0, 1.0)
    tree.links.new(colour.outputs[0], result)
    eyes, _ = plain_eyes(scene, tmp_path)
    plain_files(scene, tmp_path / "plain.png")
    deliver_composited(scene, eyes, tmp_path / "ours.png")
    np.testing.assert_allclose(read_png(tmp_path / "ours.png"), read_png(tmp_path / "plain.png"), atol=ROUNDING)
