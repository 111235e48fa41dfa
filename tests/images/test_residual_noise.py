"""Noise that a denoiser has left, told by a picture's noise and its detail."""

import numpy as np
import pytest

from stereo_reproject.images.bands import BAND_PIXELS
from stereo_reproject.images.passes import COLOUR_PASS, NOISY_PASS
from stereo_reproject.images.residual_noise import residual_noise
from stereo_reproject.images.tuning import TUNING

LIGHT = 0.5
SLOPE = (1.0 + LIGHT) ** -2
"""Slope of x / (1 + x) at LIGHT."""

SIZE = (90, 160)


def picture(*, noise=0.0, detail=0.0, size=SIZE, seed=1):
    """A denoised colour with a chequerboard of this amplitude, and the noisy one that it comes from."""
    y, x = np.indices(size)
    clean = np.full((*size, 4), LIGHT, np.float32)
    clean[..., :3] += detail * (1.0 - 2.0 * ((x + y) % 2))[..., None]
    noisy = clean.copy()
    noisy[..., :3] += np.random.default_rng(seed).normal(0.0, noise, (*size, 3))
    return {COLOUR_PASS: clean, NOISY_PASS: noisy}


@pytest.mark.parametrize(("noise", "detail"), [(0.0, 0.0), (0.0, 0.05), (0.05, 0.0)])
def test_without_noise_nothing_is_left_and_where_all_is_alike_all_noise_is_taken_away(noise, detail):
    assert residual_noise(picture(noise=noise, detail=detail)).max() < 1e-9


@pytest.mark.parametrize(("noise", "detail"), [(0.02, 0.001), (0.01, 0.01), (0.001, 0.05)])
def test_detail_keeps_noise_as_the_best_linear_filter_does(noise, detail):
    left = residual_noise(picture(noise=noise, detail=detail))[2:-2, 2:-2]
    # The mean of 3 x 3 pixels of a chequerboard is a ninth of the middle one's amplitude.
    of_noise, of_detail = (SLOPE * noise) ** 2, (SLOPE * detail * 8.0 / 9.0) ** 2
    best = of_noise * of_detail / (of_noise + of_detail)
    assert left.mean() == pytest.approx(TUNING.residual_noise_share * best, rel=0.1)


def test_it_is_told_where_the_noise_is():
    noisy, calm = picture(noise=0.02, detail=0.02), picture(noise=0.0, detail=0.02)
    half = np.s_[:, : SIZE[1] // 2]
    calm[NOISY_PASS][half] = noisy[NOISY_PASS][half]
    left = residual_noise(calm)
    reach = TUNING.residual_noise_reach_px[0]
    assert left[:, : SIZE[1] // 2 - reach].min() > 0.0
    assert left[:, SIZE[1] // 2 + reach :].max() == 0.0


def test_pixels_that_are_not_known_have_no_say():
    known = np.random.default_rng(2).random(SIZE) < 0.8
    one, other = picture(noise=0.02, detail=0.02), picture(noise=0.02, detail=0.02)
    other[NOISY_PASS][~known] = 7.0
    other[COLOUR_PASS][~known] = np.nan
    other[COLOUR_PASS][0, 0, :3] = np.inf
    known[0, 0] = False
    np.testing.assert_array_equal(residual_noise(one, known), residual_noise(other, known))
    assert np.mean(residual_noise(one, known)[known] > 0.0) > 0.99
    assert not residual_noise(one, known)[~known].any()


def test_a_large_picture_has_no_seams():
    width = 512
    rows = BAND_PIXELS // width
    large = picture(noise=0.02, detail=0.02, size=(2 * rows, width))
    middle = slice(rows - 20, rows + 20)
    part = {name: image[middle] for name, image in large.items()}
    np.testing.assert_allclose(residual_noise(large)[middle][4:-4], residual_noise(part)[4:-4], rtol=1e-6)
