"""A comparison with multiview: by the weight of each pixel, and without FLIP where that cannot be had."""

import sys

import numpy as np
import pytest

from stereo_reproject.blender.commands.compare import MultiviewReference, flips, render_reference, seen_pictures
from stereo_reproject.images.metrics import rmse
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from stereo_reproject.views.solid_angle import pixel_weights
from tests.blender.toolbox import add_camera, add_sphere, emission, empty_scene
from tests.views.test_cutouts import VR360, camera


@pytest.fixture
def reference():
    """Multiview's eye in a whole turn: grey, and with another seed lighter or darker by chance."""
    eye, rng = camera(VR360), np.random.default_rng(1)
    grey = np.full((eye.height, eye.width, 4), 0.2, np.float32)
    grey[..., 3] = 1.0
    again = grey.copy()
    again[..., :3] *= rng.uniform(0.8, 1.2, again[..., :3].shape)
    return MultiviewReference("CYCLES", 1.0, grey, again, 1.0, {}, pixel_weights(eye))


def test_pixels_at_a_pole_count_for_little(reference, tmp_path):
    ours = reference.reference.copy()
    poles = np.asarray(reference.pixel_weight)[:, 0] < 0.3
    ours[poles, :, :3] *= 4.0
    scene = empty_scene()
    add_camera(scene)
    seen = seen_pictures(scene, StereoSettings(), ours, reference, tmp_path)
    assert seen.flips() == flips(scene, StereoSettings(), ours, reference, tmp_path)
    error, _ = seen.flips()
    # FLIP looks at what is around a pixel too, but not far: the error is that of the pixels at the poles.
    alike = MultiviewReference("CYCLES", 1.0, reference.reference, reference.again, 1.0)
    unweighted, _ = flips(scene, StereoSettings(), ours, alike, tmp_path)
    assert 0.0 < error < 0.6 * unweighted


FLAT = 5e-3
"""Relative: a pixel of six degrees, as flat as it is taken to be, is by so much smaller than the curved one."""


def test_a_panorama_is_judged_by_what_its_pixels_show(tmp_path):
    """Both eyes that multiview renders: their rows count by the cosine of their altitude."""
    scene = empty_scene(8, 8, samples=1)
    add_sphere(scene, emission(colour=(0.5, 0.5, 0.5)), radius=3.0, location=(0, 0, 0))
    add_camera(scene)
    settings = StereoSettings(scene=SceneOverrides(panorama="vr180", size=(32, 32)))
    target = render_reference(scene, settings, tmp_path, light_scale=1.0, both=True)
    cosine = np.cos((0.5 - (np.arange(32) + 0.5) / 32) * np.pi)
    for eye in (target, target.first):
        ours = eye.reference.copy()
        ours[:5, :, :3] *= 4.0
        alike = rmse(ours, eye.reference)
        found = eye.judge(ours, np.ones((32, 32), np.float32))["rmse"]
        assert found == pytest.approx(alike * np.sqrt(cosine[:5].sum() / cosine.sum() * 32 / 5), rel=FLAT)
        assert found < 0.7 * alike


FILM_GREY = 0.18
"""Scene-linear grey over which a transparent film is judged where light counts as it is."""

PNG_STEP = 0.01
"""Of FLIP: two ways to the same colour may round to neighbouring values of 8 bits."""


def test_flip_sees_a_black_thing_whose_alpha_is_wrong_as_over_opaque_grey(tmp_path):
    """Light is nothing everywhere: only the grey that shows through tells the pictures apart."""
    rendered = np.zeros((48, 64, 4), np.float32)
    rendered[12:36, 16:48, 3] = 1.0
    again, ours = rendered.copy(), rendered.copy()
    again[12, 16:48, 3] = 0.8
    ours[12:36, 16:48, 3] = 0.7

    def on_grey(picture):
        return np.concatenate([FILM_GREY * (1.0 - picture[..., 3:]).repeat(3, 2), np.ones_like(picture[..., 3:])], 2)

    scene = empty_scene()
    add_camera(scene)
    scene.render.film_transparent = True
    film = MultiviewReference("CYCLES", 1.0, rendered, again, 1.0)
    flip, noise_flip = flips(scene, StereoSettings(), ours, film, tmp_path)
    assert flip > 0.1
    assert 0.0 < noise_flip < flip
    solid = MultiviewReference("CYCLES", 1.0, on_grey(rendered), on_grey(again), 1.0)
    expected = flips(scene, StereoSettings(), on_grey(ours), solid, tmp_path)
    assert (flip, noise_flip) == pytest.approx(expected, abs=PNG_STEP)


def test_a_broken_flip_is_none(reference, tmp_path, monkeypatch):
    """One that is found and cannot be imported, as where a library that it needs is missing."""
    (tmp_path / "flip_evaluator.py").write_text('raise ImportError("libGL.so.1: cannot open shared object file")')
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "flip_evaluator", raising=False)
    assert flips(empty_scene(), StereoSettings(), reference.reference, reference, tmp_path) == (None, None)
    assert seen_pictures(empty_scene(), StereoSettings(), reference.reference, reference, tmp_path) is None
