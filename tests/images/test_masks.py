"""Masks of pixels, opened and widened."""

import numpy as np

from stereo_reproject.images.masks import box_around, dilate, opened


def test_an_opened_mask_keeps_the_squares_that_fit_in_it():
    mask = np.zeros((9, 12), bool)
    mask[2:5, 2:6] = True
    square = mask.copy()
    mask[3, 6:10] = True
    np.testing.assert_array_equal(opened(mask, 1), square)
    assert not opened(mask, 2).any()


def test_beyond_the_border_an_opened_mask_goes_on():
    mask = np.zeros((6, 6), bool)
    mask[:1] = True
    np.testing.assert_array_equal(opened(mask, 1), mask)
    assert opened(np.ones((4, 5), bool), 3).all()


def test_the_box_around_a_mask_ends_at_the_picture_s_border():
    mask = np.zeros((10, 20), bool)
    mask[4, 3] = mask[6, 17] = True
    assert box_around(mask, 2) == (slice(2, 9), slice(1, 20))
    assert not mask[box_around(np.zeros_like(mask), 2)].size


def test_a_mask_that_wraps_is_widened_across_its_sides():
    mask = np.zeros((5, 7), bool)
    mask[2, 0] = True
    expected = np.zeros_like(mask)
    expected[1:4, [6, 0, 1]] = True
    np.testing.assert_array_equal(dilate(mask, 1, wraps=True), expected)
