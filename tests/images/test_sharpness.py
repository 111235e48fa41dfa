"""The mixture of both lookups: cubic where a picture stands above its noise, linear where noise rules."""

import numpy as np
import pytest

from stereo_reproject.images.lookup import lookup, weight_product
from stereo_reproject.images.metrics import tone, untone
from stereo_reproject.images.sharpness import mixed_variance_share, pixel_noise, sharpness_of

HEIGHT, WIDTH, SHIFT = 48, 96, 0.5
NOISE = 0.05


def waves(x):
    """A picture (H, W, 3), after tone mapping, of waves five pixels long, as a function of the columns' positions."""
    return np.repeat(np.broadcast_to(0.5 + 0.2 * np.sin(2.0 * np.pi * x / 5.0), (HEIGHT, WIDTH))[..., None], 3, axis=2)


def flat(x):
    return np.full((HEIGHT, WIDTH, 3), 0.5) + 0.0 * np.broadcast_to(x, (HEIGHT, WIDTH))[..., None]


def looked_up(scene, noise, seed=0):
    """The share of the cubic lookup half a pixel aside, and the mean square errors of both and of their mixture."""
    columns = np.arange(WIDTH) + 0.5
    random = np.random.default_rng(seed).normal(0.0, noise, (HEIGHT, WIDTH, 3)) if noise else 0.0
    colour = untone(np.clip(scene(columns) + random, 0.01, 0.99)).astype(np.float32)
    y, x = (place.astype(np.float32) for place in np.mgrid[0.5:HEIGHT, 0.5:WIDTH])
    x = x + np.float32(SHIFT)
    linear, cubic = (lookup(colour, x, y, interpolation=how) for how in ("linear", "cubic"))
    share = sharpness_of(pixel_noise(colour), linear, cubic, x, y).cubic
    mixture = linear + share[..., None] * (cubic - linear)
    inner = np.s_[:, 8:-8]
    errors = [np.mean((tone(each) - scene(columns + SHIFT))[inner] ** 2) for each in (linear, cubic, mixture)]
    return share[inner], errors


def test_what_is_fine_and_clean_is_looked_up_cubically():
    share, (linear, cubic, mixture) = looked_up(waves, 0.0)
    assert share.min() > 0.99
    assert cubic < 0.5 * linear
    assert mixture == pytest.approx(cubic, rel=0.02)


def test_noise_alone_is_looked_up_linearly():
    share, (linear, cubic, mixture) = looked_up(flat, NOISE)
    assert share.mean() < 0.05
    assert linear <= mixture < linear + 0.2 * (cubic - linear)


def test_the_mixture_is_as_good_as_the_better_of_both_where_both_count():
    for noise in (0.01, 0.03, 0.1):
        _, (linear, cubic, mixture) = looked_up(waves, noise)
        assert mixture < 1.03 * min(linear, cubic)


def test_the_mixture_keeps_the_variance_that_it_says():
    y, x = (place.astype(np.float32) for place in np.mgrid[0.5:200.0, 0.5:200.0])
    x = x + np.float32(0.3)
    noise = np.random.default_rng(1).normal(0.0, 1.0, (200, 200, 1)).astype(np.float32)
    linear = lookup(noise, x, y)[:, 8:-8]
    # The cubic spline itself, without the range that `lookup` holds it within.
    weights = (
        -0.5 * 0.027 + 0.09 - 0.15,
        1.5 * 0.027 - 2.5 * 0.09 + 1.0,
        -1.5 * 0.027 + 0.18 + 0.15,
        0.5 * (0.027 - 0.09),
    )
    cubic = sum(weight * np.roll(noise, 1 - tap, axis=1) for tap, weight in enumerate(weights))[:, 8:-8]
    for share in (0.0, 0.4, 1.0):
        said = mixed_variance_share(x[:1, :1], y[:1, :1], np.full((1, 1), share, np.float32))[0, 0]
        assert np.var((1.0 - share) * linear + share * cubic) == pytest.approx(said, rel=0.03)


def test_a_position_that_is_not_known_has_no_share_and_spoils_no_other():
    y, x = (place.astype(np.float32) for place in np.mgrid[0.5:HEIGHT, 0.5:WIDTH])
    x = x + np.float32(SHIFT)
    x[20:24, 40:50] = np.nan
    colour = untone(waves(np.arange(WIDTH) + 0.5)).astype(np.float32)
    linear, cubic = (lookup(colour, x, y, interpolation=how) for how in ("linear", "cubic"))
    share = sharpness_of(pixel_noise(colour), linear, cubic, x, y).cubic
    assert (share[20:24, 40:50] == 0.0).all()
    assert share[24:30, 40:50].min() > 0.99


def test_the_product_of_weights_of_two_lookups():
    x, y = np.array([[1.0]], np.float32), np.array([[0.5]], np.float32)
    assert weight_product(x, y, "linear", "linear")[0, 0] == pytest.approx(0.5)
    assert weight_product(x, y, "linear", "cubic")[0, 0] == pytest.approx(9.0 / 16.0)
    assert weight_product(x, y, "cubic", "cubic")[0, 0] == pytest.approx(2.0 * (81.0 + 1.0) / 256.0)
