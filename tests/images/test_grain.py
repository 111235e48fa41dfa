"""Single pixels of a picture where noise rules: none but those around, each as often as a linear lookup weighs it."""

import numpy as np
import pytest

from stereo_reproject.images.grain import choice_of, chosen_pixels, ruled_by_noise
from stereo_reproject.images.lookup import lookup
from stereo_reproject.images.metrics import untone

SHAPE = (60, 200)
NAMES = [f"view_{number:02}" for number in range(300)]
NOISE = 0.05
"""Standard deviation of noise after tone mapping."""


def positions(across=0.3, down=0.0):
    y, x = (np.indices(SHAPE) + 0.5).astype(np.float32)
    return x + np.float32(across), y + np.float32(down)


def toned_picture(signal, seed=0):
    """A scene-linear picture whose light is `signal` (H, W) after tone mapping, with noise."""
    noise = np.random.default_rng(seed).normal(scale=NOISE, size=(*SHAPE, 3))
    return untone(np.clip(signal[..., None] + noise, 0.0, 0.95)).astype(np.float32)


def ruled(signal, noise=NOISE**2):
    picture = toned_picture(np.broadcast_to(signal, SHAPE))
    x, y = positions()
    chosen = chosen_pixels(x, y, choice_of("view_01", SHAPE))
    colours = lookup(picture, x, y), lookup(picture, *chosen, interpolation="nearest")
    return ruled_by_noise(*colours, x, y, np.full(SHAPE, noise, np.float32))


@pytest.mark.parametrize("place", [(0.3, 0.0), (0.0, 0.75), (-0.4, 0.2)])
def test_each_pixel_is_chosen_as_often_as_a_linear_lookup_weighs_it(place):
    x, y = positions(*place)
    image = np.random.default_rng(1).random((*SHAPE, 1)).astype(np.float32)
    total = np.zeros((*SHAPE, 1))
    for name in NAMES:
        at_x, at_y = chosen_pixels(x, y, choice_of(name, SHAPE))
        assert np.all(np.abs(at_x - x) < 1.0)
        assert np.all(np.abs(at_y - y) < 1.0)
        total += lookup(image, at_x, at_y, interpolation="nearest")
    off = total / len(NAMES) - lookup(image, x, y)
    # Of 300 choices between two values of 0 to 1, which are equal over stretches.
    assert np.abs(off).max() < 0.2
    assert abs(off.mean()) < 0.005


def test_a_position_on_a_pixel_s_centre_is_that_pixel():
    x, y = (np.full(SHAPE, at, np.float32) for at in (0.5, 4000.5))
    greatest = np.full(SHAPE, np.nextafter(np.float32(1.0), np.float32(0.0)))
    at_x, at_y = chosen_pixels(x, y, (greatest, greatest))
    assert at_x.dtype == at_y.dtype == np.float32
    np.testing.assert_array_equal(at_x, x)
    np.testing.assert_array_equal(at_y, y)


def test_a_view_has_one_choice_and_another_another():
    one, again, other = (choice_of(name, SHAPE)[0] for name in ("view_01", "view_01", "view_02"))
    np.testing.assert_array_equal(one, again)
    assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.1


def test_neighbours_hardly_take_the_same_pixel():
    """By a number for each pixel a quarter would, halfway between two."""
    x, y = positions(across=0.5)
    at_x, _ = chosen_pixels(x, y, choice_of("view_01", SHAPE))
    assert np.mean(np.diff(at_x, axis=1) == 0.0) < 0.04


def test_nothing_is_chosen_where_nothing_is_shown():
    x, y = positions()
    x[3, 4] = np.nan
    at_x, _ = chosen_pixels(x, y, choice_of("view_01", SHAPE))
    assert np.isnan(at_x[3, 4])
    assert np.isnan(at_x).sum() == 1
    assert not ruled_by_noise(*(np.zeros((*SHAPE, 3), np.float32),) * 2, x, y, np.ones(SHAPE, np.float32))[3, 4]


def test_noise_rules_where_little_else_is_seen():
    columns = np.arange(SHAPE[1])
    assert ruled(np.float64(0.4)).mean() > 0.95
    assert ruled(0.3 + 0.05 * NOISE * columns / 4.0).mean() > 0.9
    slope = ruled(np.abs((columns % 40) - 20) * 0.7 * NOISE)
    assert slope[:, 5:15].mean() < 0.05
    texture = ruled(0.4 + 1.5 * NOISE * (-1.0) ** columns)
    assert texture.mean() < 0.05
    assert not ruled(np.float64(0.4), noise=0.0).any()


def test_an_edge_keeps_its_place():
    step = ruled(np.where(np.arange(SHAPE[1]) < 100, 0.3, 0.3 + 3.0 * NOISE))
    assert step[:, 98:102].mean() < 0.05
    assert step[:, :90].mean() > 0.9
