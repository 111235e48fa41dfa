"""Frames of stored renders: what they are made of, what judges them, and what a file keeps."""

from pathlib import Path

import numpy as np
import pytest

from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.images.passes import COLOUR_PASS
from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.pipeline.stereo_frame import colour
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from tests.bench.stored_pairs import pair_of
from tests.bench.stored_renders import RENDERS, StoredRenderers, StoredRenders
from tests.blender.toolbox import mirror_before_wall

pytestmark = pytest.mark.blender

PLACE = 1


@pytest.fixture(scope="module", params=[False, True], ids=["noisy", "denoised"])
def stored(request, tmp_path_factory):
    folder = Path(tmp_path_factory.mktemp("stored"))
    scene = mirror_before_wall(64, 36, samples=2)
    with working_scene(scene, SceneOverrides(denoise=request.param)) as working:
        renders = StoredRenders.of_scene(working, folder, folder / "kept.npz")
        yield renders, StoredRenderers(working, folder, renders), folder, request.param


def test_a_frame_has_the_pixels_of_one_render_where_it_was_traced(stored):
    renders, renderers, _, denoised = stored
    settings = StereoSettings(accuracy="draft", fill="packed")
    frame = render_stereo_frame(renderers.at(PLACE), settings)
    assert 0.0 < frame.traced.mean() < 0.5
    ours, once = colour(frame.eyes[settings.target]), renders.targets[PLACE % RENDERS][COLOUR_PASS]
    same = np.isclose(ours, once, rtol=1e-5, atol=1e-7).all(axis=-1)
    # What is denoised is like no render's pixel.
    assert same[frame.traced].all() != denoised
    assert same[~frame.traced].mean() < 0.3


def test_judges_are_renders_that_no_trace_comes_from(stored):
    renders, renderers, _, denoised = stored
    first, second = renderers.judges(PLACE)
    assert not np.array_equal(first, second)
    if not denoised:
        for number, judge in ((2, first), (3, second)):
            np.testing.assert_array_equal(judge, renders.targets[(PLACE + number) % RENDERS][COLOUR_PASS])


def test_a_frame_is_judged_and_nothing_of_it_reaches_the_next(stored):
    _, renderers, _, _ = stored
    pairs = []
    for _ in range(2):
        frame = render_stereo_frame(renderers.at(PLACE), StereoSettings())
        pairs.append(pair_of(frame, *renderers.judges(PLACE)))
    assert pairs[0] == pairs[1]
    assert pairs[0].traced == np.mean(frame.traced)
    assert pairs[0].cost >= pairs[0].traced
    assert np.isfinite(pairs[0].honest)


def test_a_file_keeps_all_passes(stored):
    renders, _, folder, _ = stored
    kept = StoredRenders.load(folder / "kept.npz")
    for ours, theirs in zip((kept.source, *kept.targets), (renders.source, *renders.targets), strict=True):
        assert ours.keys() == theirs.keys()
        for name, image in ours.items():
            np.testing.assert_array_equal(image, theirs[name])
