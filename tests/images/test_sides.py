"""Pictures of a whole turn: what is told by a pixel's neighbours is told across their sides."""

import numpy as np
import pytest

from stereo_reproject.images.contrast import contrast_of
from stereo_reproject.images.lookup import lookup
from stereo_reproject.images.sharpness import pixel_noise, sharpness_of
from stereo_reproject.images.sides import REACH_PIXELS, mend_sides

ROUNDING = 1e-5
"""Of sums of float32s, which are not made in the same order."""


def colour(width):
    rng = np.random.default_rng(1)
    steps = rng.uniform(0.1, 2.0, (24, width // 8, 3)).repeat(8, axis=1)
    return (steps * rng.uniform(0.9, 1.1, steps.shape)).astype(np.float32)


def told(picture, *, wraps):
    """All that is told of a picture by the neighbours of its pixels, and of it a third of a pixel aside."""
    contrast = contrast_of(picture, picture[..., 0] > 0.15, wraps=wraps)
    noise = pixel_noise(picture, wraps=wraps)
    y, x = np.mgrid[0.5 : picture.shape[0], 0.83 : picture.shape[1]].astype(np.float32)
    linear, cubic = (lookup(picture, x, y, interpolation=how, wraps=True) for how in ("linear", "cubic"))
    sharpness = sharpness_of(noise, linear, cubic, x, y, wraps=wraps)
    return [contrast.signal, contrast.noise, noise, sharpness.cubic, sharpness.lost]


@pytest.mark.parametrize("width", [16, 2 * REACH_PIXELS, 200])
@pytest.mark.parametrize("turn", [3, 8, -40])
def test_a_turned_picture_tells_the_same(width, turn):
    picture = colour(width)
    for plain, turned in zip(told(picture, wraps=True), told(np.roll(picture, turn, axis=1), wraps=True), strict=True):
        np.testing.assert_allclose(np.roll(plain, turn, axis=1), turned, rtol=1e-3, atol=ROUNDING)


def test_a_picture_that_ends_at_its_sides_does_not():
    picture = colour(200)
    for plain, mended in zip(told(picture, wraps=False), told(picture, wraps=True), strict=True):
        changed = np.nonzero(np.abs(plain - mended).max(axis=0) > 1e-3 * mended.max())[0]
        assert changed.size
        assert set(changed) <= {*range(REACH_PIXELS), *range(200 - REACH_PIXELS, 200)}


def test_columns_are_given_in_their_order_around_the_side():
    asked = []

    def of_columns(columns):
        asked.append(columns)
        return [np.broadcast_to(columns, (2, columns.size))]

    image = np.full((2, 100), -1)
    mend_sides([image], of_columns, wraps=False)
    assert not asked
    mend_sides([image], of_columns, wraps=True)
    [columns] = asked
    assert (np.diff(columns) % 100 == 1).all()
    beside = np.r_[0:REACH_PIXELS, 100 - REACH_PIXELS : 100]
    np.testing.assert_array_equal(image[0, beside], beside)
    assert (np.delete(image[0], beside) == -1).all()
