"""Both views of what Blender shows come back as arrays: of the Render Result, and of a file with two views."""

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.output.delivery import deliver_to_result
from stereo_reproject.blender.output.saved_views import linear_views, shown_views
from stereo_reproject.errors import BadInputError
from stereo_reproject.images.exr import VIEWS, write_stereo
from stereo_reproject.images.passes import COLOUR_PASS
from tests.blender.snapshot import everything
from tests.blender.toolbox import add_camera, empty_scene

WIDTH, HEIGHT = 48, 27

ROUNDING = 0.51 / 255.0
"""A value of 8 bits: half a step, and a little for the arithmetic before it."""


@pytest.fixture
def scene():
    scene = empty_scene(WIDTH, HEIGHT, samples=1)
    add_camera(scene)
    # In a scene that never had another format, Blender has no name for an unused colour space: it sets one then.
    for file_format in ("OPEN_EXR", "PNG"):
        scene.render.image_settings.file_format = file_format
    return scene


@pytest.fixture
def eyes(scene):
    """Noise from 0 to 3 in both views, transparent in the upper half, with depth, for every view layer."""
    rng = np.random.default_rng(4)
    found = {}
    for view in VIEWS:
        colour = rng.uniform(0.0, 3.0, (HEIGHT, WIDTH, 4)).astype(np.float32)
        colour[..., 3] = 1.0
        colour[: HEIGHT // 2] *= 0.25
        passes = {COLOUR_PASS: colour, "Depth": np.ones((HEIGHT, WIDTH, 1), np.float32)}
        found[view] = {layer.name: passes for layer in scene.view_layers}
    return found


def colours(eyes):
    return {view: next(iter(layers.values()))[COLOUR_PASS] for view, layers in eyes.items()}


def render_result():
    return next(image for image in bpy.data.images if image.type == "RENDER_RESULT")


def test_the_render_result_s_views_are_the_delivered_eyes_and_the_scene_is_as_it_was(scene, eyes, tmp_path):
    deliver_to_result(scene, eyes)
    before = everything()
    found = linear_views(scene, render_result(), tmp_path)
    assert everything() == before
    for view, colour in colours(eyes).items():
        np.testing.assert_array_equal(found[view], colour)


def test_a_file_with_two_views_gives_both(scene, eyes, tmp_path):
    write_stereo(tmp_path / "stereo.exr", eyes)
    found = linear_views(scene, bpy.data.images.load(str(tmp_path / "stereo.exr")), tmp_path)
    for view, colour in colours(eyes).items():
        np.testing.assert_array_equal(found[view], colour)


def test_shown_views_have_the_view_transform_and_black_behind_what_is_transparent(scene, eyes, tmp_path):
    scene.render.film_transparent = True
    scene.view_settings.view_transform = "Raw"
    for layers in eyes.values():
        for passes in layers.values():
            passes[COLOUR_PASS] /= 3.0
            passes[COLOUR_PASS][..., 3] = 1.0
    deliver_to_result(scene, eyes)
    raw = shown_views(scene, render_result(), tmp_path)
    for view, colour in colours(eyes).items():
        assert raw[view].shape == (HEIGHT, WIDTH, 3)
        np.testing.assert_allclose(raw[view], colour[..., :3], atol=ROUNDING)
    scene.view_settings.view_transform = "Standard"
    standard = shown_views(scene, render_result(), tmp_path)
    # sRGB's curve lifts the middle greys.
    assert standard["left"].mean() > raw["left"].mean() + 0.05


def test_a_view_s_own_suffix_and_an_own_format_are_no_matter_and_stay(scene, eyes, tmp_path):
    deliver_to_result(scene, eyes)
    for view in scene.render.views:
        view.file_suffix = "_same"
    scene.render.image_settings.file_format = "JPEG"
    found = linear_views(scene, render_result(), tmp_path)
    assert np.abs(found["left"] - found["right"]).mean() > 0.0
    assert {view.file_suffix for view in scene.render.views} == {"_same"}
    assert scene.render.image_settings.file_format == "JPEG"


def test_one_view_is_no_pair(scene, tmp_path):
    bpy.ops.render.render()
    with pytest.raises(BadInputError, match="no stereo pair"):
        linear_views(scene, render_result(), tmp_path)


def test_what_is_stored_with_a_view_transform_gets_no_second_one(scene, tmp_path):
    """Both eyes in one file of bytes, which Blender 5.2 takes apart without their colour space."""
    greys = {"left": 51, "right": 204}
    pixels = np.ones((4, 2, 8, 4), np.float32)
    pixels[..., :3] = np.array([*greys.values()], np.float32)[:, None, None] / 255.0
    image = bpy.data.images.new("stored", 16, 4)
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = str(tmp_path / "stored.png"), "PNG"
    image.save()
    opened = bpy.data.images.load(str(tmp_path / "stored.png"))
    scene.render.use_multiview = True
    opened.use_multiview, opened.views_format = True, "STEREO_3D"
    opened.stereo_3d_format.display_mode = "SIDEBYSIDE"
    view, display = scene.view_settings, scene.display_settings
    display.display_device, view.view_transform, view.look, view.exposure = "Display P3", "AgX", "AgX - Punchy", 1.0
    shown, linear = shown_views(scene, opened, tmp_path), linear_views(scene, opened, tmp_path)
    for name, grey in greys.items():
        np.testing.assert_allclose(shown[name], grey / 255.0, atol=1e-6)
        light = (grey / 255.0 + 0.055) ** 2.4 / 1.055**2.4
        np.testing.assert_allclose(linear[name][..., :3], light, rtol=1e-5)
        np.testing.assert_array_equal(linear[name][..., 3], 1.0)
    now = display.display_device, view.view_transform, view.look, view.exposure
    assert now == ("Display P3", "AgX", "AgX - Punchy", 1.0)
