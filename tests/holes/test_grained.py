"""Single pixels of the source where noise rules: in all light alike, and known to what judges the view."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from stereo_reproject.estimate.tracing import _judged_by
from stereo_reproject.holes.reprojection import reproject
from stereo_reproject.images.passes import COLOUR_PASS
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.views.view import View
from stereo_reproject.warp.options import WarpOptions
from stereo_reproject.warp.rendered_view import RenderedView
from tests.pipeline.test_many_views import CALM, NOISE, caster

LIGHT = "DiffDir"


@pytest.fixture(scope="module")
def warped():
    """A view looked up in another, with the pass LIGHT, which is half of its colour, and the picture without noise."""
    renderer = caster(2, 0.05, CALM)
    passes = renderer.picture("view_00", seed=1)
    passes = {**passes, LIGHT: 0.5 * passes[COLOUR_PASS][..., :3]}
    source, target = (View(name, camera) for name, camera in renderer.cameras.items())
    options = WarpOptions(0.25, "linear", "grained")
    holes = reproject([RenderedView(source, passes)], target, SETTINGS["balanced"], options=options).answered()
    return holes, passes, CALM.render(target.camera)[COLOUR_PASS], renderer


def test_single_pixels_are_those_of_the_source(warped):
    holes, passes, _, _ = warped
    assert holes.single.mean() > 0.8
    taken = {tuple(colour) for colour in passes[COLOUR_PASS].reshape(-1, 4)}
    assert all(tuple(colour) in taken for colour in holes.passes[COLOUR_PASS][holes.single])
    others = ~holes.single & (holes.reasons == 0)
    assert not all(tuple(colour) in taken for colour in holes.passes[COLOUR_PASS][others])
    np.testing.assert_array_equal(holes.variance_share[holes.single], 1.0)


def test_parts_of_the_light_still_add_up(warped):
    holes = warped[0]
    shown = holes.reasons == 0
    np.testing.assert_allclose(
        holes.passes[LIGHT][shown], 0.5 * holes.passes[COLOUR_PASS][..., :3][shown], rtol=1e-5, atol=1e-6
    )


def test_probes_are_held_against_lookups_between_single_pixels(warped):
    holes = warped[0]
    mask = np.random.default_rng(3).random(holes.reasons.shape) < 0.2
    rows, columns = np.nonzero(mask)
    own, share = holes.passes[COLOUR_PASS][mask], holes.variance_share[mask]
    colours, shares = _judged_by(holes, SimpleNamespace(mask=mask, rows=rows, columns=columns), own, share)
    single = holes.single[mask]
    np.testing.assert_array_equal(colours[single], holes.between((rows[single], columns[single])))
    np.testing.assert_array_equal(colours[~single], own[~single])
    assert shares[single].mean() < 0.9
    np.testing.assert_array_equal(shares[~single], share[~single])


def test_between_single_pixels_there_is_less_noise(warped):
    holes, _, clean, _ = warped
    place = np.nonzero(holes.single & (holes.reasons == 0))
    single, between = (
        np.std(colour[:, :3] - clean[place][:, :3])
        for colour in (holes.passes[COLOUR_PASS][place], holes.between(place))
    )
    assert single == pytest.approx(NOISE, rel=0.1)
    assert between < 0.92 * NOISE


def test_a_pair_is_looked_up_as_before(warped):
    _, passes, _, renderer = warped
    source, target = (View(name, camera) for name, camera in renderer.cameras.items())
    options = replace(WarpOptions(0.25, "linear"), colour_interpolation="adaptive")
    assert (
        reproject([RenderedView(source, passes)], target, SETTINGS["balanced"], options=options).answered().single
        is None
    )
