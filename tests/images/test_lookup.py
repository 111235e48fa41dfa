"""Passes looked up between their pixels: functions that each interpolation reproduces, and its values at the border."""

import numpy as np
import pytest

from stereo_reproject.images.lookup import linear_overlap, lookup, lookup_without, touches, variance_share

INTERPOLATIONS = ["linear", "cubic", "nearest"]
SIZE = (30, 150)  # width and height in pixels

FLOAT32_TOLERANCE = 2e-5
"""Error of values of up to some ten: sixteen products in float32, whose positions up to 150 are rounded to 8e-6."""


MEAN_TOLERANCE = 1e-6
"""Error of a mean of four pixels, as a share of the largest of them: some roundings of a float32."""


def picture(function, size=SIZE):
    """(H, W, C) float32 of the values of `function(x, y)`, a list of channels, at the pixel centres."""
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    return np.stack(function(x, y), axis=-1).astype(np.float32)


def scattered(size=SIZE, margin=0.0, seed=1, shape=(140, 25)):
    rng = np.random.default_rng(seed)
    x = rng.uniform(margin, size[0] - margin, shape)
    y = rng.uniform(margin, size[1] - margin, shape)
    return x.astype(np.float32), y.astype(np.float32)


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_at_pixel_centres_the_picture_itself_comes_back_exactly(interpolation, channels):
    image = np.random.default_rng(0).normal(size=(*SIZE[::-1], channels)).astype(np.float32)
    x, y = np.meshgrid(np.arange(SIZE[0]) + np.float32(0.5), np.arange(SIZE[1]) + np.float32(0.5))
    np.testing.assert_array_equal(lookup(image, x, y, interpolation=interpolation), image)


def test_linear_gives_a_ramp_back_exactly_where_float32_can_hold_it():
    image = picture(lambda x, y: [x, 2.0 * y, x - y])
    x, y = scattered(margin=2.0)
    x, y = np.round(x * 8) / 8, np.round(y * 8) / 8
    expected = np.stack([x, 2.0 * y, x - y], axis=-1)
    np.testing.assert_array_equal(lookup(image, x, y), expected)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_a_ramp_comes_back_at_any_position(interpolation):
    image = picture(lambda x, y: [0.05 * x + 0.03 * y, 1.0 - 0.02 * x])
    x, y = scattered(margin=2.0)
    expected = np.stack([0.05 * x + 0.03 * y, 1.0 - 0.02 * x], axis=-1)
    np.testing.assert_allclose(lookup(image, x, y, interpolation=interpolation), expected, atol=FLOAT32_TOLERANCE)


def test_linear_is_bilinear_between_four_pixels():
    image = picture(lambda x, y: [0.01 * x * y])
    x, y = scattered(margin=0.5)
    got = lookup(image, x, y)
    np.testing.assert_allclose(got[..., 0], 0.01 * x.astype(np.float64) * y, rtol=1e-5, atol=FLOAT32_TOLERANCE)


def test_cubic_reproduces_quadratics_in_the_interior():
    """Only those without a peak between the pixels: it stays within the range of the pixels."""

    def quadratic(x, y):
        u, v = (x + 1.0) / 20.0, (y + 1.0) / 100.0
        return [u * u, 0.5 * v * v + u, u * u * v * v + u * v]

    x, y = scattered(margin=1.5)
    got = lookup(picture(quadratic), x, y, interpolation="cubic")
    expected = np.stack(quadratic(x.astype(np.float64), y.astype(np.float64)), axis=-1)
    np.testing.assert_allclose(got, expected, atol=FLOAT32_TOLERANCE)


def test_cubic_keeps_more_of_a_wave_than_linear():
    """At four pixels per wave linear loses 29 % halfway between pixels, the spline 12 %."""
    image = picture(lambda x, y: [np.sin(np.pi / 2 * (x - 0.5)) + 0.0 * y])
    x = np.arange(10, 20, dtype=np.float32)[None]
    y = np.full_like(x, 75.5)
    wave = np.sin(np.pi / 2 * (x - 0.5))
    kept = {how: lookup(image, x, y, interpolation=how)[..., 0] @ wave.T / np.sum(wave**2) for how in INTERPOLATIONS}
    assert kept["linear"] == pytest.approx(np.cos(np.pi / 4), abs=1e-4)
    assert kept["cubic"] == pytest.approx(np.cos(np.pi / 4) * 1.25, abs=1e-4)


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_nothing_leaves_the_range_of_the_pixels_around(interpolation):
    """Each channel for itself: light in one must not let another go below what is there."""
    image = np.random.default_rng(0).random((*SIZE[::-1], 3)).astype(np.float32) * np.float32([50.0, 1.0, 1e-3])
    x, y = scattered(margin=2.0)
    got = lookup(image, x, y, interpolation=interpolation)
    rows, columns = (np.floor(at - 0.5).astype(int)[..., None] + np.arange(-1, 3) for at in (y, x))
    around = image[rows[..., :, None], columns[..., None, :]]
    assert np.all(got >= around.min(axis=(2, 3)))
    assert np.all(got <= around.max(axis=(2, 3)))


