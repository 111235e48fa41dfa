"""Noise that views have in common: the noise of the mean of neighbouring views against that of plain renders.

A display shows some neighbouring views at once in each place of its screen. Of k plain renders the mean has 1/k of the
variance of one, for their noise is independent. Made views were looked up in the same renders; where two of them read
the same pixels of one, their noise is the same, and stands in the mean. Which pixels each view reads, and with which
weights, is known, so no view is rendered again to tell:

    variance of the mean = the sum over all pairs of views of their covariance, over k²,
    covariance = the sum over the pixels that both read of the products of their weights, times the variance of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..holes.reprojection import WarpedHoles
from ..images.grain import choice_of, chosen_pixels
from ..images.lookup import linear_overlap, variance_share
from ..images.sharpness import pixel_noise
from .target import Provenance, Target
from .tuning import TUNING

NEIGHBOURS = 3
"""Neighbouring views whose mean is judged: about as many as an eye sees at once in one place of a light-field
display."""

OWN = -1
"""Number in place of a render's where a pixel was traced for its view alone, so that no other view has its noise."""


@dataclass(frozen=True)
class NoiseOrigins:
    """Origins of the noise of some of a view's pixels: in R of its rows and C of its columns, spread over the picture;
    all arrays are (R, C).

    render is the number of the view in whose whole render a pixel was looked up, OWN where it was traced for this view
    alone; x, y are the positions of the lookup in it, in pixels. share is the variance as a share of a plain render's,
    and noise the variance of a plain render's pixel there, after `metrics.tone`. fresh are the pixels that were traced
    anew though the warp has an answer: `anew` has them, and the other arrays are as if they were warped.
    """

    render: NDArray[np.int16]
    x: NDArray[np.float32]
    y: NDArray[np.float32]
    share: NDArray[np.float32]
    noise: NDArray[np.float32]
    fresh: NDArray[np.bool_]

    def anew(self) -> NoiseOrigins:
        """Return the origins with the pixels that were traced anew as what they are: traced for this view alone."""
        render, share = (np.where(self.fresh, own, was) for own, was in ((OWN, self.render), (1.0, self.share)))
        return replace(self, render=render, share=share, fresh=np.zeros_like(self.fresh))

    def covariance(self, other: NoiseOrigins) -> NDArray[np.float32]:
        """Return (R, C) the covariance of the noise of these pixels with those of another view at the same places, over
        the variance of a plain render's pixel.

        It is that of two linear lookups, with the correlation of which any others are taken to be correlated.
        """
        together = linear_overlap(self.x, self.y, other.x, other.y)
        alone = variance_share(self.x, self.y) * variance_share(other.x, other.y)
        shared = together * np.sqrt(self.share * other.share / alone)
        return np.where((self.render == other.render) & (self.render != OWN), shared, np.float32(0.0))


@dataclass(frozen=True)
class SharedNoise:
    """Noise of the mean of `count` neighbouring views over that of as many plain renders, as a standard deviation: mean
    is the ratio over all such views, worst that of the worst ones, the first of which has the number worst_first."""

    count: int
    mean: float
    worst: float
    worst_first: int


def origins_of_render(number: int, colour: NDArray[np.float32]) -> NoiseOrigins:
    """Return the origins of the noise of a view that was rendered whole; number is its own, and colour (H, W, >= 3) is
    scene-linear, as bright as it is judged."""
    judged = _judged(colour.shape)
    rows, columns = (np.asarray(each, np.float32) + np.float32(0.5) for each in judged)
    y, x = np.broadcast_arrays(rows, columns)
    render = np.full(x.shape, number, np.int16)
    whole, none = np.ones(x.shape, np.float32), np.zeros(x.shape, bool)
    return NoiseOrigins(render, x, y, whole, pixel_noise(colour)[judged], none)


def origins_of_made(
    numbers: Sequence[int], warped: WarpedHoles, target: Target, share: NDArray[np.float32]
) -> NoiseOrigins:
    """Return the origins of the noise of a completed target.

    numbers are those of the views that it was made from, in the order of the map of warped; share (H, W) is the
    variance of its pixels as a share of a plain render's, of those that were traced anew as if they were warped.
    """
    colour = target.colour
    judged = _judged(colour.shape)
    rows, columns = np.broadcast_arrays(*judged)
    x, y = (at.reshape(rows.shape) for at in warped.places((rows.ravel(), columns.ravel())))
    if warped.single is not None:
        across, down = choice_of(target.view, warped.single.shape)
        chosen = chosen_pixels(x, y, (across[judged], down[judged]))
        x, y = (np.where(warped.single[judged], one, between) for one, between in zip(chosen, (x, y), strict=True))
    render = np.asarray(numbers, np.int16)[warped.warp.source[judged]]
    fresh = target.any_of(Provenance.FRESH)[judged]
    render = np.where(target.warped[judged] | fresh, render, np.int16(OWN))
    return NoiseOrigins(render, x, y, share[judged], pixel_noise(colour)[judged], fresh)


def shared_noise(views: Sequence[NoiseOrigins]) -> SharedNoise:
    """Return the noise of the mean of neighbouring views, from the leftmost view on, against that of plain renders."""
    count = min(NEIGHBOURS, len(views))
    together = [views[first : first + count] for first in range(len(views) - count + 1)]
    ours = np.array([_of_sum(neighbours) for neighbours in together])
    plain = np.array([sum(float(view.noise.sum(dtype=np.float64)) for view in neighbours) for neighbours in together])
    ratios = np.sqrt(np.divide(ours, plain, out=np.ones_like(ours), where=plain > 0.0))
    mean = float(np.sqrt(ours.sum() / plain.sum())) if plain.any() else 1.0
    worst = int(np.argmax(ratios))
    return SharedNoise(count, mean, float(ratios[worst]), worst)


def _of_sum(views: Sequence[NoiseOrigins]) -> float:
    """Return the variance of the sum of views, summed over their pixels."""
    own = sum(float(np.sum(view.noise * view.share, dtype=np.float64)) for view in views)
    return own + 2.0 * sum(_joint(one, other) for one, other in combinations(views, 2))


def _joint(one: NoiseOrigins, other: NoiseOrigins) -> float:
    """Return the sum over pixels of the covariance of the noise of two views."""
    return float(np.sum(np.sqrt(one.noise * other.noise) * one.covariance(other), dtype=np.float64))


def _judged(shape: tuple[int, ...]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows (R, 1) and columns (1, C) of a picture (H, W, ...) in which noise is judged, as its index."""
    rows, columns = (
        np.linspace(0, length - 1, min(length, most)).astype(np.intp)
        for length, most in zip(shape[:2], TUNING.shared_noise_pixels, strict=True)
    )
    return rows[:, None], columns[None]
