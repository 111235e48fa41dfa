"""The pair's files are ones to Blender and to OpenImageIO: all layers and views, and in each the pixels that belong
there."""

import sys
from pathlib import Path

import bpy
import numpy as np
import OpenEXR
import pytest

from stereo_reproject.images.exr import write_eye, write_stereo
from stereo_reproject.images.passes import pass_letters
from tests.blender.toolbox import empty_compositor

WIDTH, HEIGHT = 24, 16
VIEWS = ("left", "right")

LAYERS = ("View Layer", "Fog.Near")
"""The second has the separator of channel names in its own."""

CHANNELS = {
    "Combined": 4,
    "Depth": 1,
    "Normal": 3,
    "UV": 3,
    "Vector": 4,
    "Object Index": 1,
    "Mist": 1,
    "Diffuse Color": 3,
    "CryptoObject00": 4,
    "Combined_Sun": 3,
    "Mask": 1,
}

OUT_OF_REACH = {(LAYERS[1], name) for name in ("Depth", "Normal", "Vector") if bpy.app.version < (5, 0)}
"""In 4.5 the compositor's Image node loses some sockets when another layer is chosen, with Blender's own files too."""

METADATA = {
    "cryptomatte/b608a45/name": "View Layer.CryptoObject",
    "cryptomatte/b608a45/hash": "MurmurHash3_32",
    "cryptomatte/b608a45/conversion": "uint32_to_float32",
    "cryptomatte/b608a45/manifest": '{"ball":"055ec73d"}',
}


def eye(seed):
    random = np.random.default_rng(seed)
    layers = {
        layer: {name: random.random((HEIGHT, WIDTH, count), np.float32) for name, count in CHANNELS.items()}
        for layer in LAYERS
    }
    for passes in layers.values():
        passes["Combined"][..., 3] = 1.0
    return layers


@pytest.fixture
def eyes():
    return {view: eye(seed) for seed, view in enumerate(VIEWS)}


