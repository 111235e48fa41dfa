"""Number of samples that a picture was rendered with, read off the coverages that its cryptomatte holds.

Cycles ends a render that has a time limit after as many samples as there was time for, and says nowhere how many: the
number in a file's header is what was asked for. But each sample of a pixel hits one material, so where two materials
meet, a cryptomatte's coverage is a whole number of samples over the number of all of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .tuning import TUNING

MAX_SAMPLES = 65536
"""Samples up to which float32 coverages can tell one number of samples from the next."""

CANDIDATES_PER_BATCH = 512
"""Numbers of samples that are tried at once, which bounds the memory: each is tried on all coverages."""


def sample_count(coverage: NDArray, counts: NDArray | None, most: int) -> int | None:
    """Return the number of samples per pixel that a picture was rendered with, at most `most`; None where it cannot be
    told.

    coverage (H, W, K), 0 to 1, holds the coverages of a cryptomatte. counts (H, W, 1) is for adaptive sampling, None
    without it: each pixel's samples as a share of those of the pixel that has the most.
    """
    shares = coverage.astype(np.float64)
    if counts is not None:
        shares = np.concatenate([shares * counts, counts], axis=-1)
    shares = shares[(shares > TUNING.sample_error) & (shares < 1.0 - TUNING.sample_error)]
    if shares.size > TUNING.max_coverages:
        shares = np.random.default_rng(0).choice(shares, TUNING.max_coverages, replace=False)
    if shares.size == 0:
        return None
    explained = _explained(shares, min(most, MAX_SAMPLES))
    best = float(explained.max())
    samples = int(np.argmax(explained >= TUNING.min_share_of_best * best)) + 1
    return samples if best >= TUNING.min_explained_share and samples >= TUNING.min_samples else None


def _explained(shares: NDArray[np.float64], most: int) -> NDArray[np.float64]:
    """Return (most,) for each number n of samples, from 1 to `most`, the fraction of shares (N,) that it explains.

    A share, 0 to 1, is explained where it is a whole number of samples over n.
    """
    found = np.empty(most)
    for first in range(1, most + 1, CANDIDATES_PER_BATCH):
        samples = np.arange(first, min(first + CANDIDATES_PER_BATCH, most + 1), dtype=np.float64)[:, None]
        numbers = shares * samples
        whole = np.abs(numbers - np.rint(numbers)) < TUNING.coverage_error * samples + TUNING.sample_error
        found[first - 1 : first - 1 + len(samples)] = whole.mean(axis=1)
    return found
