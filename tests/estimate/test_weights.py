"""Pixels that show less count for less: in the measures, in what probes tell of them, and in what is traced."""

import numpy as np
import pytest

from stereo_reproject.estimate.evidence import ProbeTraces, measure_tiles
from stereo_reproject.estimate.noise_ratio import estimate, wrong_tiles
from stereo_reproject.estimate.probes import place_random_probes
from stereo_reproject.estimate.refinement import choose_tiles, outlier_tiles
from stereo_reproject.holes.tuning import TUNING
from stereo_reproject.images import metrics
from stereo_reproject.images.contrast import contrast_of
from tests.estimate.test_honest import SIZE, WITHIN, Frame

ALTITUDE = (0.5 - (np.arange(SIZE[0]) + 0.5) / SIZE[0]) * np.pi
WEIGHT = np.broadcast_to(np.cos(ALTITUDE)[:, None], SIZE).astype(np.float32)
POLE, MIDDLE = np.s_[:40, :], np.s_[140:180, :]
"""As many rows: beside a pole they show a fifth of what they show in the middle."""


def measured(frame, weight, seed=3):
    contrast = contrast_of(frame.warped, frame.everything)
    probes = place_random_probes(frame.everything, spacing=8, seed=seed, contrast=contrast, weight=weight)
    colours = (image[probes.mask] for image in (frame.warped, frame.traced(), frame.traced()))
    return measure_tiles(probes, frame.everything, contrast, ProbeTraces(*colours, frame.share[probes.mask]))


@pytest.mark.parametrize("part", [POLE, MIDDLE], ids=["pole", "middle"])
def test_probes_tell_the_honest_ratio_by_weight(part):
    frame = Frame(2.0, part=part)
    told = np.mean([estimate(measured(frame, WEIGHT, seed)).honest_ratio for seed in range(4)])
    pictures = frame.warped, frame.traced(), frame.traced(), frame.share
    assert told == pytest.approx(metrics.honest_ratio(*pictures, WEIGHT), abs=WITHIN)
    # Two deviations squared and halved, by the share of the weight that the part has.
    assert told == pytest.approx(np.sqrt(1.0 + 2.0 * WEIGHT[part].sum() / WEIGHT.sum()), abs=WITHIN)


def test_probes_stand_for_the_weight_of_all_pixels():
    frame = Frame()
    found = measured(frame, WEIGHT)
    assert found.probes.weight.sum() == pytest.approx(WEIGHT.sum(), rel=0.01)
    assert found.frame_area == pytest.approx(WEIGHT.sum(), rel=1e-5)
    np.testing.assert_allclose(found.pixels, 64.0)


def test_what_is_seen_more_of_is_traced_first():
    frame = Frame(3.0, part=POLE)
    frame.warped[MIDDLE] = Frame(3.0, part=MIDDLE).warped[MIDDLE]
    evenly, by_weight = (measured(frame, weight) for weight in (1.0, WEIGHT))

    def share_at_pole(evidence):
        chosen = choose_tiles(evidence, 1.3)
        rows = evidence.probes.rows[chosen]
        beside = 2 * evidence.probes.spacing
        middle = (rows >= MIDDLE[0].start - beside) & (rows < MIDDLE[0].stop + beside)
        return np.mean(rows < POLE[0].stop + beside), np.mean(middle)

    assert share_at_pole(evenly)[0] > 0.3
    pole, middle = share_at_pole(by_weight)
    assert pole < 0.05
    assert middle > 0.9


def share_chosen(evidence, chosen):
    """Shares of the tiles that are chosen, beside the pole and in the middle."""
    parts = ((evidence.probes.rows >= first) & (evidence.probes.rows < first + 40) for first in (0, 140))
    return [float(np.mean(chosen[part])) for part in parts]


def off_at_both(sigmas):
    frame = Frame(sigmas, part=POLE)
    frame.warped[MIDDLE] = Frame(sigmas, part=MIDDLE).warped[MIDDLE]
    return frame


