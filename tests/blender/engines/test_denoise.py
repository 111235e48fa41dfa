"""Pictures denoised apart from their render: what Cycles makes of them is what it makes of a render."""

import numpy as np
import pytest

from stereo_reproject.blender.engines.denoise import denoise_pictures
from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.images.denoising import Denoising
from stereo_reproject.images.passes import ALBEDO_PASS, COLOUR_PASS, NOISY_PASS, NORMAL_PASS
from stereo_reproject.settings.frame import SceneOverrides
from tests.blender.toolbox import (
    add_camera,
    add_cube,
    add_plane,
    add_sun,
    diffuse,
    empty_scene,
    noise_image,
    render_plain,
)

pytestmark = pytest.mark.blender

SIZE = (80, 48)

ROUNDING = 1e-4
"""A denoiser rounds otherwise for its first picture than for its second; noise is a thousand times as large."""


@pytest.fixture
def scene(tmp_path):
    scene = empty_scene(*SIZE, samples=4)
    add_plane(scene, diffuse("wall", image=noise_image(tmp_path)), size=(30, 20), location=(0, 0, -9))
    add_cube(scene, diffuse("box", (0.7, 0.2, 0.1)), size=1.5, location=(0.3, 0.2, -6.0))
    add_sun(scene)
    add_camera(scene)
    scene.cycles.use_denoising = True
    return scene


def as_rendered(scene, tmp_path, seed=5):
    scene.view_layers[0].cycles.denoising_store_passes = True
    return render_plain(scene, tmp_path, seed=seed, views=("left",))["left"]


def picture(passes):
    guides = {ALBEDO_PASS: passes["Denoising Albedo"], NORMAL_PASS: passes["Denoising Normal"]}
    return {NOISY_PASS: passes["Noisy Image"], **guides}


@pytest.mark.parametrize(
    ("prefilter", "inputs"), [("ACCURATE", "RGB_ALBEDO_NORMAL"), ("FAST", "RGB_ALBEDO"), ("NONE", "RGB")]
)
def test_a_picture_comes_out_as_cycles_denoises_a_render(scene, tmp_path, prefilter, inputs):
    scene.cycles.denoising_prefilter, scene.cycles.denoising_input_passes = prefilter, inputs
    rendered = as_rendered(scene, tmp_path)
    assert not np.array_equal(rendered[COLOUR_PASS], rendered["Noisy Image"])
    with working_scene(scene, SceneOverrides()) as working:
        (clean,) = denoise_pictures(working, [picture(rendered)], tmp_path)
    assert np.allclose(clean, rendered[COLOUR_PASS][..., :3], rtol=0.0, atol=ROUNDING)


def test_several_pictures_are_each_denoised_by_themselves(scene, tmp_path):
    rendered = [as_rendered(scene, tmp_path, seed) for seed in (5, 6, 7)]
    with working_scene(scene, SceneOverrides()) as working:
        clean = denoise_pictures(working, [picture(passes) for passes in rendered], tmp_path)
    for ours, passes in zip(clean, rendered, strict=True):
        assert np.allclose(ours, passes[COLOUR_PASS][..., :3], rtol=0.0, atol=ROUNDING)


def test_a_source_is_rendered_noisy_and_becomes_what_a_denoised_render_is(scene, tmp_path):
    plain = render_plain(scene, tmp_path, seed=5, views=("left",))["left"]
    with working_scene(scene, SceneOverrides(seed=5)) as working:
        renderer = BlenderRenderer(working, tmp_path)
        source, _ = renderer.render_source("left")
        assert np.array_equal(source[NOISY_PASS], source[COLOUR_PASS])
        assert not any(name.startswith("Denoising ") for name in source)
        clean = Denoising(renderer.denoise).denoised_colour(source)
    assert np.allclose(clean, plain[COLOUR_PASS], rtol=0.0, atol=ROUNDING)


@pytest.mark.parametrize("denoise", [True, False])
def test_the_option_has_its_way_with_scene_and_layers(scene, tmp_path, denoise):
    scene.cycles.use_denoising = not denoise
    scene.view_layers[0].cycles.use_denoising = not denoise
    with working_scene(scene, SceneOverrides(denoise=denoise)) as working:
        # What one renderer needs must not be taken for the scene's own setting by the next.
        for _ in range(2):
            renderer = BlenderRenderer(working, tmp_path)
            renderer.render_source("left")
            assert (renderer.denoise is not None) == denoise
    assert scene.cycles.use_denoising != denoise


def test_a_layer_that_is_not_to_be_denoised_is_not(scene, tmp_path):
    scene.view_layers[0].cycles.use_denoising = False
    with working_scene(scene, SceneOverrides()) as working:
        assert BlenderRenderer(working, tmp_path).denoise is None


def test_denoising_data_that_the_user_wants_stay(scene, tmp_path):
    scene.view_layers[0].cycles.denoising_store_passes = True
    with working_scene(scene, SceneOverrides()) as working:
        source, _ = BlenderRenderer(working, tmp_path).render_source("left")
    assert {"Noisy Image", "Denoising Albedo", "Denoising Normal", "Denoising Depth"} <= set(source)
