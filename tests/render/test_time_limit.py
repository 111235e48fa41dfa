"""A scene with a time limit: both eyes have the samples that there was time for, and so has multiview."""

import numpy as np
import pytest

from stereo_reproject.blender.commands.frame import render_files
from stereo_reproject.blender.engines.render import render_views
from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.engines.time_limit import COUNTS, TILED, without_time_limit
from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.images.metrics import tone
from stereo_reproject.images.passes import COLOUR_PASS, cryptomatte_of
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from stereo_reproject.trace.requests import TraceRequest
from tests.blender.toolbox import (
    add_camera,
    add_plane,
    add_sphere,
    add_sun,
    diffuse,
    empty_scene,
    noise_image,
    rms,
    set_background,
)

SIZE = (32, 18)
LIMIT = 0.4
SAMPLES = 1 << 15
"""So many that without the limit a picture would take half a minute."""

THRESHOLD = 0.0002
"""Of adaptive sampling: only the sky, which has no noise, reaches it within the limit, on a fast machine too."""

ADAPTIVE_FROM = 128
"""Samples that each pixel has with that threshold."""

ALIKE = 1.3
"""Of two noise levels, of 576 pixels each."""


@pytest.fixture
def scene(tmp_path):
    """A ball before a wall, and some sky, where adaptive sampling stops early."""
    scene = empty_scene(*SIZE, samples=SAMPLES)
    scene.cycles.time_limit = LIMIT
    set_background(scene, 0.5)
    add_plane(scene, diffuse(image=noise_image(tmp_path)), size=(30, 5), location=(0, -2, -9))
    add_sphere(scene, diffuse("ball", (0.9, 0.5, 0.3)), radius=1.4, location=(0.3, 0.2, -6.0))
    add_sun(scene)
    add_camera(scene, interocular=0.3)
    return scene


@pytest.mark.parametrize("threshold", [None, THRESHOLD])
def test_traced_with_the_samples_of_the_source(scene, tmp_path, threshold):
    """To the bit: a render of as many samples, without the limit, is what the limit has left."""
    scene.cycles.use_adaptive_sampling = threshold is not None
    scene.cycles.adaptive_threshold = threshold or 0.0
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, tmp_path)
        source, _ = renderer.render_source("left")
        samples = renderer.samples_rendered
        assert samples is not None
        assert 8 <= samples < SAMPLES
        with without_time_limit(working, samples):
            again = render_views(working, ("left",), tmp_path, seed=renderer.seed).views["left"]
        assert np.array_equal(again[COLOUR_PASS], source[COLOUR_PASS])
        if threshold is not None and samples > 2 * ADAPTIVE_FROM:
            assert again[COUNTS].min() < 1.0, "some pixels stop early"
        assert COUNTS not in source
        assert not any(map(cryptomatte_of, source)), "only what the user has asked for"
        everything = np.ones(SIZE[::-1], bool)
        traced = renderer.trace("packed", [TraceRequest("left", everything)])[0][COLOUR_PASS]
        traced = traced.reshape(source[COLOUR_PASS].shape)
        with without_time_limit(working, samples):
            other = render_views(working, ("left",), tmp_path, seed=7).views["left"][COLOUR_PASS]
        noise = rms(other - source[COLOUR_PASS])
        assert noise / ALIKE < rms(traced - source[COLOUR_PASS]) < noise * ALIKE
        assert working.cycles.time_limit == pytest.approx(LIMIT)
        assert not working.cycles.use_sample_subset


def test_the_peer_has_it_too_and_the_report_says_so(scene, tmp_path):
    with working_scene(scene, SceneOverrides()) as working:
        limited = [render_views(working, ("right",), tmp_path, seed=k).views["right"][COLOUR_PASS] for k in (5, 6)]
    report, _ = render_files(scene, StereoSettings(fill="packed", compare=True), tmp_path, files=())
    assert report["samples"] == SAMPLES
    assert report["time_limit"] == pytest.approx(LIMIT)
    assert 8 <= report["samples_rendered"] < SAMPLES
    # With all samples it would have a tenth of the noise, or less. How many there is time for depends on the machine.
    assert report["compare"]["noise_rmse"] > rms(tone(limited[0]) - tone(limited[1])) / 5.0
    assert scene.cycles.time_limit == pytest.approx(LIMIT)


def test_a_limit_that_is_not_reached(scene, tmp_path):
    scene.cycles.samples, scene.cycles.time_limit = 2, 60.0
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, tmp_path)
        renderer.render_source("left")
        assert renderer.samples_rendered == 2


def test_tiles_have_samples_of_their_own(scene, tmp_path):
    """Nobody knows with how many a pixel is to be traced: the other eye is rendered whole, with the limit."""
    scene.cycles.use_auto_tile, scene.cycles.tile_size = True, 16
    report, _ = render_files(scene, StereoSettings(), tmp_path, files=())
    assert report["fill"]["method"] == "full"
    assert TILED in report["fill"]["reason"]
    assert report["samples_rendered"] is None
