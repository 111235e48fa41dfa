"""Membrane: harmonic functions are kept, constants are exact, and holes of which nothing is known stay 0."""

import numpy as np
import pytest

from stereo_reproject.matching.membrane import Bonds, spread

HEIGHT, WIDTH = 24, 36

SOLUTION_ERROR = 4e-3
"""Largest error, for values of about 1: as small as an 8-bit step."""


def frame_of(mask):
    """Return the outermost pixels of the mask's picture."""
    frame = np.zeros_like(mask)
    frame[[0, -1]] = frame[:, [0, -1]] = True
    return frame & mask


def everywhere():
    return np.ones((HEIGHT, WIDTH), bool)


@pytest.mark.parametrize(
    "harmonic",
    [lambda x, y: 0.3 + 0.02 * x - 0.01 * y, lambda x, y: 1e-3 * (x**2 - y**2), lambda x, y: 1e-3 * x * y],
    ids=["plane", "saddle", "twist"],
)
def test_a_harmonic_function_is_put_together_from_its_rim(harmonic):
    rows, columns = np.indices((HEIGHT, WIDTH)).astype(np.float64)
    truth = harmonic(columns, rows)[..., None]
    domain = everywhere()
    rim = frame_of(domain)
    # So firm that the rim does not give.
    result = spread(np.where(rim[..., None], truth, 99.0), 1e4 * rim, domain, Bonds.within(domain), tolerance=1e-7)
    assert np.abs(result - truth).max() < SOLUTION_ERROR


def test_a_constant_is_exact():
    domain = everywhere()
    known = np.broadcast_to(np.array([0.25, 0.5, -2.0]), (HEIGHT, WIDTH, 3))
    result = spread(known, 0.37 * frame_of(domain), domain, Bonds.within(domain))
    assert np.array_equal(result, known.astype(np.float32))


def test_noise_of_what_is_known_is_averaged():
    domain = everywhere()
    rim = frame_of(domain)
    noise = np.random.default_rng(3).normal(0.0, 1.0, (HEIGHT, WIDTH, 1))
    result = spread(noise, 1.0 * rim, domain, Bonds.within(domain))
    assert result[rim].std() < 0.6 * noise[rim].std()
    assert result[8:-8, 8:-8].std() < 0.2


def test_nothing_passes_where_there_is_no_bond():
    domain = everywhere()
    bonds = Bonds.within(domain)
    bonds.right[:, WIDTH // 2 - 1] = 0.0
    known = np.zeros((HEIGHT, WIDTH, 1))
    known[:, 0], known[:, -1] = 1.0, 5.0
    rim = np.zeros_like(domain)
    rim[:, [0, -1]] = True
    result = spread(known, 1.0 * rim, domain, bonds, tolerance=1e-7)
    assert np.allclose(result[:, : WIDTH // 2], 1.0, atol=SOLUTION_ERROR)
    assert np.allclose(result[:, WIDTH // 2 :], 5.0, atol=SOLUTION_ERROR)


def test_a_hole_of_which_nothing_is_known_stays_as_it_is():
    domain = np.zeros((HEIGHT, WIDTH), bool)
    domain[2:6, 2:6] = domain[10:20, 10:20] = True
    weight = np.zeros((HEIGHT, WIDTH))
    weight[10, 10:20] = 1.0
    result = spread(np.full((HEIGHT, WIDTH, 1), 3.0), weight, domain, Bonds.within(domain))
    assert np.all(result[2:6, 2:6] == 0.0)
    assert np.allclose(result[10:20, 10:20], 3.0, atol=SOLUTION_ERROR)
    assert np.all(result[~domain] == 0.0)


def test_without_a_domain_there_is_nothing():
    nowhere = np.zeros((4, 5), bool)
    assert not spread(np.ones((4, 5, 3)), np.ones((4, 5)), nowhere, Bonds.within(nowhere)).any()
