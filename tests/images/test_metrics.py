"""Errors of a picture, measured in its own noise."""

import numpy as np
import pytest

from stereo_reproject.images.lookup import lookup, variance_share
from stereo_reproject.images.metrics import (
    bias_sigmas,
    border_step,
    honest_ratio,
    judged,
    judged_channels,
    noise_ratio,
    rmse,
    squared_error,
    tile_rmse,
    tone,
    untone,
    worst_tiles,
    wrong_tiles,
)

SHAPE = (170, 250)  # not a multiple of the tiles' 16

NOISE = 0.1

RATIO_TOLERANCE = 0.01
"""A mean square over 127 500 independent values is good to 0.4 %, its root to half of that; two of them, thrice."""

TILE_SPREAD = 1.25
"""Over 16 x 16 x 3 values a root mean square is good to 2.6 %, a ratio of two to 3.7 %; over 176 tiles, some at the
border smaller than a third, the worst hundredth lies three deviations out."""


def picture():
    i, j = np.meshgrid(np.arange(SHAPE[0]), np.arange(SHAPE[1]), indexing="ij")
    rgb = np.stack([0.5 + 0.3 * np.sin(i / 20), 1.5 + np.cos(j / 30), 0.4 + 0.0 * i], axis=-1)
    return np.concatenate([rgb, np.ones((*SHAPE, 1))], axis=-1)


def noisy(seed, scale=NOISE):
    return opaque((picture() + np.random.default_rng(seed).normal(scale=scale, size=(*SHAPE, 4))).astype(np.float32))


def opaque(colour):
    """Light is noisy, alpha is 1 everywhere."""
    colour[..., 3] = 1.0
    return colour


def test_a_third_plain_render_stands_at_one():
    for seed in range(3):
        ratio = noise_ratio(noisy(3 * seed), noisy(3 * seed + 1), noisy(3 * seed + 2))
        assert ratio == pytest.approx(1.0, abs=RATIO_TOLERANCE)
        assert worst_tiles(noisy(3 * seed), noisy(3 * seed + 1), noisy(3 * seed + 2)) < TILE_SPREAD


def test_less_noise_and_more_noise():
    """Against a reference with noise of its own: variances add."""
    reference, again = noisy(1), noisy(2)
    assert noise_ratio(picture(), reference, again) == pytest.approx(np.sqrt(0.5), abs=RATIO_TOLERANCE)
    assert noise_ratio(noisy(3, 2 * NOISE), reference, again) == pytest.approx(np.sqrt(2.5), abs=0.05)
    assert noise_ratio(reference, reference, again) == 0.0


def test_a_bias_shows():
    reference, again = noisy(1), noisy(2)
    assert noise_ratio(noisy(3) + np.float32(0.2), reference, again) > 1.3


