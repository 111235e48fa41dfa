"""The honest ratio by probes: error apart from noise, though a lookup between pixels has smoothed that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stereo_reproject.estimate.evidence import ProbeTraces, RefinedTiles, measure_tiles, with_refined
from stereo_reproject.estimate.expected_excess import local_noise, remaining_excess
from stereo_reproject.estimate.noise_ratio import as_rendered, estimate, wrong_tiles
from stereo_reproject.estimate.probes import place_random_probes
from stereo_reproject.estimate.refinement import choose_tiles
from stereo_reproject.estimate.target import Provenance, Target
from stereo_reproject.images import metrics
from stereo_reproject.images.contrast import contrast_of
from stereo_reproject.images.lookup import lookup, variance_share
from stereo_reproject.images.metrics import bias_sigmas, honest_ratio, noise_ratio, untone
from stereo_reproject.settings.accuracy import DISPLAY_STEP

SIZE = (320, 480)
SIGMA = 0.05
"""Standard deviation of a plain render's noise after tone mapping."""

WITHIN = 0.04
"""Largest difference of the estimate of one frame from the truth: some four standard errors of 2400 probes."""

COVERED = 0.85
"""Share of intervals that must hold the truth; 95 % are meant to, and of 40 some more or fewer do by chance."""

PERFECT_NOISE_RATIO = np.sqrt(0.75)
"""Noise ratio of a perfect warp whose lookup keeps half of the variance."""


class Frame:
    """A grey picture, warped half-way between pixels of a row, and off by `sigmas` of its noise in a part of it."""

    def __init__(self, sigmas=0.0, *, seed=1, part=np.s_[:, :], sigma=SIGMA):
        self.rng, self.sigma = np.random.default_rng(seed), sigma
        x, y = np.meshgrid(np.arange(SIZE[1]) + 1.0, np.arange(SIZE[0]) + 0.5)
        toned = lookup((0.5 + self.noise()).astype(np.float32), x, y)
        toned[part] += sigmas * sigma
        self.warped = untone(toned)
        self.share = variance_share(x, y)
        self.everything = np.ones(SIZE, bool)

    def noise(self):
        return self.rng.normal(0.0, self.sigma, (*SIZE, 3))

    def traced(self):
        return untone(0.5 + self.noise())

    def measured(self, seed=3):
        contrast = contrast_of(self.warped, self.everything)
        probes = place_random_probes(self.everything, spacing=8, seed=seed)
        colours = (image[probes.mask] for image in (self.warped, self.traced(), self.traced()))
        return measure_tiles(probes, self.everything, contrast, ProbeTraces(*colours, self.share[probes.mask]))

    def refined(self, measured, chosen):
        """The evidence once the chosen tiles are traced, the picture then, and its pixels' shares of variance."""
        pixels = measured.probes.pixels_of(chosen)
        traced = np.where(pixels[..., None], self.traced(), self.warped)
        done = RefinedTiles(chosen, pixels, self.warped[pixels], traced[pixels], variance_share=self.share)
        return with_refined(measured, done, local_noise(measured)), traced, np.where(pixels, 1.0, self.share)

    def true_ratios(self, ours, share):
        renders = ours, self.traced(), self.traced()
        return noise_ratio(*renders), honest_ratio(*renders, share)


def test_a_perfect_warp_is_as_good_as_a_render_and_no_better():
    told = estimate(Frame().measured())
    assert told.honest_ratio == pytest.approx(1.0, abs=WITHIN)
    assert told.honest_low < 1.0 < told.honest_high
    assert told.noise_ratio == pytest.approx(PERFECT_NOISE_RATIO, abs=WITHIN)
    assert told.low < PERFECT_NOISE_RATIO < told.high


@pytest.mark.parametrize("sigmas", [0.5, 1.0, 2.0])
def test_a_bias_counts_in_full_and_the_estimate_agrees_with_a_comparison(sigmas):
    frame = Frame(sigmas)
    told = estimate(frame.measured())
    due = np.sqrt(1.0 + sigmas**2 / 2.0)
    noise, honest = frame.true_ratios(frame.warped, frame.share)
    assert told.honest_ratio == pytest.approx(due, abs=WITHIN * due)
    assert honest == pytest.approx(due, abs=0.02)
    assert told.noise_ratio == pytest.approx(noise, abs=WITHIN * due)
    assert told.bias == pytest.approx(sigmas, abs=0.2)
    assert told.bias == pytest.approx(bias_sigmas(told.honest_ratio))


@pytest.mark.parametrize(("steps", "due"), [(0.1, np.sqrt(1.0 + 0.06)), (1.0, np.sqrt(1.0 + 6.0))])
def test_an_error_is_held_against_no_less_noise_than_rounding_makes(steps, due):
    """Against the frame's own noise, a hundredth of a display step, a tenth of one would be an honest ratio of 7."""
    sigma = DISPLAY_STEP / 100.0
    frame = Frame(steps * DISPLAY_STEP / sigma, sigma=sigma)
    measured = frame.measured()
    told = estimate(measured)
    assert frame.true_ratios(frame.warped, frame.share)[1] == pytest.approx(due, rel=0.02)
    assert told.honest_ratio == pytest.approx(due, rel=0.05)
    assert told.honest_low < due < told.honest_high
    assert choose_tiles(measured, 1.1).any() == (due > 1.1)


def test_the_noise_of_rounding_adds_nothing_to_the_interval():
    """What a tile's noise differs by from the mean does not change what errors are held against."""
    measured = Frame(2.0, sigma=0.2 * DISPLAY_STEP).measured()
    uneven = replace(measured, noise=measured.noise * np.where(np.arange(measured.noise.size) % 4, 0.0, 4.0))
    chance = np.sqrt(np.sum((measured.remaining / measured.frame_noise) ** 2))
    for evidence in (measured, uneven):
        error = remaining_excess(evidence, np.zeros(0, np.intp))[1]
        assert float(error[0]) == pytest.approx(chance)


