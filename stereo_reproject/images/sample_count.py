"""How many samples a picture has, told by the shares of a pixel's samples that its cryptomatte holds.

Cycles ends a render that has a time limit after as many samples as there was time for, and says nowhere how many: the
number in a file's header is what was asked for. But each sample of a pixel hits one material, so where two meet, a
cryptomatte's coverage is a whole number over that of the samples.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MAX_SAMPLES = 65536
"""Above, float32 does not tell one whole number over the samples from the next."""

MIN_SAMPLES = 8
"""Below, a few edges that happen to lie alike could be taken for fewer samples than there are."""

VALUES = 300
"""Shares looked at, at most."""

RELATIVE_ERROR, ABSOLUTE_ERROR = 3e-7, 1e-4
"""Of a share times the samples: rounding of float32, twice."""

LEAST_EXPLAINED = 0.5
"""Share of the shares that the number must explain: smoke and half transparent surfaces have others."""

AS_WELL = 0.9
"""A number that explains this much of what the best does explains it as well: multiples of the samples do."""

CANDIDATES_AT_ONCE = 512


def sample_count(coverage: NDArray, counts: NDArray | None, most: int) -> int | None:
    """Return the samples of a picture's pixels, at most `most`, or None where they cannot be told.

    coverage (H, W, K) holds a cryptomatte's. counts (H, W, 1), where sampling is adaptive, are each pixel's samples
    over those of the pixel that has the most.
    """
    shares = coverage.astype(np.float64)
    if counts is not None:
        shares = np.concatenate([shares * counts, counts], axis=-1)
    shares = shares[(shares > ABSOLUTE_ERROR) & (shares < 1.0 - ABSOLUTE_ERROR)]
    if shares.size > VALUES:
        shares = np.random.default_rng(0).choice(shares, VALUES, replace=False)
    if shares.size == 0:
        return None
    explained = _explained(shares, min(most, MAX_SAMPLES))
    best = float(explained.max())
    samples = int(np.argmax(explained >= AS_WELL * best)) + 1
    return samples if best >= LEAST_EXPLAINED and samples >= MIN_SAMPLES else None


def _explained(shares: NDArray[np.float64], most: int) -> NDArray[np.float64]:
    """(most,): for 1 sample, 2 and so on, the share of `shares` (N,) that are whole numbers over it."""
    found = np.empty(most)
    for first in range(1, most + 1, CANDIDATES_AT_ONCE):
        samples = np.arange(first, min(first + CANDIDATES_AT_ONCE, most + 1), dtype=np.float64)[:, None]
        numbers = shares * samples
        whole = np.abs(numbers - np.rint(numbers)) < RELATIVE_ERROR * samples + ABSOLUTE_ERROR
        found[first - 1 : first - 1 + len(samples)] = whole.mean(axis=1)
    return found