def load(path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    image = bpy.data.images.load(str(path))
    assert len(image.pixels) == 0, "a multilayer picture has none of its own; asking for them loads it"
    return image


def image_node(tree, image):
    node = tree.nodes.new("CompositorNodeImage")
    node.image = image
    return node


def layers_of(node):
    """The names in a menu are told in the complaint about one that is not there."""
    with pytest.raises(TypeError) as raised:
        node.layer = "?"
    return str(raised.value).partition("not found in ")[2]


def passing_on(image, layer, output, channel):
    """A scene whose compositor hands a channel of the image's pass on."""
    scene = bpy.data.scenes.new("compositing")
    tree, end = empty_compositor(scene)
    node = image_node(tree, image)
    if node.layer != layer:
        node.layer = layer
    split = tree.nodes.new("CompositorNodeSeparateColor")
    tree.links.new(node.outputs[output], split.inputs[0])
    tree.links.new(split.outputs[channel], end)
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


def test_blender_finds_all_layers_and_passes_in_both_views(tmp_path, eyes):
    write_stereo(tmp_path / "stereo.exr", eyes, metadata=METADATA)
    image = load(tmp_path / "stereo.exr")
    assert (image.type, image.is_multiview, image.is_stereo_3d) == ("MULTILAYER", True, True)
    tree, _ = empty_compositor(bpy.data.scenes.new("nodes"))
    node = image_node(tree, image)
    assert node.has_views
    assert layers_of(node) == str(LAYERS)
    assert {output.name for output in node.outputs} == {*CHANNELS, "Alpha"}


@pytest.mark.parametrize(("layer", "name"), [(a, b) for a in LAYERS for b in CHANNELS if (a, b) not in OUT_OF_REACH])
def test_blender_s_compositor_has_the_pixels_of_every_pass_in_both_views(tmp_path, eyes, layer, name):
    write_stereo(tmp_path / "stereo.exr", eyes)
    image = load(tmp_path / "stereo.exr")
    shown = composited(passing_on(image, layer, name, 0), tmp_path / "composited.exr")
    assert set(shown) == set(VIEWS)
    for view in VIEWS:
        np.testing.assert_array_equal(shown[view], eyes[view][layer][name][..., 0])


@pytest.mark.parametrize(("name", "channel"), [("Combined", 2), ("Normal", 1), ("Normal", 2), ("Diffuse Color", 1)])
def test_blender_has_the_channels_in_their_order(tmp_path, eyes, name, channel):
    write_stereo(tmp_path / "stereo.exr", eyes)
    image = load(tmp_path / "stereo.exr")
    shown = composited(passing_on(image, LAYERS[0], name, channel), tmp_path / "composited.exr")
    np.testing.assert_array_equal(shown["right"], eyes["right"][LAYERS[0]][name][..., channel])


def test_blender_reads_one_eye_s_file_with_its_layers(tmp_path, eyes):
    """The first layer has no name there; what it shows without being asked is its colour."""
    write_eye(tmp_path / "left.exr", eyes["left"], view="left", metadata=METADATA)
    image = load(tmp_path / "left.exr")
    assert image.type == "MULTILAYER"
    tree, _ = empty_compositor(bpy.data.scenes.new("nodes"))
    node = image_node(tree, image)
    assert LAYERS[1] in layers_of(node)
    assert {output.name for output in node.outputs} == {*CHANNELS, "Alpha"}
    for name in ("Combined", "Depth"):
        scene = bpy.data.scenes.new(name)
        tree, end = empty_compositor(scene)
        tree.links.new(image_node(tree, image).outputs[name], end)
        shown = composited(scene, tmp_path / f"{name}.exr")
        np.testing.assert_array_equal(shown["left"], eyes["left"][LAYERS[0]][name][..., 0])


# Another program


@pytest.fixture(scope="module")
def oiio():
    """OpenImageIO, which Blender brings along but keeps off Python's path."""
    python = f"python{sys.version_info[0]}.{sys.version_info[1]}"
    folder = str(Path(bpy.utils.resource_path("LOCAL"), "python", "lib", python, "site-packages"))
    sys.path.append(folder)
    try:
        yield pytest.importorskip("OpenImageIO")
    finally:
        sys.path.remove(folder)


def subimages(oiio, path):
    """Specification and pixels (H, W, C) of each."""
    file = oiio.ImageInput.open(str(path))
    assert file is not None, oiio.geterror()
    found = []
    while file.seek_subimage(len(found), 0):
        spec = file.spec()
        found.append((spec, np.array(file.read_image(len(found), 0, 0, spec.nchannels, "float"))))
    file.close()
    return found


def test_openimageio_finds_a_named_subimage_for_each_layer_pass_and_view(tmp_path, oiio, eyes):
    write_stereo(tmp_path / "stereo.exr", eyes, metadata=METADATA)
    found = subimages(oiio, tmp_path / "stereo.exr")
    assert len(found) == len(LAYERS) * len(CHANNELS) * len(VIEWS)
    assert [spec.getattribute("view") for spec, _ in found[:2]] == list(VIEWS)
    for spec, pixels in found:
        view = spec.getattribute("view")
        layer, _, name = spec.getattribute("oiio:subimagename").removesuffix(f"-{view}").rpartition(".")
        prefix = "" if (layer, name) == (LAYERS[0], "Combined") else f"{layer}.{name}."
        order = [spec.channelnames.index(f"{prefix}{letter}") for letter in pass_letters(name, CHANNELS[name])]
        np.testing.assert_array_equal(pixels[..., order], eyes[view][layer][name])
    for key, text in METADATA.items():
        assert found[0][0].getattribute(key) == text


def test_openimageio_shows_the_colour_of_the_first_layer_where_no_layer_is_asked_for(tmp_path, oiio, eyes):
    write_stereo(tmp_path / "stereo.exr", eyes)
    write_eye(tmp_path / "right.exr", eyes["right"], view="right")
    for name, view in (("stereo", "left"), ("right", "right")):
        spec, pixels = subimages(oiio, tmp_path / f"{name}.exr")[0]
        assert list(spec.channelnames[:4]) == list("RGBA")
        np.testing.assert_array_equal(pixels[..., :4], eyes[view][LAYERS[0]]["Combined"])
