"""Sparks in reflected light: a single pixel goes that is far brighter than all around it, and nothing else does."""

import numpy as np
import pytest

from stereo_reproject.images.metrics import tone
from stereo_reproject.images.reflected_light import without_sparks

SIZE = (60, 80)
NOISE = 0.01
MAX_SPREAD = 1.0 / 255.0
"""Light after tone mapping, a step of 8 bits, that a pixel may get of a spark beside which it lies: in a corner, where
a quarter of the pixels are there to share it."""
MAX_MEAN_CHANGE = 1e-4
"""Change of a picture's mean, relative to it: sums of float32."""


def grey(value=0.1, *, noise=NOISE, seed=1):
    light = np.full((*SIZE, 3), value) + np.random.default_rng(seed).normal(0.0, noise, (*SIZE, 3))
    return light.astype(np.float32)


@pytest.mark.parametrize("place", [(30, 40), (0, 0), (59, 40), (30, 79)])
@pytest.mark.parametrize("brightness", [0.5, 1e4])
def test_a_spark_gets_the_light_beside_it(place, brightness):
    light = grey()
    plain, others = light.copy(), np.ones(SIZE, bool)
    light[place] += brightness
    others[place] = False
    cleaned = without_sparks(light)
    assert np.abs(tone(cleaned) - tone(plain))[others].max() < MAX_SPREAD
    # The mean of three pixels or more.
    np.testing.assert_allclose(cleaned[place], 0.1, atol=4.0 * NOISE / np.sqrt(3.0))
    assert light[place].min() > brightness


def test_two_sparks_do_not_hide_each_other():
    light = grey()
    light[30, 40] = light[30, 43] = 50.0
    assert without_sparks(light).max() < 0.1 + 6.0 * NOISE


@pytest.mark.parametrize("noise", [0.0, NOISE])
def test_without_a_spark_the_light_is_returned_as_it_is(noise):
    light = grey(noise=noise)
    assert without_sparks(light) is light


@pytest.mark.parametrize("shape", [(2, 1), (1, 2), (3, 3)])
def test_a_highlight_of_more_than_a_pixel_stays(shape):
    light = grey()
    light[30 : 30 + shape[0], 40 : 40 + shape[1]] = 50.0
    assert without_sparks(light) is light


@pytest.mark.parametrize("share", [0.001, 0.01, 0.05, 0.3])
def test_light_that_comes_as_few_bright_samples_keeps_its_mean(share):
    """Else all probes together would agree that the source is too dark."""
    bright = np.random.default_rng(2).random((*SIZE, 1)) < share
    light = np.where(bright, np.float32(3.0), np.float32(0.01)).repeat(3, axis=2)
    assert tone(without_sparks(light)).mean() == pytest.approx(tone(light).mean(), rel=MAX_MEAN_CHANGE)


@pytest.mark.parametrize("size", [(1, 1), (1, 2), (2, 2), (4, 4)])
def test_small_pictures_have_no_sparks_where_all_is_alike(size):
    light = np.full((*size, 3), 0.5, np.float32)
    assert without_sparks(light) is light


def test_a_highlight_across_the_sides_of_a_whole_turn_stays():
    light = grey()
    light[30, 0] = light[30, -1] = 50.0
    assert without_sparks(light, wraps=True) is light
    assert without_sparks(light).max() < 1.0


@pytest.mark.parametrize("turn", [1, 20, 40, 79])
@pytest.mark.parametrize("share", [0.001, 0.01, 0.05])
def test_where_the_sides_of_a_whole_turn_lie_changes_nothing(turn, share):
    bright = np.random.default_rng(3).random((*SIZE, 1)) < share
    light = np.where(bright, np.float32(3.0), np.float32(0.01)).repeat(3, axis=2)
    turned = without_sparks(np.roll(light, turn, axis=1), wraps=True)
    np.testing.assert_allclose(turned, np.roll(without_sparks(light, wraps=True), turn, axis=1), rtol=1e-4)
    assert tone(turned).mean() == pytest.approx(tone(light).mean(), rel=MAX_MEAN_CHANGE)
