"""A picture made smaller keeps its mean, and a picture of the same size is itself."""

import numpy as np

from stereo_reproject.images.resizing import made_smaller

ROUNDING = 1e-5
"""Sums of some thousand float32 values near 1."""


def test_a_picture_of_the_same_size_is_itself():
    picture = np.random.default_rng(0).random((7, 11, 3), np.float32)
    np.testing.assert_allclose(made_smaller(picture, 11, 7), picture, atol=ROUNDING)


def test_the_mean_stays_whatever_the_size():
    picture = np.random.default_rng(1).random((37, 53, 3), np.float32)
    for width, height in ((53, 5), (20, 37), (13, 9), (1, 1)):
        smaller = made_smaller(picture, width, height)
        assert smaller.shape == (height, width, 3)
        np.testing.assert_allclose(smaller.mean(axis=(0, 1)), picture.mean(axis=(0, 1)), atol=ROUNDING)


def test_half_the_size_is_the_mean_of_four():
    picture = np.random.default_rng(2).random((6, 8, 3), np.float32)
    fours = picture.reshape(3, 2, 4, 2, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(made_smaller(picture, 4, 3), fours, atol=ROUNDING)
