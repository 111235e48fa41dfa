"""A membrane: values that are known at some pixels, spread over others as smoothly as their neighbours allow.

It minimises

    sum over known pixels of weight (x - known)^2 + sum over neighbours of bond (x - x')^2,

which is the discrete Laplace equation where nothing is known: gradient-domain blending (Perez et al., "Poisson Image
Editing", 2003), but for the known pixels, which pull and do not bind, so that their noise is averaged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

TOLERANCE = 1e-3
"""Residual over the one at the start at which the solution is good enough: what is left is below an 8-bit step."""

MOST_ROUNDS = 400


@dataclass(frozen=True)
class Bonds:
    """How firmly neighbours are tied, from 0: right (H, W - 1) to the next pixel in the row, down (H - 1, W)."""

    right: NDArray[np.float32]
    down: NDArray[np.float32]

    @staticmethod
    def within(domain: NDArray[np.bool_]) -> Bonds:
        """1 between neighbours that are both in the domain (H, W), 0 elsewhere."""
        right, down = domain[:, 1:] & domain[:, :-1], domain[1:] & domain[:-1]
        return Bonds(right.astype(np.float32), down.astype(np.float32))


def spread(
    known: NDArray[np.floating],
    weight: NDArray[np.floating],
    domain: NDArray[np.bool_],
    bonds: Bonds,
    *,
    tolerance: float = TOLERANCE,
) -> NDArray[np.float32]:
    """The membrane (H, W, C) over `domain` (H, W), 0 elsewhere and where nothing known is within reach.

    known (H, W, C) counts where weight (H, W), from 0, is above 0. Bonds count within the domain.
    """
    result = np.zeros(known.shape, np.float32)
    if not domain.any():
        return result
    system = _System(domain, bonds, weight)
    values = np.where(system.pull[:, None] > 0.0, known[domain], 0.0).astype(np.float64)
    result[domain] = system.solve(values, tolerance)
    return result


class _System:
    """The linear system over the N pixels of the domain, in the mask's order."""

    def __init__(self, domain: NDArray[np.bool_], bonds: Bonds, weight: NDArray) -> None:
        self.pull = weight[domain].astype(np.float64)
        count = self.pull.size
        places = np.full(domain.shape, count, np.intp)
        places[domain] = np.arange(count)
        # Left, right, up and down; the place past the last stands for no neighbour, at which there is always 0.
        self._neighbours = np.full((4, count), count, np.intp)
        self._strength = np.zeros((4, count))
        for k, (axis, strength) in enumerate(((1, bonds.right), (0, bonds.down))):
            first, second = _pairs(places, axis)
            tied = (first < count) & (second < count) & (strength > 0.0)
            first, second, strength = first[tied], second[tied], strength[tied]
            self._neighbours[2 * k, second], self._strength[2 * k, second] = first, strength
            self._neighbours[2 * k + 1, first], self._strength[2 * k + 1, first] = second, strength
        self._diagonal = self._strength.sum(axis=0) + self.pull

    def solve(self, known: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:
        """Conjugate gradients (preconditioned by the diagonal), for all channels of known (N, C) at once."""
        x, reached = self._islands(known)
        inverse = np.where(reached, 1.0 / np.where(reached, self._diagonal, 1.0), 0.0)[:, None]
        residual = self.pull[:, None] * known - self._apply(x)
        residual[~reached] = 0.0
        direction = inverse * residual
        steepness = np.sum(residual * direction, axis=0)
        enough = tolerance**2 * steepness
        for _ in range(MOST_ROUNDS):
            if np.all(steepness <= enough):
                break
            applied = self._apply(direction)
            length = _over(steepness, np.sum(direction * applied, axis=0))
            x += length * direction
            residual -= length * applied
            preconditioned = inverse * residual
            before, steepness = steepness, np.sum(residual * preconditioned, axis=0)
            direction = preconditioned + _over(steepness, before) * direction
        return x

    def _apply(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        padded = np.concatenate([x, np.zeros((1, x.shape[1]))])
        result = self._diagonal[:, None] * x
        for neighbours, strength in zip(self._neighbours, self._strength, strict=True):
            result -= strength[:, None] * padded[neighbours]
        return result

    def _islands(self, known: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """To start with, the mean of what is known of each connected island (N, C), and (N,) where there is any."""
        island = np.arange(self.pull.size + 1)
        while True:
            lowest = np.minimum(island[self._neighbours].min(axis=0), island[:-1])
            lowest = lowest[lowest]
            if np.array_equal(lowest, island[:-1]):
                break
            island[:-1] = lowest
        place = island[:-1]
        total = np.bincount(place, self.pull, self.pull.size)
        sums = [np.bincount(place, self.pull * channel, self.pull.size) for channel in known.T]
        mean = np.stack([_over(one, total) for one in sums], axis=1)
        return mean[place], total[place] > 0.0


def _pairs(places: NDArray[np.intp], axis: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Each pixel's place and that of the next along the axis."""
    return (places[:, :-1], places[:, 1:]) if axis == 1 else (places[:-1], places[1:])


def _over(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0.0)
