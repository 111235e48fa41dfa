"""What a flat mirror shows, as Cycles renders it: carried by its image, and hardly traced."""

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.holes import reprojection
from stereo_reproject.images.metrics import squared_error
from stereo_reproject.images.passes import COLOUR_PASS, LENGTH_PASS, REFLECTANCE_PASS, SOURCE_ONLY_PASSES
from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from stereo_reproject.trace.requests import TraceRequest
from tests.blender.toolbox import (
    Material,
    add_camera,
    add_cube,
    add_plane,
    diffuse,
    emission,
    empty_scene,
    noise_image,
    render_plain,
    set_background,
)

pytestmark = pytest.mark.blender

SIZE, SMALL = (160, 90), (64, 36)
MIRROR, BEHIND = 5.0, 3.0
"""How far before the camera the mirror is, and how far behind it what is seen there."""

UNSEEN = 2.0 / 255.0
"""Root mean square error of what hardly anybody sees; the poster has next to no noise."""

GREY = 0.6

WITHIN_NOISE = 1.5
"""Squared error against a plain render, over that of a second plain render, of what is warped as it should be."""


@pytest.fixture
def scene(tmp_path):
    """A dark mirror in a wall, which shows a poster behind the camera, a box before it, and the sky beside it."""
    return mirror_in_wall(tmp_path)


@pytest.fixture
def noisy(tmp_path):
    """The same, small and not denoised."""
    scene = mirror_in_wall(tmp_path, size=SMALL, samples=4, interocular=0.4, poster_texels=8)
    scene.cycles.use_denoising = False
    return scene


def mirror_in_wall(tmp_path, *, size=SIZE, samples=32, interocular=0.2, poster_texels=24, roughness=0.0):
    scene = empty_scene(*size, samples=samples)
    scene.cycles.use_denoising = True
    set_background(scene, 0.5)
    mirror = Material("mirror")
    mirror.surface(mirror.node("BsdfGlossy", Color=(GREY, GREY, GREY, 1.0), Roughness=roughness))
    add_plane(scene, mirror, size=(2.6, 1.5), location=(0, 0, -MIRROR))
    add_plane(scene, diffuse("wall"), size=(12, 8), location=(0, 0, -MIRROR - 0.02))
    poster = emission("poster", image=noise_image(tmp_path, size=poster_texels))
    add_plane(scene, poster, size=(6.0, 5.0), location=(1.0, 0, BEHIND), rotation=(0.0, np.pi, 0.0))
    add_cube(scene, diffuse("box", (0.8, 0.3, 0.2)), size=0.8, location=(0.9, -0.2, 1.0))
    add_camera(scene, interocular=interocular, convergence=MIRROR)
    return scene


def pair(scene, folder, *, seed=1, **settings):
    settings = StereoSettings(fill="packed", scene=SceneOverrides(seed=seed), **settings)
    folder.mkdir()
    with working_scene(scene, settings.scene) as working:
        return render_stereo_frame(BlenderRenderer(working, folder), settings)


def source_of(scene, folder):
    folder.mkdir()
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, folder)
        return renderer.render_source("left")[0], renderer.cameras["left"], renderer.lens


def in_mirror(width, height):
    """(H, W): the mirror's pixels in the right eye, but for its rim."""
    mask = np.zeros((height, width), bool)
    mask[round(0.28 * height) : round(0.72 * height), round(0.28 * width) : round(0.72 * width)] = True
    return mask


def test_what_a_mirror_shows_is_carried_by_its_image(scene, tmp_path, monkeypatch):
    truth, inner = render_plain(scene, tmp_path, seed=11, views=("right",))["right"][COLOUR_PASS], in_mirror(*SIZE)
    # In so small a picture a single probe may have half of the mirror traced, or nothing of it.
    frames = [pair(scene, tmp_path / f"images {seed}", seed=seed) for seed in (1, 2, 3)]
    monkeypatch.setattr(reprojection, "images_in_mirrors", lambda *_, **__: None)
    by_surface = pair(scene, tmp_path / "surface")
    traced = np.median([frame.traced[inner].mean() for frame in frames])
    assert traced < 0.5 * by_surface.traced[inner].mean()
    for frame in frames:
        assert np.sqrt(squared_error(frame.eyes["right"][COLOUR_PASS], truth)[inner].mean()) < UNSEEN


@pytest.mark.parametrize("source", ["left", "right"])
def test_what_is_carried_is_what_the_other_eye_sees(scene, tmp_path, monkeypatch, source):
    """Before anything is refined: nothing is traced but holes."""
    target = {"left": "right", "right": "left"}[source]
    truth = render_plain(scene, tmp_path, seed=11, views=(target,))[target][COLOUR_PASS]
    inner, errors = in_mirror(*SIZE), {}
    for name in ("images", "surface"):
        if name == "surface":
            monkeypatch.setattr(reprojection, "images_in_mirrors", lambda *_, **__: None)
        frame = pair(scene, tmp_path / name, accuracy="draft", source=source)
        kept = inner & ~frame.traced
        assert kept.sum() > 0.4 * inner.sum()
        errors[name] = squared_error(frame.eyes[target][COLOUR_PASS], truth)[kept].mean()
    assert errors["images"] < 0.1 * errors["surface"]


def test_an_image_stands_as_far_behind_a_dark_mirror(scene, tmp_path):
    source, camera, lens = source_of(scene, tmp_path / "w")
    found = reprojection.images_in_mirrors(source, camera, clip_start=lens.near)
    assert np.allclose(source[REFLECTANCE_PASS][in_mirror(*SIZE)], GREY, atol=0.02)
    poster = np.s_[35:40, 70:75]
    assert np.allclose(found.depth[poster], 2.0 * MIRROR + BEHIND, rtol=0.01)
    assert np.isposinf(found.depth).any()


