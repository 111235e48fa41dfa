"""Probes: what a sparse set of twice-traced pixels says of the rest is true, on average and within its interval."""

from __future__ import annotations

import numpy as np
import pytest

from stereo_reproject.metrics import noise_ratio
from stereo_reproject.probes import choose_refined, estimate, measure, place_probes, refined_pixels

SIZE = (320, 480)
NOISE = 0.08
SPACING = 8

HONEST = 0.05
"""How far the estimate of one frame may be from its true noise ratio: four standard errors of 2400 probes."""

COVERED = 0.85
"""Share of intervals that must hold the truth; 95 % are meant to, and of 40 some more or fewer do by chance."""


class Frame:
    """A grey picture traced with noise, warped with less of it, and wrong by `bias` in a rectangle (a mirror, say)."""

    def __init__(self, bias, *, seed=1, mirror=(slice(80, 200), slice(100, 260)), warped_noise=0.75):
        self.rng = np.random.default_rng(seed)
        y, x = np.mgrid[0 : SIZE[0], 0 : SIZE[1]]
        self.truth = np.repeat((0.4 + 0.2 * np.sin(x / 60) * np.cos(y / 45))[..., None], 4, axis=2)
        self.warped = self.truth + self.rng.normal(0.0, warped_noise * NOISE, self.truth.shape)
        self.warped[mirror] += bias
        self.holes = np.zeros(SIZE, bool)
        self.holes[:, 300:330] = True

    def traced(self):
        return self.truth + self.rng.normal(0.0, NOISE, self.truth.shape)

    def measured(self, seed=3):
        probes = place_probes(~self.holes, spacing=SPACING, seed=seed)
        a, b = self.traced(), self.traced()
        return measure(probes, ~self.holes, *(image[probes.mask] for image in (self.warped, a, b)))

    def true_ratio(self, pixels):
        ours = np.where((self.holes | pixels)[..., None], self.traced(), self.warped)
        return noise_ratio(ours, self.traced(), self.traced())


def test_each_tile_with_a_warped_pixel_has_one_probe_among_them():
    warped = np.ones((21, 35), bool)
    warped[:8, :8] = False
    warped[8:16, 8:16] = False
    warped[12, 13] = True
    probes = place_probes(warped, spacing=8, seed=1)
    assert warped[probes.rows, probes.columns].all()
    tiles = list(zip(*probes.tiles, strict=True))
    assert len(tiles) == len(set(tiles)) == 3 * 5 - 1
    assert (12, 13) in list(zip(probes.rows, probes.columns, strict=True))
    np.testing.assert_array_equal(np.argwhere(probes.mask), np.stack([probes.rows, probes.columns], axis=1))


def test_no_warped_pixel_no_probe_and_nothing_to_promise():
    probes = place_probes(np.zeros((16, 16), bool), spacing=8, seed=1)
    none = np.zeros((0, 4))
    measured = measure(probes, np.zeros((16, 16), bool), none, none, none)
    assert estimate(measured, seed=1).noise_ratio == 1.0
    assert not refined_pixels(measured, choose_refined(measured, 1.1, seed=1).refined).any()


@pytest.mark.parametrize("bias", [0.0, 0.1, 0.5])
def test_the_estimate_is_the_true_noise_ratio(bias):
    frame = Frame(bias)
    told = estimate(frame.measured(), seed=1)
    true = frame.true_ratio(np.zeros(SIZE, bool))
    assert told.noise_ratio == pytest.approx(true, abs=HONEST * max(1.0, true))
    assert told.low < told.noise_ratio < told.high


def test_a_warp_that_is_good_enough_is_left_alone():
    assert not choose_refined(Frame(0.0).measured(), 1.1, seed=1).refined.any()


@pytest.mark.parametrize("promise", [1.1, 1.05, 1.02])
def test_refinement_keeps_its_promise_and_traces_little_beside_what_is_wrong(promise):
    frame = Frame(0.4)
    measured = frame.measured()
    choice = choose_refined(measured, promise, seed=1)
    pixels = refined_pixels(measured, choice.refined)
    true = frame.true_ratio(pixels)
    assert choice.estimate.noise_ratio <= promise
    assert true <= promise + HONEST
    assert true == pytest.approx(choice.estimate.noise_ratio, abs=HONEST)
    wrong = 120 * 160
    assert pixels.sum() < 1.6 * wrong, "the mirror, and its rim in whole tiles"


@pytest.mark.parametrize("bias", [0.0, 0.15, 0.4])
def test_the_interval_after_the_choice_covers_the_truth(bias):
    """The choice is made by what was measured, and must not flatter what is told of it."""
    hits = []
    for seed in range(40):
        frame = Frame(bias, seed=seed)
        measured = frame.measured(seed)
        choice = choose_refined(measured, 1.05, seed=seed)
        true = frame.true_ratio(refined_pixels(measured, choice.refined))
        hits.append(choice.estimate.low <= true + 0.01 and true - 0.01 <= choice.estimate.high)
    assert np.mean(hits) >= COVERED


def test_a_firefly_on_a_probe_refines_no_wall_and_hides_no_error():
    bright = Frame(0.0)
    measured = bright.measured()
    probes = measured.probes
    w, a, b = (image[probes.mask] for image in (bright.warped, bright.traced(), bright.traced()))
    a[probes.rows.size // 2] = 1000.0
    measured = measure(probes, ~bright.holes, w, a, b)
    assert refined_pixels(measured, choose_refined(measured, 1.1, seed=1).refined).sum() <= 9 * SPACING**2

    frame = Frame(0.4)
    w, a, b = (image[probes.mask] for image in (frame.warped, frame.traced(), frame.traced()))
    a[10] = b[500] = 1000.0
    measured = measure(probes, ~frame.holes, w, a, b)
    chosen = refined_pixels(measured, choose_refined(measured, 1.1, seed=1).refined)
    assert frame.true_ratio(chosen) <= 1.1 + HONEST


def test_a_firefly_counts_for_no_more_than_a_few_probes():
    """In a frame with little noise one of them is more than all the rest, and would hide what is wrong elsewhere."""
    rng = np.random.default_rng(5)
    probes = place_probes(np.ones((160, 240), bool), spacing=SPACING, seed=1)
    a, b = (0.4 + rng.normal(0.0, 0.01, (probes.rows.size, 3)) for _ in range(2))
    w = a.mean() + np.where(np.arange(probes.rows.size) % 4 == 0, 0.05, 0.0)[:, None] + np.zeros(3)
    quiet = estimate(measure(probes, np.ones((160, 240), bool), w, a, b), seed=1)
    a[7] = 1000.0
    disturbed = estimate(measure(probes, np.ones((160, 240), bool), w, a, b), seed=1)
    assert quiet.noise_ratio > 1.5
    assert disturbed.noise_ratio > 0.9 * quiet.noise_ratio


def test_a_trace_that_is_no_number_says_nothing():
    frame = Frame(0.0)
    probes = frame.measured().probes
    w, a, b = (image[probes.mask] for image in (frame.warped, frame.traced(), frame.traced()))
    a[5] = np.nan
    b[7] = np.inf
    told = estimate(measure(probes, ~frame.holes, w, a, b), seed=1)
    assert np.isfinite([told.noise_ratio, told.low, told.high]).all()
