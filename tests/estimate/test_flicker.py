"""Flicker between neighbouring views, of pictures that change by what is known."""

import numpy as np
import pytest

from stereo_reproject.estimate.flicker import Neighbours, flicker_ratio
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS
from stereo_reproject.views.view import View
from tests.pipeline.test_many_views import CALM, NOISE, caster

RENDERER = caster(2, 0.05, CALM)
LOOKED_UP = 0.15
"""Of plain pictures' change, what a lookup makes of a picture without noise: rims are narrower than its kernel."""

VIEWS = [View(name, camera) for name, camera in RENDERER.cameras.items()]


def pictures(noise, first_seed):
    """Both views, with noise of their own of this strength."""
    worlds = (CALM.render(view.camera, noise=noise, seed=first_seed + k) for k, view in enumerate(VIEWS))
    return tuple(passes[COLOUR_PASS] for passes in worlds)


def ratio(ours):
    depth = CALM.render(VIEWS[1].camera)[DEPTH_PASS][..., 0]
    return flicker_ratio(Neighbours(*VIEWS, depth, ours, pictures(NOISE, 10)))


def test_plain_pictures_change_as_plain_ones_do():
    assert ratio(pictures(NOISE, 20)) == pytest.approx(1.0, abs=0.03)


def test_half_the_noise_changes_half_as_much():
    assert ratio(pictures(0.5 * NOISE, 20)) == pytest.approx(0.5, abs=0.03)


def test_a_surface_that_looks_the_same_does_not_flicker():
    assert ratio(pictures(0.0, 0)) < LOOKED_UP


def test_a_view_that_is_brighter_than_its_neighbour_flickers():
    view, neighbour = pictures(0.0, 0)
    assert ratio((view * np.float32(1.5), neighbour)) > 1.5


def test_views_that_have_nothing_in_common():
    depth = np.full(RENDERER.picture("view_00", seed=1)[DEPTH_PASS].shape[:2], np.nan, np.float32)
    one = pictures(NOISE, 10)
    assert flicker_ratio(Neighbours(*VIEWS, depth, one, one)) is None