def test_a_tile_is_held_to_its_limit_whatever_its_pixels_weigh():
    """Four deviations, squared and halved: an honest ratio of 3. The frame's own promise asks for nothing here."""
    evidence = measured(off_at_both(4.0), WEIGHT)
    assert share_chosen(evidence, choose_tiles(evidence, 10.0)) == [0.0, 0.0]
    pole, middle = share_chosen(evidence, choose_tiles(evidence, 10.0, worst=1.5))
    assert min(pole, middle) > 0.95


def test_a_probe_that_stands_out_does_so_whatever_its_pixels_weigh():
    """At 8 deviations the error is 64 times the noise, and a ratio of 4 allows 30 times. Right beside the pole a probe
    may stand for less than half of its tile, and then does not stand out."""
    evidence = measured(off_at_both(8.0), WEIGHT)
    pole, middle = share_chosen(evidence, outlier_tiles(evidence, 4.0))
    assert pole > 0.85
    assert middle > 0.95


def test_without_noise_what_can_be_seen_is_traced_whatever_its_pixels_weigh():
    difference = 1.5 * TUNING.unseen_difference
    frame = Frame()
    frame.noise = lambda: np.zeros((*SIZE, 3))
    frame.warped = frame.traced()
    for part in (POLE, MIDDLE):
        frame.warped[part] = metrics.untone(np.full((40, SIZE[1], 3), 0.5 + difference))
    evidence = measured(frame, WEIGHT)
    assert evidence.frame_noise == 0.0
    pole, middle = share_chosen(evidence, choose_tiles(evidence, 10.0))
    assert min(pole, middle) > 0.75


def test_wrong_tiles_count_by_weight():
    frame = Frame(6.0, part=POLE)
    expected = WEIGHT[:40].sum() / WEIGHT.sum()
    assert metrics.wrong_tiles(frame.warped, frame.traced(), frame.traced(), WEIGHT) == pytest.approx(
        expected, abs=0.02
    )
    assert metrics.wrong_tiles(frame.warped, frame.traced(), frame.traced()) == pytest.approx(0.125, abs=0.04)
    assert wrong_tiles(measured(frame, WEIGHT)) == pytest.approx(expected, abs=0.02)


def test_equal_weights_change_nothing():
    frame = Frame(1.0, part=MIDDLE)
    pictures = frame.warped, frame.traced(), frame.traced()
    ones = np.ones(SIZE, np.float32)
    for measure in (metrics.noise_ratio, metrics.worst_tiles, metrics.wrong_tiles):
        assert measure(*pictures, ones) == pytest.approx(measure(*pictures), rel=1e-12)
    assert metrics.honest_ratio(*pictures, frame.share, ones) == pytest.approx(
        metrics.honest_ratio(*pictures, frame.share), rel=1e-12
    )


@pytest.mark.parametrize("percent", [0.0, 30.0, 99.0, 100.0])
def test_a_weighted_percentile(percent):
    values, weight = np.array([[3.0, 1.0], [2.0, 7.0]]), np.ones((2, 2))
    assert metrics.weighted_percentile(values, percent, weight) == np.percentile(values, percent)
    # One that weighs twice as much as others, of many, is as good as two of them.
    rng = np.random.default_rng(1)
    values = rng.uniform(0.0, 1.0, 2000)
    twice = np.where(values < 0.5, 2.0, 1.0)
    repeated = np.repeat(values, twice.astype(int))
    found = metrics.weighted_percentile(values, percent, twice)
    assert found == pytest.approx(np.percentile(repeated, percent), abs=2e-3)


def test_an_infinite_worst_tile_is_not_interpolated():
    values = np.append(np.ones(60), [np.inf, np.inf])
    weight = np.append(np.ones(60), [2.0, 2.0])
    assert metrics.weighted_percentile(values, 99.0, weight) == np.inf
    assert metrics.weighted_percentile(values, 50.0, weight) == 1.0