def test_nearest_takes_the_pixel_that_holds_the_position():
    image = picture(lambda x, y: [np.floor(x) + 1000 * np.floor(y)])
    x, y = scattered()
    got = lookup(image, x, y, interpolation="nearest")[..., 0]
    np.testing.assert_array_equal(got, np.floor(x) + 1000 * np.floor(y))


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_outside_the_picture_its_border_is_repeated(interpolation):
    image = np.random.default_rng(0).normal(size=(*SIZE[::-1], 2)).astype(np.float32)
    padded = np.pad(image, ((8, 8), (8, 8), (0, 0)), mode="edge")
    rng = np.random.default_rng(2)
    x = rng.uniform(-5, SIZE[0] + 5, (60, 40)).astype(np.float32)
    y = np.where(rng.random((60, 40)) < 0.5, rng.uniform(-5, 3, (60, 40)), SIZE[1] - rng.uniform(-5, 3, (60, 40)))
    y = y.astype(np.float32)
    got = lookup(image, x, y, interpolation=interpolation)
    expected = lookup(padded, x + 8, y + 8, interpolation=interpolation)
    np.testing.assert_allclose(got, expected, atol=FLOAT32_TOLERANCE * 4)
    np.testing.assert_allclose(lookup(image, np.float32([[-3]]), np.float32([[-9]]))[0, 0], image[0, 0])


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_an_unknown_position_gives_zero_and_touches_no_other(interpolation):
    image = np.random.default_rng(0).normal(size=(*SIZE[::-1], 3)).astype(np.float32)
    x, y = scattered()
    whole = lookup(image, x, y, interpolation=interpolation)
    x[10, 3] = y[20, 4] = x[70, 5] = y[70, 5] = np.nan
    unknown = np.isnan(x) | np.isnan(y)
    got = lookup(image, x, y, interpolation=interpolation)
    assert np.all(got[unknown] == 0.0)
    np.testing.assert_array_equal(got[~unknown], whole[~unknown])


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize("size", [(1, 1), (2, 1), (1, 3)])
def test_the_smallest_pictures(interpolation, size):
    image = np.full((*size[::-1], 2), 3.25, np.float32)
    x, y = scattered(size, shape=(4, 5))
    np.testing.assert_allclose(lookup(image, x, y, interpolation=interpolation), 3.25, rtol=1e-6)


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_a_constant_stays_constant(interpolation):
    """The weights of every kernel add up to one."""
    x, y = scattered()
    got = lookup(np.ones((*SIZE[::-1], 1), np.float32), x, y, interpolation=interpolation)
    np.testing.assert_allclose(got, 1.0, rtol=1e-6)
    assert got.dtype == np.float32


@pytest.mark.parametrize("share", [0.0, 0.02, 0.5])
def test_touches_by_brute_force(share):
    mask = np.random.default_rng(3).random(SIZE[::-1]) < 0.05
    mask[0, 0] = mask[-1, -1] = True
    x, y = scattered(margin=-1.0)
    x[3, 4] = y[3, 4] = np.nan
    expected = lookup(mask[..., None].astype(np.float32), x, y)[..., 0] > share
    np.testing.assert_array_equal(touches(mask, x, y, share=share), expected)
    assert not touches(mask, x, y, share=share)[3, 4]


def test_nothing_touches_an_empty_mask():
    x, y = scattered()
    assert not touches(np.zeros(SIZE[::-1], bool), x, y, share=0.0).any()


def mean_of_four(image, x, y):
    """(h, w, C) by bilinear weights in float64, and the largest of each four pixels by amount."""
    left, top = (np.floor(p - 0.5).astype(int) for p in (x, y))
    across, down = ((p.astype(np.float64) - 0.5 - floor)[..., None] for p, floor in ((x, left), (y, top)))
    four = [[image[top + i, left + j].astype(np.float64) for j in (0, 1)] for i in (0, 1)]
    rows = [(1.0 - across) * row[0] + across * row[1] for row in four]
    return (1.0 - down) * rows[0] + down * rows[1], np.max(np.abs(four), axis=(0, 1))


