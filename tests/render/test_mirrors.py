"""What a flat mirror shows, as Cycles renders it: carried by its image, and hardly traced."""

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.holes import reprojection
from stereo_reproject.images.metrics import squared_error
from stereo_reproject.images.passes import COLOUR_PASS, LENGTH_PASS, REFLECTANCE_PASS
from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
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

SIZE = (160, 90)
MIRROR, BEHIND = 5.0, 3.0
"""How far before the camera the mirror is, and how far behind it what is seen there."""

UNSEEN = 2.0 / 255.0
"""Root mean square error of what hardly anybody sees; the poster has next to no noise."""

GREY = 0.6


@pytest.fixture
def scene(tmp_path):
    """A dark mirror in a wall, which shows a poster behind the camera, a box before it, and the sky beside it."""
    scene = empty_scene(*SIZE, samples=32)
    scene.cycles.use_denoising = True
    set_background(scene, 0.5)
    mirror = Material("mirror")
    mirror.surface(mirror.node("BsdfGlossy", Color=(GREY, GREY, GREY, 1.0), Roughness=0.0))
    add_plane(scene, mirror, size=(2.6, 1.5), location=(0, 0, -MIRROR))
    add_plane(scene, diffuse("wall"), size=(12, 8), location=(0, 0, -MIRROR - 0.02))
    poster = emission("poster", image=noise_image(tmp_path, size=24))
    add_plane(scene, poster, size=(6.0, 5.0), location=(1.0, 0, BEHIND), rotation=(0.0, np.pi, 0.0))
    add_cube(scene, diffuse("box", (0.8, 0.3, 0.2)), size=0.8, location=(0.9, -0.2, 1.0))
    add_camera(scene, interocular=0.2, convergence=MIRROR)
    return scene


def pair(scene, folder, **settings):
    settings = StereoSettings(fill="packed", scene=SceneOverrides(seed=1), **settings)
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
    mask[25:65, 45:115] = True
    return mask


def test_what_a_mirror_shows_is_carried_by_its_image(scene, tmp_path, monkeypatch):
    truth, inner = render_plain(scene, tmp_path, seed=11, views=("right",))["right"][COLOUR_PASS], in_mirror(*SIZE)
    frame = pair(scene, tmp_path / "images")
    monkeypatch.setattr(reprojection, "images_in_mirrors", lambda *_, **__: None)
    by_surface = pair(scene, tmp_path / "surface")
    assert frame.traced[inner].mean() < 0.5 * by_surface.traced[inner].mean()
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
