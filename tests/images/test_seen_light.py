"""Light as it is seen: a power of two that follows the picture's brightness to the bit, and little else."""

from __future__ import annotations

import numpy as np
import pytest

from stereo_reproject.images.metrics import noise_ratio, worst_tiles
from stereo_reproject.images.seen_light import MIDDLE_GREY, display_scale, scaled_colour, scaled_light

SIZE = (60, 80)
HALF_A_STOP = 2.0**0.5 * (1.0 + 1e-6)


def picture(seed=1, level=1.0):
    """Light over several stops, about `level`, on opaque film."""
    rng = np.random.default_rng(seed)
    colour = np.ones((*SIZE, 4), np.float32)
    colour[..., :3] = level * np.exp(rng.normal(0.0, 1.0, (*SIZE, 3)))
    return colour


def log_mean(colour):
    luminance = colour[..., :3] @ np.array([0.2126, 0.7152, 0.0722])
    return np.exp(np.log(luminance[luminance > 0.0]).mean())


@pytest.mark.parametrize("level", [1e-4, 0.01, 0.18, 0.3, 1.0, 50.0, 1e5])
def test_the_middle_of_the_picture_is_within_half_a_stop_of_middle_grey(level):
    colour = picture(level=level)
    scale = display_scale(colour)
    assert np.log2(scale) == round(np.log2(scale))
    assert 1.0 / HALF_A_STOP <= scale * log_mean(colour) / MIDDLE_GREY <= HALF_A_STOP


@pytest.mark.parametrize("seed", range(5))
def test_light_times_a_power_of_two_has_that_much_less_scale(seed):
    colour = picture(seed)
    scale = display_scale(colour)
    for stops in range(-20, 21):
        assert display_scale(scaled_colour(colour, 2.0**stops)) * 2.0**stops == scale


def test_fireflies_black_parts_and_traces_of_light_do_not_change_it():
    colour = picture()
    scale = display_scale(colour)
    colour[::20, ::20, :3] = 1e30
    assert display_scale(colour) == scale
    mostly_black = np.zeros((3 * SIZE[0], *colour.shape[1:]), np.float32)
    mostly_black[: SIZE[0]] = picture()
    assert display_scale(mostly_black) == scale
    mostly_black[SIZE[0] : SIZE[0] + 4, :, :3] = 1e-30
    assert display_scale(mostly_black) == pytest.approx(scale, rel=1.0)


@pytest.mark.parametrize("value", [np.finfo(np.float32).max, 1e-38, 1e-45, 0.0, -1.0])
def test_no_value_overflows_and_no_light_is_left_as_it_is(value):
    dim = picture(level=1e-6)
    dim[0, 0, :3] = value
    with np.errstate(over="raise"):
        seen = scaled_colour(dim, display_scale(dim))
    assert np.isfinite(seen).all()
    only = np.full((*SIZE, 4), value, np.float32)
    assert display_scale(only) == 1.0 or value > 0.0
    assert np.isfinite(scaled_colour(only, display_scale(only))).all()


def test_light_is_scaled_and_nothing_else():
    passes = {
        name: np.full((2, 2, channels), 0.5, np.float32)
        for name, channels in (("Combined", 4), ("Emit", 3), ("Combined_Sun", 3), ("Depth", 1), ("Mist", 1), ("AOV", 4))
    }
    scaled = scaled_light(passes, 4.0)
    assert scaled["Combined"][0, 0].tolist() == [2.0, 2.0, 2.0, 0.5]
    assert np.all(scaled["Emit"] == 2.0)
    assert np.all(scaled["Combined_Sun"] == 2.0)
    assert all(scaled[name] is passes[name] for name in ("Depth", "Mist", "AOV"))
    assert all(image is passes[name] for name, image in scaled_light(passes, 1.0).items())
    assert np.all(passes["Combined"] == 0.5)


@pytest.mark.parametrize("level", [1e-3, 0.01, 0.18, 50.0, 1e3])
def test_a_tile_that_is_twice_as_bright_is_told_at_every_level_of_light(level):
    """In raw light, 0.01 and 0.02 are as good as the same beside what is bright, and so are 50 and 100."""

    def noisy(seed):
        rng = np.random.default_rng(seed)
        colour = np.ones((96, 128, 4), np.float32)
        colour[..., :3] = level * (1.0 + rng.normal(0.0, 0.1, (96, 128, 3)))
        return colour

    ours, reference, again = (noisy(seed) for seed in range(3))
    scale = display_scale(reference)
    ours[16:32, 16:64, :3] *= 2.0
    ours[0, 0] = reference[0, 0] = again[0, 0] = 0.18
    ours, reference, again = (scaled_colour(image, scale) for image in (ours, reference, again))
    assert worst_tiles(ours, reference, again) > 3.0
    assert noise_ratio(ours, reference, again) > 1.2
    error = np.abs(ours - reference)[16:32, 16:64, :3] / (1.0 + ours[16:32, 16:64, :3]) ** 2
    assert error.mean() > 10.0 / 255.0