def test_the_credit_of_smoothing_cannot_be_spent_on_bias():
    """Off by 0.8 of the noise everywhere: within 1.10 by the noise ratio, and not by the honest one."""
    measured = Frame(0.8).measured()
    told = estimate(measured)
    assert told.noise_ratio < 1.1 < told.honest_ratio
    assert choose_tiles(measured, 1.1).any()
    assert not choose_tiles(measured, 1.25).any()


def test_refined_tiles_are_no_less_noisy_than_a_render():
    frame = Frame(1.5, part=np.s_[:160])
    measured = frame.measured()
    chosen = measured.probes.rows < 160
    after, traced, share = frame.refined(measured, chosen)
    told, (noise, honest) = estimate(after), frame.true_ratios(traced, share)
    assert told.honest_ratio == pytest.approx(1.0, abs=WITHIN)
    assert honest == pytest.approx(1.0, abs=0.02)
    assert told.noise_ratio == pytest.approx(noise, abs=WITHIN)
    assert not after.smoothed_noise[chosen].any()
    # All pixels of these tiles tell what was wrong: (1.5 SIGMA)^2 of each, and neither more nor less for its noise.
    known = after.excess[chosen].sum() / after.pixels[chosen].sum()
    assert known == pytest.approx((1.5 * SIGMA) ** 2, rel=0.08)


@pytest.mark.parametrize("sigmas", [0.0, 1.2])
def test_the_interval_holds_the_truth_after_the_choice(sigmas):
    hits = []
    for seed in range(40):
        frame = Frame(sigmas, seed=seed, part=np.s_[80:200, 100:260])
        measured = frame.measured(seed)
        after, traced, share = frame.refined(measured, choose_tiles(measured, 1.05, worst=1.5))
        told, (_, true) = estimate(after), frame.true_ratios(traced, share)
        hits.append(told.honest_low <= true + 0.01 and true - 0.01 <= told.honest_high)
    assert np.mean(hits) >= COVERED


def test_without_smoothing_both_ratios_are_the_same():
    measured = Frame(0.7).measured()
    whole = estimate(replace(measured, smoothed_noise=np.zeros_like(measured.noise)))
    assert (whole.noise_ratio, whole.low, whole.high) == (whole.honest_ratio, whole.honest_low, whole.honest_high)
    rendered = as_rendered(measured)
    assert rendered.honest_ratio == rendered.noise_ratio == 1.0
    assert rendered.bias == 0.0
    assert rendered.honest_low == rendered.low < 1.0 < rendered.high == rendered.honest_high


def test_wrong_tiles_are_told_as_a_comparison_finds_them():
    """Off by six times the noise in a tenth of the frame: each tile of it is wrong, and none beside it."""
    frame = Frame(6.0, part=np.s_[64:128, 96:336])
    measured = frame.measured()
    share = 64 * 240 / (SIZE[0] * SIZE[1])
    assert metrics.wrong_tiles(frame.warped, frame.traced(), frame.traced()) == pytest.approx(share, abs=0.005)
    # The tiles around are told to be wrong too, as each is judged by its neighbours.
    assert share <= wrong_tiles(measured) <= share + 0.08
    assert wrong_tiles(Frame().measured()) == 0.0
    # An honest ratio of 1.46 is not twice a render's.
    assert wrong_tiles(Frame(1.5, part=np.s_[64:128, 96:336]).measured()) < 0.01
    rows, columns = measured.probes.rows, measured.probes.columns
    chosen = (rows >= 48) & (rows < 144) & (columns >= 80) & (columns < 352)
    assert wrong_tiles(frame.refined(measured, chosen)[0]) == 0.0


def test_what_is_wrong_by_less_than_a_display_step_is_not_wrong():
    measured = Frame(6.0).measured()
    assert wrong_tiles(measured) > 0.9
    faint = 1e-4
    scaled = {name: faint * getattr(measured, name) for name in ("excess", "remaining", "noise", "smoothed_noise")}
    assert wrong_tiles(replace(measured, **scaled, seen_noise=faint * measured.seen_noise)) == 0.0


def test_the_shares_of_a_target_are_those_of_where_its_pixels_are_from():
    provenance = np.array([[0, Provenance.HOLE, Provenance.PROBE, Provenance.REFINED]], np.uint8)
    provenance = np.concatenate([provenance, [[0, 0, Provenance.PROBE | Provenance.REFINED, 0]]])
    target, warped = Target("right", {}, provenance), np.full(provenance.shape, 0.7, np.float32)
    for averages, probe in ((True, 0.5), (False, 1.0)):
        share = target.variance_share(warped, averages_probes=averages)
        np.testing.assert_array_equal(share, np.float32([[0.7, 1.0, probe, 1.0], [0.7, 0.7, probe, 0.7]]))


def test_one_spark_in_a_black_picture_does_not_make_it_wrong():
    """A view behind a wall: of thousands of probes one trace is lit, by chance."""
    black = np.zeros((*SIZE, 4), np.float32)
    everything = np.ones(SIZE, bool)
    probes = place_random_probes(everything, spacing=8, seed=3)
    colour = black[probes.mask]
    once, again = colour.copy(), colour.copy()
    once[len(once) // 2, :3] = again[len(again) // 2, :3] = 0.2
    again[len(again) // 2, :3] += 0.05
    measured = measure_tiles(probes, everything, contrast_of(black, everything), ProbeTraces(colour, once, again))
    told = estimate(measured)
    assert 1.0 < told.honest_ratio < 1.2
    assert told.honest_high < 1.5
