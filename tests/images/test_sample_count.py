"""Number of samples of a picture, read off its cryptomatte's coverage."""

import numpy as np
import pytest

from stereo_reproject.images.sample_count import sample_count
from stereo_reproject.images.tuning import TUNING

SHAPE = (60, 80)


def coverage(samples, *, counts=None, edges=0.2, smoke=0.0, seed=1):
    """(H, W, 2), as Cycles writes it in float32: the two largest shares of a pixel; smoke lets any share through."""
    rng = np.random.default_rng(seed)
    of_pixel = np.broadcast_to(samples if counts is None else counts, SHAPE)
    hits = np.where(rng.random(SHAPE) < edges, rng.binomial(of_pixel, rng.random(SHAPE)), of_pixel)
    first = np.maximum(hits, of_pixel - hits).astype(np.float32)
    shares = np.stack([first, of_pixel - first], axis=-1) * (np.float32(1.0) / of_pixel.astype(np.float32))[..., None]
    dim = np.where(rng.random(SHAPE) < smoke, rng.random(SHAPE), 1.0)[..., None]
    return (shares * dim).astype(np.float32)


@pytest.mark.parametrize("samples", [8, 9, 16, 37, 100, 128, 1000, 1364, 4095, 16384, 60000])
def test_the_number_of_samples_is_found(samples):
    assert sample_count(coverage(samples), None, max(4 * samples, 4096)) == samples


@pytest.mark.parametrize("samples", [33, 64, 1000])
def test_in_part_among_smoke(samples):
    assert sample_count(coverage(samples, smoke=0.05), None, 4096) == samples


def test_each_pixel_may_have_fewer():
    """Adaptive sampling stops pixels at other numbers, which the sample count pass has as shares of the largest."""
    rng = np.random.default_rng(2)
    counts = rng.choice([16, 24, 32, 100], SHAPE)
    relative = (counts / np.float32(100))[..., None].astype(np.float32)
    assert sample_count(coverage(100, counts=counts), relative, 4096) == 100


def test_without_evidence_nothing_is_guessed():
    rng = np.random.default_rng(3)
    assert sample_count(np.ones((*SHAPE, 2), np.float32), None, 4096) is None
    assert sample_count(rng.random((*SHAPE, 2), np.float32), None, 4096) is None
    # All edges alike: a half is one of two samples, or fifty of a hundred.
    assert sample_count(np.full((*SHAPE, 2), 0.5, np.float32), None, 4096) is None
    assert sample_count(coverage(TUNING.min_samples - 1), None, 4096) is None
