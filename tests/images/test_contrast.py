"""Contrast of a picture by its alpha: before a transparent film a black thing has no other."""

import numpy as np
import pytest

from stereo_reproject.images.contrast import contrast_of, gradient_of

SIZE = (40, 60)
EDGE = np.s_[:, 28:32]
AWAY = np.s_[:, 8:20]
KNOWN = np.ones(SIZE, bool)

NOISE = 0.05


def black_with_alpha(alpha):
    picture = np.zeros((*SIZE, 4), np.float32)
    picture[..., 3] = alpha
    return picture


@pytest.fixture
def edge():
    """A black thing on the right, and nothing on the left."""
    return black_with_alpha(np.arange(SIZE[1]) >= 30)


def test_an_edge_that_alpha_alone_shows_has_contrast(edge):
    signal = contrast_of(edge, KNOWN).signal
    assert signal[EDGE].min() > 0.01
    assert signal[AWAY].max() < 1e-6
    # Between means of 3 x 3 a step of 1 is a third at least; over two pixels, and a sum over channels is of three.
    assert gradient_of(edge, KNOWN)[EDGE].min() == pytest.approx(1.0 / 3.0 / 2.0 / np.sqrt(3.0), rel=1e-3)


def test_alpha_has_no_say_where_it_is_the_same_everywhere():
    opaque = black_with_alpha(0.7)
    assert contrast_of(opaque, KNOWN).signal.max() == 0.0
    assert gradient_of(opaque, KNOWN).max() == 0.0


def test_alpha_of_a_noisy_shadow_is_noise_and_not_contrast():
    alpha = 0.5 + np.random.default_rng(0).normal(0.0, NOISE, SIZE)
    contrast = contrast_of(black_with_alpha(alpha), KNOWN)
    # Sums over channels are divided by three, whether alpha is among them or not.
    assert contrast.noise[4:-4, 4:-4].mean() == pytest.approx(NOISE**2 / 3.0, rel=0.15)
    assert contrast.signal[4:-4, 4:-4].mean() < 0.1 * NOISE**2 / 3.0