def test_the_pass_that_was_switched_on_is_not_delivered(scene, tmp_path):
    frame = pair(scene, tmp_path / "w")
    assert not [name for name in frame.eyes["right"] if "Gloss" in name or name.startswith(".")]
    scene.view_layers[0].use_pass_glossy_color = True
    asked = pair(scene, tmp_path / "v")
    assert len([name for name in asked.eyes["right"] if "Gloss" in name]) == 1


def test_a_denoiser_that_is_not_told_of_reflections_tells_of_no_mirror(scene, tmp_path):
    cycles = scene.view_layers[0].cycles
    if bpy.app.version < (5, 0):
        assert not hasattr(cycles, "denoising_pass_follow_reflections"), "it can be switched off after all"
        return
    cycles.denoising_pass_follow_reflections = False
    source, *_ = source_of(scene, tmp_path / "w")
    assert LENGTH_PASS not in source


# Noisy pictures


@pytest.mark.parametrize("source", ["left", "right"])
def test_in_a_noisy_picture_too_a_mirror_is_warped_by_its_image(noisy, tmp_path, monkeypatch, source):
    target = {"left": "right", "right": "left"}[source]
    truth, again = (render_plain(noisy, tmp_path, seed=seed, views=(target,))[target][COLOUR_PASS] for seed in (11, 12))
    ratios = {}
    for name in ("images", "surface"):
        if name == "surface":
            monkeypatch.setattr(reprojection, "images_in_mirrors", lambda *_, **__: None)
        frame = pair(noisy, tmp_path / name, accuracy="draft", source=source)
        kept = in_mirror(*SMALL) & ~frame.traced
        assert kept.sum() > 0.4 * in_mirror(*SMALL).sum()
        error = squared_error(frame.eyes[target][COLOUR_PASS], truth)[kept].mean()
        ratios[name] = error / squared_error(again, truth)[kept].mean()
    assert ratios["images"] < WITHIN_NOISE < 3.0 * WITHIN_NOISE < ratios["surface"]


def test_in_a_noisy_picture_too_little_of_a_mirror_is_traced(noisy, tmp_path, monkeypatch):
    traced = {}
    for name in ("images", "surface"):
        if name == "surface":
            monkeypatch.setattr(reprojection, "images_in_mirrors", lambda *_, **__: None)
        traced[name] = pair(noisy, tmp_path / name).traced[in_mirror(*SMALL)].mean()
    assert traced["images"] < 0.7 * traced["surface"]


def test_a_noisy_source_is_to_the_bit_what_blender_renders_with_the_passes_that_were_asked_for(noisy, tmp_path):
    noisy.view_layers[0].use_pass_normal = noisy.view_layers[0].cycles.denoising_store_passes = True
    plain = render_plain(noisy, tmp_path, seed=1, views=("left",))["left"]
    frame = pair(noisy, tmp_path / "w")
    assert set(frame.eyes["left"]) == set(frame.eyes["right"]) == set(plain)
    for name, image in plain.items():
        np.testing.assert_array_equal(frame.eyes["left"][name], image, err_msg=name)


def test_a_noisy_pair_has_no_pass_that_was_not_asked_for(noisy, tmp_path):
    plain = render_plain(noisy, tmp_path, seed=1, views=("left",))["left"]
    frame = pair(noisy, tmp_path / "w")
    assert set(frame.eyes["left"]) == set(frame.eyes["right"]) == set(plain) == {COLOUR_PASS, "Depth"}
    np.testing.assert_array_equal(frame.eyes["left"][COLOUR_PASS], plain[COLOUR_PASS])


def rough(scene):
    bpy.data.materials["mirror"].node_tree.nodes["Glossy BSDF"].inputs["Roughness"].default_value = 0.5


def blurred(scene):
    scene.camera.data.dof.use_dof = True


def small(scene):
    """The mirror takes a fiftieth of the picture: less than the passes about it cost."""
    mirror = next(item for item in scene.objects if item.type == "MESH" and item.material_slots[0].name == "mirror")
    mirror.scale = [0.3 * size for size in mirror.scale]


@pytest.mark.parametrize("without", [rough, blurred, small])
def test_a_noisy_scene_without_an_image_to_be_found_is_rendered_with_no_pass_more(noisy, tmp_path, without):
    without(noisy)
    with working_scene(noisy, SceneOverrides()) as working:
        layer = working.view_layers[0]
        source, _ = BlenderRenderer(working, tmp_path).render_source("left")
        switched_on = layer.use_pass_glossy_color, layer.use_pass_normal, layer.cycles.denoising_store_passes
        assert not any(switched_on)
    assert not set(SOURCE_ONLY_PASSES) & set(source)


def test_passes_stay_on_from_frame_to_frame_and_are_never_delivered(noisy, tmp_path):
    """In the second frame the mirror is rough, and nothing calls for them."""
    with working_scene(noisy, SceneOverrides()) as working:
        first, _ = BlenderRenderer(working, tmp_path).render_source("left")
        rough(working)
        renderer = BlenderRenderer(working, tmp_path)
        second, _ = renderer.render_source("left")
        assert working.view_layers[0].use_pass_normal
        asked = np.ones(SMALL[::-1], bool)
        (traced,) = renderer.trace("packed", [TraceRequest("right", asked)])
    assert LENGTH_PASS in first
    assert not set(SOURCE_ONLY_PASSES) & set(second)
    assert set(traced) - {"Depth", COLOUR_PASS} == {name for name in traced if name.startswith("Crypto")}
    assert not {"Normal", "Denoising Depth", "Denoising Albedo", REFLECTANCE_PASS} & set(second)