def test_an_alpha_that_is_wrong_shows_and_one_that_is_right_does_not():
    """Light is the same in all of them: a shadow catcher on a transparent film is black, and its alpha the shadow."""
    ours, reference, again = noisy(3), noisy(1), noisy(2)
    assert noise_ratio(ours, reference, again) == noise_ratio(*(image[..., :3] for image in (ours, reference, again)))
    ours[:, : SHAPE[1] // 2, 3] -= 0.3
    assert noise_ratio(ours, reference, again) > 2.0
    assert worst_tiles(ours, reference, again) > 2.0


def test_channels_that_tell_nothing_apart_are_left_out():
    """Alpha is one where it differs among known pixels; a warp leaves 0 where it shows nothing."""
    colour, known = noisy(1), np.ones(SHAPE, bool)
    assert judged_channels(colour, known) == judged_channels(colour[..., :3], known) == 3
    colour[:20, :20, 3] = 0.0
    assert judged_channels(colour, known) == 4
    known[:20, :20] = False
    assert judged_channels(colour, known) == 3
    assert judged(np.array([[1.0, -1.0, 0.0, 1.5]])).tolist() == [[0.5, 0.0, 0.0, 1.0]]


def test_worst_tiles_finds_bad_tiles_that_the_mean_hides():
    ours, reference, again = noisy(3), noisy(1), noisy(2)
    for i, j in ((2, 3), (7, 9), (8, 1)):  # a hundredth of the tiles and a little more
        ours[16 * i : 16 * i + 16, 16 * j : 16 * j + 16, :3] += 2.0
    assert noise_ratio(ours, reference, again) < 1.5
    assert worst_tiles(ours, reference, again) > 2.5


def test_worst_tiles_are_measured_against_no_less_than_the_median_noise():
    """A tile without noise, whose error is like everyone's noise, is not a bad one."""
    ours, reference, again = noisy(3), noisy(1), noisy(2)
    again[:48, :48] = reference[:48, :48]
    assert worst_tiles(ours, reference, again) < TILE_SPREAD


def test_tiles_by_brute_force():
    a, b = noisy(1), noisy(2)
    error = squared_error(a, b)
    tiles = tile_rmse(a, b)
    assert tiles.shape == (11, 16)
    for i in range(11):
        for j in range(16):
            expected = np.sqrt(error[16 * i : 16 * i + 16, 16 * j : 16 * j + 16].mean())
            assert tiles[i, j] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("shape", [(1, 1), (16, 16), (5, 40)])
def test_small_pictures_have_tiles_too(shape):
    a, b = noisy(1)[: shape[0], : shape[1]], noisy(2)[: shape[0], : shape[1]]
    assert np.sqrt(np.mean(squared_error(a, b))) == pytest.approx(rmse(a, b), rel=1e-12)
    assert np.all(tile_rmse(a, b) > 0)


def test_rmse_by_hand():
    a, b = np.zeros((2, 2, 3), np.float32), np.zeros((2, 2, 4), np.float32)
    b[0, 0, :3] = 1.0  # tone maps to a half
    assert rmse(a, b) == pytest.approx(0.25)
    assert rmse(a, b) == rmse(b, a)
    assert rmse(b, b) == 0.0


def test_without_any_noise_equal_is_one_and_anything_else_is_infinite():
    still, other = picture(), picture()
    other[3, 4, 0] += 1e-3
    assert noise_ratio(still, still, still) == 1.0
    assert worst_tiles(still, still, still) == 1.0
    assert noise_ratio(other, still, still) == np.inf
    assert worst_tiles(other, still, still) in (1.0, np.inf)
    changed = still.copy()
    changed[:64, :64] += 1.0
    assert worst_tiles(changed, still, still) == np.inf


def test_tone_keeps_the_order_and_bounds_what_is_bright():
    values = np.array([-3.0, 0.0, 0.01, 1.0, 1e3, 1e8])
    toned = tone(np.repeat(values[:, None], 4, axis=1))
    assert toned.shape == (6, 3)
    assert toned.dtype == np.float32
    np.testing.assert_allclose(toned[:, 0], [0.0, 0.0, 0.01 / 1.01, 0.5, 1e3 / 1001, 1.0], rtol=1e-6)
    assert np.all(toned <= 1.0)


def test_a_firefly_does_not_drown_the_rest():
    ours, reference, again = noisy(3), noisy(1), noisy(2)
    ours[5, 5, :3] = 1e7
    assert noise_ratio(ours, reference, again) == pytest.approx(1.0, abs=RATIO_TOLERANCE)


def test_the_step_across_borders_is_that_of_a_seam():
    picture = np.full((20, 30, 3), 1.0, np.float32)
    holes = np.zeros((20, 30), bool)
    holes[5:10, 5:15] = True
    assert border_step(picture, holes) == 0.0
    picture[holes] = 3.0
    assert border_step(picture, holes) == pytest.approx(0.25)
    assert border_step(picture, ~holes) == border_step(picture, holes)


def test_without_a_border_there_is_no_step():
    assert border_step(np.random.default_rng(0).random((8, 8, 4)), np.ones((8, 8), bool)) == 0.0


LARGE = (340, 500)
SIGMA = 0.04
"""Standard deviation of a plain render's noise after tone mapping."""


def toned_render(seed, off=0.0):
    """Scene-linear colours of a grey render whose tone-mapped value is 0.5 + off, with noise."""
    return untone(0.5 + off + np.random.default_rng(seed).normal(0.0, SIGMA, (*LARGE, 3))).astype(np.float32)


def half_way(seed, off=0.0):
    """A render looked up half-way between pixels of a row, and the share of its variance that is kept."""
    x, y = np.meshgrid(np.arange(LARGE[1]) + 1.0, np.arange(LARGE[0]) + 0.5)
    toned = lookup(tone(toned_render(seed)), x, y)
    return untone(toned + off), variance_share(x, y)


def test_smoothing_is_no_merit():
    """A perfect warp at a fraction of 0.5 has half of the variance: a noise ratio of sqrt(0.75), an honest one of 1."""
    (ours, share), reference, again = half_way(1), toned_render(2), toned_render(3)
    assert np.unique(share).tolist() == [0.5]
    assert noise_ratio(ours, reference, again) == pytest.approx(np.sqrt(0.75), abs=RATIO_TOLERANCE)
    assert honest_ratio(ours, reference, again, share) == pytest.approx(1.0, abs=RATIO_TOLERANCE)
    assert honest_ratio(ours, reference, again, np.ones_like(share)) < 0.9


@pytest.mark.parametrize("sigmas", [0.0, 0.5, 1.0])
def test_the_honest_ratio_counts_the_bias_alone(sigmas):
    reference, again = toned_render(2), toned_render(3)
    due = np.sqrt(1.0 + sigmas**2 / 2.0)
    warped, share = half_way(1, sigmas * SIGMA)
    traced = toned_render(4, sigmas * SIGMA)
    for ours, kept in ((warped, share), (traced, np.ones_like(share))):
        told = honest_ratio(ours, reference, again, kept)
        assert told == pytest.approx(due, abs=RATIO_TOLERANCE)
        if sigmas:
            assert bias_sigmas(told) == pytest.approx(sigmas, abs=0.05)
    # Of a plain render, both ratios are the same.
    assert told == pytest.approx(noise_ratio(traced, reference, again), abs=RATIO_TOLERANCE)


def test_a_bias_below_nothing_is_nothing():
    assert bias_sigmas(0.98) == 0.0
    assert bias_sigmas(1.1) == pytest.approx(0.648, abs=0.001)


def test_without_noise_there_is_no_honest_ratio_but_for_what_is_right():
    still, other = untone(np.full((32, 32, 3), 0.5)), untone(np.full((32, 32, 3), 0.6))
    kept = np.ones((32, 32))
    assert honest_ratio(still, still, still, kept) == 1.0
    assert honest_ratio(other, still, still, kept) == np.inf


def test_an_error_finer_than_a_display_shows_is_no_bias():
    """In a picture that is all but black, noise is far below what rounding to 8 bits adds."""
    rng = np.random.default_rng(5)
    kept = np.ones((64, 64))
    reference, again, plain = (untone(np.maximum(rng.normal(1e-3, 1e-5, (64, 64, 3)), 0.0)) for _ in range(3))
    assert honest_ratio(plain, reference, again, kept) == pytest.approx(1.0, abs=0.01)
    assert honest_ratio(untone(tone(plain) + 3e-4), reference, again, kept) < 1.05
    assert honest_ratio(untone(tone(plain) + 3e-3), reference, again, kept) > 2.0


def test_wrong_tiles_are_counted():
    """Of 22 x 32 tiles, those that are off by more than twice the noise, and by more than a display step."""
    reference, again = toned_render(2), toned_render(3)
    ours = tone(toned_render(1)).astype(np.float64)
    assert wrong_tiles(untone(ours), reference, again) == 0.0
    ours[:16, :48] += 4.0 * SIGMA
    ours[32:48, :160] += SIGMA
    assert wrong_tiles(untone(ours), reference, again) == pytest.approx(3.0 / (22 * 32))
    # Where there is no noise, a display step is needed.
    still = np.full((32, 64, 3), 0.5)
    off = still.copy()
    off[:16, :16] += 0.5 / 255.0
    off[16:, 16:32] += 2.0 / 255.0
    assert wrong_tiles(untone(off), untone(still), untone(still)) == 0.125


def test_where_the_sides_of_a_whole_turn_lie_changes_nothing():
    """No measure looks at neighbours, and a picture turned by whole tiles has the same ones."""
    pictures = [np.ascontiguousarray(noisy(seed)[:, :240]) for seed in range(3)]
    pictures[0][40:60, :9] += 0.5
    turned = [np.roll(each, 5 * 16, axis=1) for each in pictures]
    share = np.ones(pictures[0].shape[:2])
    for measure in (noise_ratio, worst_tiles, wrong_tiles):
        assert measure(*turned) == pytest.approx(measure(*pictures))
    assert honest_ratio(*turned, share) == pytest.approx(honest_ratio(*pictures, share))