@pytest.mark.parametrize("value", [1e30, -1e30, 3e38, -3e38, 0.0, -1.0, 1e-30, 1e-45])
@pytest.mark.parametrize("share", [0.05, 0.5, 1.0])
def test_linear_is_bilinear_for_colours_of_any_size(value, share):
    """Beside colours of 0 to 1, negative ones, and no light at all."""
    rng = np.random.default_rng(5)
    image = rng.uniform(-0.5, 1.0, (*SIZE[::-1], 3)).astype(np.float32)
    image[..., 2] = 0.0
    image[rng.random(SIZE[::-1]) < share] = value
    # Positions whose weights float32 holds: what is off is the mixing alone.
    x, y = (np.round(p * 4096) / np.float32(4096) for p in scattered(margin=1.0))
    with np.errstate(all="raise", under="ignore"):
        got = lookup(image, x, y)
    expected, largest = mean_of_four(image, x, y)
    tolerance = MEAN_TOLERANCE * largest + 4.0 * np.finfo(np.float32).smallest_subnormal
    assert np.all(np.abs(got - expected) <= tolerance)


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize("value", [3e38, np.finfo(np.float32).max])
def test_no_finite_colour_overflows(interpolation, value):
    """Also those of either sign beside each other, where the spline's overshoot is the largest."""
    rng = np.random.default_rng(6)
    image = rng.choice(np.float32([-value, 0.0, value]), (*SIZE[::-1], 3))
    image[..., 1] = value
    x, y = scattered()
    with np.errstate(all="raise", under="ignore"):
        got = lookup(image, x, y, interpolation=interpolation)
    assert np.isfinite(got).all()
    np.testing.assert_allclose(got[..., 1], np.float32(value), rtol=1e-6)


VARIANCE_TOLERANCE = {"linear": 0.06, "nearest": 0.06, "cubic": 0.08}
"""Four standard errors of the variance of some 4700 independent values; and cubic values are held within the range of
what they read."""


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize(("across", "down"), [(0.0, 0.0), (0.5, 0.0), (0.5, 0.5), (0.25, 0.9)])
def test_the_variance_that_a_lookup_keeps_is_as_told(interpolation, across, down):
    noise = np.random.default_rng(4).normal(size=(210, 100, 4)).astype(np.float32)
    # No two of these places read a pixel in common.
    x, y = np.meshgrid(np.arange(4, 96, 4) + 0.5 + across, np.arange(4, 206, 4) + 0.5 + down)
    share = variance_share(x, y, interpolation=interpolation)
    assert share.dtype == np.float32
    assert share.shape == x.shape
    assert np.ptp(share) < 1e-6
    told = lookup(noise, x, y, interpolation=interpolation).var()
    assert told == pytest.approx(share[0, 0], abs=VARIANCE_TOLERANCE[interpolation])
    if interpolation == "linear":
        assert share[0, 0] == pytest.approx((1.0 - 2.0 * across * (1.0 - across)) * (1.0 - 2.0 * down * (1.0 - down)))


def test_the_variance_share_of_a_whole_picture_and_where_nothing_is_looked_up():
    x, y = scattered((600, 300), shape=(300, 600))
    x[7, 8] = np.nan
    y[9, 10] = np.nan
    for interpolation in INTERPOLATIONS:
        share = variance_share(x, y, interpolation=interpolation)
        assert share[7, 8] == share[9, 10] == 1.0
        assert share.min() > 0.2
        assert share.max() <= 1.0 + 1e-6
    # Over all fractions, linear keeps 2 / 3 along each axis.
    assert variance_share(x, y).mean() == pytest.approx(4.0 / 9.0, abs=0.01)
    assert variance_share(x, y, interpolation="cubic").mean() > 0.6


def test_what_is_left_out_has_no_weight_and_the_others_share_it():
    """By hand: at a third across and a quarter down the weights are 6, 3, 2 and 1 twelfths; the second is left out."""
    image = np.array([[[6.0], [np.nan]], [[3.0], [9.0]]], np.float32)
    excluded = np.array([[False, True], [False, False]])
    x, y = np.float32([0.5 + 1.0 / 3.0]), np.float32([0.75])
    np.testing.assert_allclose(lookup_without(image, x, y, excluded), [[(6 * 6.0 + 2 * 3.0 + 9.0) / 9.0]], rtol=1e-6)


def test_with_nothing_left_out_it_is_the_linear_lookup_and_with_all_it_is_0():
    rng = np.random.default_rng(4)
    image = rng.random((7, 9, 3), np.float32)
    x, y = rng.uniform(-1.0, 10.0, 50).astype(np.float32), rng.uniform(-1.0, 8.0, 50).astype(np.float32)
    nothing = np.zeros((7, 9), bool)
    linear = lookup(image, x[None], y[None])[0]
    np.testing.assert_allclose(lookup_without(image, x, y, nothing), linear, rtol=1e-5, atol=1e-6)
    assert not lookup_without(image, x, y, ~nothing).any()


