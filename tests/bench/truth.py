"""How far a finished picture is from the truth beyond noise, by many plain renders of the same view.

What is estimated is noise_ratio = sqrt(E|ours - A|^2 / E|B - A|^2) after tone mapping, over plain renders A and B with
the run's own sample count, and honest_ratio = sqrt(1 + bias^2 / 2), with bias^2 in variances of one plain render's
noise; excess is honest_ratio^2 - 1. Tone mapping is not linear: the mean of tone-mapped renders of
16 samples is not a tone-mapped render of 1024. So the reference is K renders of the run's sample count, each of them
tone-mapped. With m their mean and s^2 their variance (K - 1 in the denominator), per pixel and channel,

    mean over k of |ours - A_k|^2    = (ours - m)^2 + s^2 (K - 1) / K,
    mean over pairs |A_k - A_l|^2    = 2 s^2,

both of which have, for the given picture, exactly the expectations that the noise ratio is made of. And with c the
share of a render's variance that a pixel of ours has, (ours - m)^2 has the mean bias^2 + c s^2 + s^2 / K.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stereo_reproject.images.metrics import judged
from stereo_reproject.images.seen_light import scaled_colour

GROUPS = 8
"""Renders are summed by group, so that leaving out one group at a time shows how far chance moves the result."""


@dataclass(frozen=True)
class Truth:
    """The excess of one picture, and the standard error that it has because the references are only so many. smoothed
    is what the lookup has taken from its noise, in the same unit."""

    excess: float
    standard_error: float
    smoothed: float

    @property
    def honest_ratio(self) -> float:
        return float(np.sqrt(max(1.0 + self.excess, 0.0)))

    @property
    def noise_ratio(self) -> float:
        return float(np.sqrt(max(1.0 + self.excess - self.smoothed, 0.0)))


class References:
    """Running sums over plain renders: count (G,), total and squares (G, H, W, 4) of the colours as they are judged.

    Their light is multiplied by light_scale before.
    """

    def __init__(self, count: NDArray, total: NDArray, squares: NDArray, light_scale: float = 1.0) -> None:
        self.count, self.total, self.squares, self.light_scale = count, total, squares, light_scale

    @classmethod
    def none(cls, width: int, height: int, light_scale: float = 1.0) -> References:
        shape = (GROUPS, height, width, 4)
        return cls(np.zeros(GROUPS, np.int64), np.zeros(shape), np.zeros(shape), light_scale)

    def add(self, picture: NDArray) -> None:
        """picture (H, W, 4): scene-linear colours of one more render."""
        toned = self._judged(picture)
        group = int(self.count.sum()) % GROUPS
        self.count[group] += 1
        self.total[group] += toned
        self.squares[group] += toned**2

    def truth(self, ours: NDArray, variance_share: NDArray | float) -> Truth:
        """The excess of `ours` (H, W, 4), scene-linear, with its jackknife standard error over the groups.

        variance_share, (H, W) or one for all, is the share of a plain render's variance that each of its pixels has.
        """
        share = np.broadcast_to(variance_share, ours.shape[:2])[..., None]
        toned = self._judged(ours)
        whole = self.count.sum(), self.total.sum(axis=0), self.squares.sum(axis=0)
        without = [
            _excess(toned, share, whole[0] - count, whole[1] - total, whole[2] - squares)[0]
            for count, total, squares in zip(self.count, self.total, self.squares, strict=True)
        ]
        spread = np.sum((np.array(without) - np.mean(without)) ** 2)
        excess, smoothed = _excess(toned, share, *whole)
        return Truth(excess, float(np.sqrt((GROUPS - 1) / GROUPS * spread)), smoothed)

    def _judged(self, picture: NDArray) -> NDArray:
        return judged(scaled_colour(picture, self.light_scale)).astype(np.float64)

    def save(self, path: Path) -> None:
        # Written whole under another name first: a run that was interrupted leaves no half cache.
        part = path.with_suffix(".part.npz")
        np.savez(part, count=self.count, total=self.total, squares=self.squares, light_scale=self.light_scale)
        part.replace(path)

    @classmethod
    def load(cls, path: Path) -> References:
        with np.load(path) as stored:
            return cls(stored["count"], stored["total"], stored["squares"], float(stored["light_scale"]))


def _excess(ours: NDArray, share: NDArray, count: int, total: NDArray, squares: NDArray) -> tuple[float, float]:
    """The excess, and the noise that was smoothed away, both over the noise of two renders."""
    mean = total / count
    variance = (squares - count * mean**2) / (count - 1)
    bias = np.mean((ours - mean) ** 2 - (share + 1.0 / count) * variance)
    noise = 2.0 * np.mean(variance)
    return float(bias / noise), float(np.mean((1.0 - share) * variance) / noise)


def binomial_interval(hits: int, trials: int) -> tuple[float, float]:
    """Wilson's 95 % interval for the share that `hits` of `trials` is a sample of."""
    z2 = 1.96**2
    centre = (hits + z2 / 2.0) / (trials + z2)
    half = np.sqrt(z2 * (hits * (trials - hits) / trials + z2 / 4.0)) / (trials + z2)
    return float(centre - half), float(centre + half)
