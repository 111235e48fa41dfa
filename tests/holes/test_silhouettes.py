"""Silhouettes: a band is traced where its two sides differ, and left alone where they look the same."""

from __future__ import annotations

import numpy as np
import pytest

from stereo_reproject.holes.silhouettes import differing, edge_band
from stereo_reproject.warp.discontinuities import disparity_steps

SIZE = (80, 120)
EDGE = 60
NOISE = 0.1
TOLERANCE = 2.0
"""Standard deviations of the noise, as the balanced setting has it."""

CHANCE = 0.25
"""Share of pixels that may be judged wrongly: means over a dozen noisy pixels a side miss by a third of a deviation."""


def scene(step: float, seed: int = 1):
    """A wall half of which stands 10 pixels of disparity nearer, and is brighter by `step`; grey, with noise."""
    disparity = np.zeros(SIZE, np.float32)
    disparity[:, EDGE:] = 10.0
    colour = np.full((*SIZE, 4), 0.6, np.float32)
    colour[:, EDGE:] += step
    return disparity, colour + np.random.default_rng(seed).normal(0.0, NOISE, colour.shape).astype(np.float32)


def judged(step, *, tolerance=TOLERANCE, unknown=None, radius=1):
    disparity, colour = scene(step)
    band = edge_band(disparity_steps(disparity), threshold=0.25, radius=radius)
    unknown = np.zeros(SIZE, bool) if unknown is None else unknown
    return band, differing(band, disparity, colour, tolerance=tolerance, unknown=unknown)


@pytest.mark.parametrize("radius", [0, 1, 2, 3])
def test_the_band_reaches_its_radius_to_either_side(radius):
    disparity, _ = scene(0.0)
    columns = np.nonzero(edge_band(disparity_steps(disparity), threshold=0.25, radius=radius).any(axis=0))[0]
    np.testing.assert_array_equal(columns, np.arange(EDGE - radius, EDGE + radius))


def test_sides_that_look_the_same_are_left_alone():
    band, differs = judged(0.0)
    assert differs[band].mean() < CHANCE


@pytest.mark.parametrize("step", [0.3, -0.3, 5.0])
def test_sides_that_differ_by_more_than_the_noise_are_traced(step):
    band, differs = judged(step)
    assert differs[band].mean() > 1.0 - CHANCE
    assert not np.any(differs & ~band)


def test_without_a_tolerance_the_whole_band_is_traced():
    band, differs = judged(0.0, tolerance=0.0)
    np.testing.assert_array_equal(differs, band)


def test_beside_what_is_not_known_the_band_stays():
    unknown = np.zeros(SIZE, bool)
    unknown[40, EDGE + 2] = True
    band, differs = judged(0.0, unknown=unknown)
    assert differs[40, EDGE]
    assert not differs[:30][band[:30]].all(), "far from it the sides are compared"


def test_noise_free_sides_of_one_colour_are_alike_and_of_two_are_not():
    disparity, _ = scene(0.0)
    band = edge_band(disparity_steps(disparity), threshold=0.25, radius=1)
    flat = np.full((*SIZE, 4), 0.5, np.float32)
    nothing = np.zeros(SIZE, bool)
    assert not differing(band, disparity, flat, tolerance=TOLERANCE, unknown=nothing).any()
    flat[:, EDGE:] += 0.02
    np.testing.assert_array_equal(differing(band, disparity, flat, tolerance=TOLERANCE, unknown=nothing), band)
