"""The pixel filters' tables: samples drawn through them must be spread as the filter weighs them."""

import numpy as np
import pytest

from stereo_reproject.trace.pixel_filter import filter_support, sample_offsets

FILTERS = [
    ("BOX", 1.0),
    ("BOX", 1.5),
    ("GAUSSIAN", 1.0),
    ("GAUSSIAN", 1.5),
    ("GAUSSIAN", 0.5),
    ("BLACKMAN_HARRIS", 1.5),
    ("BLACKMAN_HARRIS", 1.0),
    ("BLACKMAN_HARRIS", 3.0),
]

STEP = 2.5e-3
"""Of the support: the table's cumulative sum has 1022 steps over half of it, one of which Cycles loses at the end, and
it sums left edges, not areas."""

ENTRY = 2.0 / 1023
"""Probability: one of the table's 1023 steps, and one for the middle, which two of its halves share."""

MOMENT_TOLERANCE = {"BOX": 0.01, "BLACKMAN_HARRIS": 0.01, "GAUSSIAN": 0.03}
"""Of the standard deviation: what the errors above add up to. The Gaussian's table, Cycles' as ours, reaches to six
deviations, and its last entry spreads one sample in a thousand evenly over the outer three."""


def density(kind, width, x):
    """Weight of a sample at distance x (pixels) from the pixel's centre, not normalised; textbook forms."""
    if kind == "BOX":
        return np.where(np.abs(x) <= 0.5, 1.0, 0.0)
    if kind == "GAUSSIAN":
        sigma = width / 4.0
        return np.where(np.abs(x) <= 1.5 * width, np.exp(-0.5 * (x / sigma) ** 2), 0.0)
    phase = 2.0 * np.pi * (x + width) / (2.0 * width)
    window = 0.35875 - 0.48829 * np.cos(phase) + 0.14128 * np.cos(2 * phase) - 0.01168 * np.cos(3 * phase)
    return np.where(np.abs(x) <= width, window, 0.0)


def grid_of(support):
    edges = np.linspace(-0.5 * support, 0.5 * support, 20001)
    return 0.5 * (edges[1:] + edges[:-1])


def drawn(table, count=200_000):
    """Offsets from the pixel's centre for evenly spread random numbers, the table read as Cycles reads it: linearly."""
    u = (np.arange(count) + 0.5) / count
    return np.interp(u, np.linspace(0.0, 1.0, table.size), table.astype(np.float64)) - 0.5


@pytest.mark.parametrize(("kind", "width"), FILTERS)
def test_offsets_grow_are_symmetric_and_end_with_the_support(kind, width):
    table, support = sample_offsets(kind, width), filter_support(kind, width)
    assert table.shape == (1024,)
    assert table.dtype == np.float32
    assert np.all(np.diff(table) >= 0)
    assert np.all(np.abs(table - 0.5) <= 0.5 * support * (1 + 1e-6))
    middle = 511
    np.testing.assert_allclose(table[middle:1023] + table[middle::-1], 1.0, atol=1e-6 * support)
    if kind == "BOX":  # the others have next to no weight at their ends
        np.testing.assert_allclose(table[[0, -1]], [0.0, 1.0], atol=STEP)
    else:
        assert table[-1] - table[0] > 0.8 * support


def test_box_is_uniform_over_the_pixel_whatever_its_width():
    """Blender's width does not apply to it."""
    for width in (0.1, 1.0, 10.0):
        np.testing.assert_allclose(sample_offsets("BOX", width), np.linspace(0.0, 1.0, 1024), atol=STEP)


@pytest.mark.parametrize(("kind", "width"), FILTERS)
def test_samples_are_distributed_as_the_filter_weighs_them(kind, width):
    """The greatest distance of the two cumulative distributions (Kolmogorov-Smirnov)."""
    support = filter_support(kind, width)
    x = grid_of(support)
    weight = density(kind, width, x)
    cumulative = np.cumsum(weight) / weight.sum()
    samples = drawn(sample_offsets(kind, width))
    empirical = np.searchsorted(samples, x, side="right") / samples.size
    steepest = weight.max() / weight.mean()
    assert np.abs(empirical - cumulative).max() < ENTRY + STEP * steepest


@pytest.mark.parametrize(("kind", "width"), FILTERS)
def test_mean_and_spread_are_the_filter_s(kind, width):
    x = grid_of(filter_support(kind, width))
    weight = density(kind, width, x)
    deviation = np.sqrt(np.sum(weight * x**2) / weight.sum())
    samples = drawn(sample_offsets(kind, width))
    assert abs(samples.mean()) < MOMENT_TOLERANCE[kind] * deviation
    assert samples.std() == pytest.approx(deviation, rel=MOMENT_TOLERANCE[kind])


@pytest.mark.parametrize("kind", ["GAUSSIAN", "BLACKMAN_HARRIS"])
def test_offsets_scale_with_the_filter_s_width(kind):
    narrow, wide = (sample_offsets(kind, width) - 0.5 for width in (0.75, 3.0))
    np.testing.assert_allclose(wide, 4.0 * narrow, atol=1e-6)


def test_supports_are_cycles_own():
    assert filter_support("BOX", 1.5) == 1.0
    assert filter_support("GAUSSIAN", 1.5) == 4.5
    assert filter_support("BLACKMAN_HARRIS", 1.5) == 3.0
