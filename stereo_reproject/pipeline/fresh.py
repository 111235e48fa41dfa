"""Pixels of made views that are traced anew though the warp has an answer, so that less noise is common to views."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..estimate.target import Provenance, Target


@dataclass
class FreshPixels:
    """Chooses scattered pixels of views to be traced anew, others in each view, and counts them.

    share is that of the warped pixels, 0 to 1; seed is the scene's. traced is the number of pixels that were traced
    anew by now, and filled that of all traces, these included, that were made together with them.
    """

    share: float
    seed: int
    traced: int = 0
    filled: int = 0

    def added_to(self, target: Target, number: int) -> Target:
        """Return the target of the view of this number with pixels to be traced anew among its holes."""
        if self.share <= 0.0:
            return target
        generator = np.random.default_rng([self.seed & 0xFFFFFFFF, number])
        chosen = target.warped & (generator.random(target.provenance.shape, np.float32) < self.share)
        return target.flagged(chosen, Provenance.HOLE | Provenance.FRESH)

    def count(self, target: Target) -> None:
        """Count the pixels of a completed target."""
        holes, probes = (int(target.any_of(flag).sum()) for flag in (Provenance.HOLE, Provenance.PROBE))
        self.traced += int(target.any_of(Provenance.FRESH).sum())
        self.filled += holes + 2 * probes

    def without(self, traced: float) -> float:
        """Return the share of a view's pixels that is to be traced for other reasons, where `traced` is to be traced
        in all; each is 0 to 1."""
        return max(traced - self.share, 0.0) / (1.0 - self.share) if self.share < 1.0 else 0.0