def test_a_constant_stays_constant_whatever_is_left_out():
    rng = np.random.default_rng(5)
    largest = np.float32(3.4e38)
    excluded = rng.random((6, 6)) < 0.4
    x, y = rng.uniform(0.0, 6.0, 200).astype(np.float32), rng.uniform(0.0, 6.0, 200).astype(np.float32)
    values = lookup_without(np.full((6, 6, 1), largest), x, y, excluded)
    assert set(np.unique(values)) <= {np.float32(0.0), largest}
    assert (values > 0.0).mean() > 0.8


def around_the_seam():
    """A picture, the same with eight columns of its other end on either side, and places on both sides of its seam."""
    image = np.random.default_rng(0).normal(size=(*SIZE[::-1], 2)).astype(np.float32)
    rng = np.random.default_rng(2)
    x = rng.uniform(-4.0, 4.0, (60, 40)) + np.where(rng.random((60, 40)) < 0.5, 0.0, SIZE[0])
    y = rng.uniform(1.0, SIZE[1] - 1.0, (60, 40))
    # Places that float32 holds, whatever is added to them.
    x, y = (np.round(at * 4096).astype(np.float32) / np.float32(4096) for at in (x, y))
    return image, np.pad(image, ((0, 0), (8, 8), (0, 0)), mode="wrap"), x, y


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_a_picture_that_wraps_goes_on_at_its_other_side(interpolation):
    image, padded, x, y = around_the_seam()
    got = lookup(image, x, y, interpolation=interpolation, wraps=True)
    expected = lookup(padded, x + 8, y, interpolation=interpolation)
    np.testing.assert_allclose(got, expected, atol=FLOAT32_TOLERANCE)
    assert np.abs(got - lookup(image, x, y, interpolation=interpolation)).max() > 1.0


def test_what_is_left_out_is_so_across_the_seam():
    image, padded, x, y = (values.reshape(-1) if values.ndim == 2 else values for values in around_the_seam())
    excluded = image[..., 0] > 0.0
    around = np.pad(excluded, ((0, 0), (8, 8)), mode="wrap")
    expected = lookup_without(padded, x + 8, y, around)
    np.testing.assert_allclose(lookup_without(image, x, y, excluded, wraps=True), expected, atol=FLOAT32_TOLERANCE)


@pytest.mark.parametrize("share", [0.0, 0.02, 0.5])
def test_touches_across_the_seam_by_brute_force(share):
    image, padded, x, y = around_the_seam()
    mask, around = image[..., 0] > 1.0, padded[..., 0] > 1.0
    expected = lookup(around[..., None].astype(np.float32), x + 8, y)[..., 0] > share
    np.testing.assert_array_equal(touches(mask, x, y, share=share, wraps=True), expected)
    assert (touches(mask, x, y, share=share) != expected).mean() > 0.02


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_a_lookup_across_the_seam_keeps_the_variance_that_is_told(interpolation):
    noise = np.random.default_rng(4).normal(size=(4000, 8, 2)).astype(np.float32)
    y = np.arange(0.5, 4000.0)[:, None]
    x = np.full_like(y, 7.75)
    told = lookup(noise, x, y, interpolation=interpolation, wraps=True).var()
    assert told == pytest.approx(variance_share(x, y, interpolation=interpolation)[0, 0], abs=0.05)
    if interpolation == "linear":
        # What was repeated at the border kept all of it.
        assert lookup(noise, x, y).var() == pytest.approx(1.0, abs=0.05)


def test_the_overlap_of_two_lookups_is_that_of_their_weights():
    """Of an image with a channel for each pixel, a lookup gives the weights."""
    size = (6, 5)
    weights_of = np.eye(size[0] * size[1], dtype=np.float32).reshape(*size, -1)
    rng = np.random.default_rng(4)
    y, x, other_y, other_x = (rng.uniform(1.5, size[k % 2] - 1.5, (30, 40)).astype(np.float32) for k in range(4))
    expected = np.sum(lookup(weights_of, x, y) * lookup(weights_of, other_x, other_y), axis=-1)
    np.testing.assert_allclose(linear_overlap(x, y, other_x, other_y), expected, atol=1e-5)
    np.testing.assert_allclose(linear_overlap(x, y, x, y), variance_share(x, y), atol=1e-5)
    x[2, 3] = np.nan
    assert linear_overlap(x, y, other_x, other_y)[2, 3] == 0.0
