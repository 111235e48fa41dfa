"""A denoised pair: both eyes alike, no noisy holes in a clean picture, and nothing of it where it is not asked for."""

from dataclasses import replace

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.commands.frame import render_files
from stereo_reproject.blender.scene.rig import stereo_cameras
from stereo_reproject.blender.scene.working import evaluated
from stereo_reproject.holes import thin
from stereo_reproject.images.exr import read_eye
from stereo_reproject.images.metrics import noise_ratio, squared_error, tone
from stereo_reproject.images.passes import COLOUR_PASS
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from tests.blender.snapshot import everything
from tests.blender.toolbox import (
    add_cube,
    add_plane,
    diffuse,
    mirror_before_wall,
    noise_image,
    px_from_world,
    render_plain,
)

pytestmark = pytest.mark.blender

SIZE = (160, 90)

AS_GOOD = 1.5
"""Noise ratio of a picture of 14 400 pixels at `balanced`, which promises 1.1: between two seeds the noise that a
denoiser leaves is no more alike than that, and a tile here is a hundredth of the picture."""

ROUNDING = 1e-4
"""A denoiser that has denoised before rounds otherwise than for its first picture."""

STEP = 1.15
"""How much larger the step from a traced pixel to a warped one may be than in the same place of a plain render: mean
of three seeds, of which each gives 0.99 to 1.20."""


@pytest.fixture
def scene(tmp_path):
    scene = mirror_before_wall(*SIZE, samples=16)
    wall = diffuse("paper", image=noise_image(tmp_path))
    add_cube(scene, wall, size=1.2, location=(-1.6, 0.6, -5.0))
    scene.cycles.use_denoising = True
    return scene


def pair(scene, tmp_path, *, seed=1, **overrides):
    (tmp_path / "work").mkdir()
    settings = StereoSettings(fill="packed", scene=SceneOverrides(seed=seed, **overrides))
    report, _ = render_files(scene, settings, tmp_path / "work")
    eyes = {v: next(iter(read_eye(tmp_path / "work" / "out" / f"{v}.exr").values())) for v in ("left", "right")}
    return eyes, report


def steps(colour, traced):
    """Differences between neighbours of which one was traced and the other not."""
    toned, border = tone(colour), traced[:, 1:] != traced[:, :-1]
    return np.abs(np.diff(toned, axis=1)).mean(axis=-1)[border].mean()


def test_both_eyes_come_out_denoised(scene, tmp_path):
    scene.view_layers[0].update()
    before = everything()
    eyes, report = pair(scene, tmp_path)
    assert everything() == before
    left = render_plain(scene, tmp_path, seed=1, views=("left",))["left"][COLOUR_PASS]
    a, b = (render_plain(scene, tmp_path, seed=seed, views=("right",))["right"][COLOUR_PASS] for seed in (11, 12))
    assert np.allclose(eyes["left"][COLOUR_PASS], left, rtol=0.0, atol=ROUNDING)
    assert noise_ratio(eyes["right"][COLOUR_PASS], a, b) < AS_GOOD
    assert report["seconds"]["denoise_source"] > 0.0
    assert report["seconds"]["denoise_target"] > 0.0
    assert report["fractions"]["rerendered"] < 0.8
    assert not any(name.startswith((".", "Denoising", "Noisy")) for name in eyes["right"])


def test_no_seam_shows_around_what_was_traced(scene, tmp_path):
    from stereo_reproject.blender.output.pictures import COLOURS, read_png

    plain = render_plain(scene, tmp_path, seed=11, views=("right",))["right"][COLOUR_PASS]
    larger = []
    for seed in (1, 2, 3):
        folder = tmp_path / str(seed)
        folder.mkdir()
        eyes, _ = pair(scene, folder, seed=seed)
        shown = np.round(255.0 * read_png(folder / "work" / "out" / "holes.png")[: SIZE[1]]).astype(int)
        traced = np.any([np.all(shown == colour, axis=-1) for colour in COLOURS.values()], axis=0)
        assert 0.02 < traced.mean() < 0.9
        larger.append(steps(eyes["right"][COLOUR_PASS], traced) / steps(plain, traced))
    assert np.mean(larger) < STEP


