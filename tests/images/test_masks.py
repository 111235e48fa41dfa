"""Masks of pixels, opened."""

import numpy as np

from stereo_reproject.images.masks import opened


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