def test_without_denoising_nothing_of_it_happens(scene, tmp_path):
    eyes, report = pair(scene, tmp_path, denoise=False)
    scene.cycles.use_denoising = False
    left = render_plain(scene, tmp_path, seed=1, views=("left",))["left"][COLOUR_PASS]
    assert np.array_equal(eyes["left"][COLOUR_PASS], left)
    assert not [stage for stage in report["seconds"] if stage.startswith("denoise")]


def test_the_option_denoises_a_scene_that_does_not(scene, tmp_path):
    scene.cycles.use_denoising = scene.view_layers[0].cycles.use_denoising = False
    eyes, _ = pair(scene, tmp_path, denoise=True)
    noisy = render_plain(scene, tmp_path, seed=1, views=("left",))["left"][COLOUR_PASS]
    assert not np.array_equal(eyes["left"][COLOUR_PASS], noisy)
    assert not scene.cycles.use_denoising


def test_denoising_data_come_out_for_both_eyes(scene, tmp_path):
    scene.view_layers[0].cycles.denoising_store_passes = True
    eyes, _ = pair(scene, tmp_path)
    for passes in eyes.values():
        assert {"Noisy Image", "Denoising Albedo", "Denoising Normal", "Denoising Depth"} <= set(passes)
        assert np.all(np.isfinite(passes["Noisy Image"]))
        assert not np.array_equal(passes["Noisy Image"], passes[COLOUR_PASS])


@pytest.mark.parametrize("fill", ["card", "full"])
def test_other_ways_to_trace_are_denoised_too(scene, tmp_path, fill):
    """Of matte things alone: a mirror would need more probes than a card of this size has."""
    bpy.data.objects.remove(next(item for item in scene.objects if item.name.startswith("Sphere")))
    (tmp_path / "work").mkdir()
    render_files(scene, StereoSettings(fill=fill, scene=SceneOverrides(seed=1)), tmp_path / "work")
    right = next(iter(read_eye(tmp_path / "work" / "out" / "right.exr").values()))[COLOUR_PASS]
    a, b = (render_plain(scene, tmp_path, seed=seed, views=("right",))["right"][COLOUR_PASS] for seed in (11, 12))
    assert noise_ratio(right, a, b) < AS_GOOD


def test_a_cord_that_the_depth_misses_is_not_carried_aside(scene, tmp_path, monkeypatch):
    """A third of a pixel wide, between the centres of the left eye's pixels: that is where its depth is sampled."""
    for item in [item for item in scene.objects if item.name.startswith(("Sphere", "Cube"))]:
        bpy.data.objects.remove(item)
    left = stereo_cameras(evaluated(scene.camera, scene), scene.render)["left"]
    places = np.column_stack([np.linspace(-0.7, -0.6, 50), np.zeros(50), np.full(50, -5.0)])
    columns = px_from_world(left, places)[0]
    nearest = np.argmin(np.abs(columns - np.round(columns)))
    add_plane(scene, diffuse("wire", (0.01, 0.01, 0.01)), size=(0.008, 2.0), location=tuple(places[nearest]))
    plain = render_plain(scene, tmp_path, seed=11, views=("right",))["right"][COLOUR_PASS]
    beside = np.s_[20:70, round(columns[nearest]) - 6 : round(columns[nearest]) + 6]
    errors = {}
    for name, threshold in (("found", thin.TUNING.thin_step_pixels), ("missed", np.inf)):
        monkeypatch.setattr(thin, "TUNING", replace(thin.TUNING, thin_step_pixels=threshold))
        (tmp_path / name).mkdir()
        eyes, _ = pair(scene, tmp_path / name)
        errors[name] = squared_error(eyes["right"][COLOUR_PASS], plain)[beside].mean()
    assert errors["found"] < 0.3 * errors["missed"]
