"""Membrane: values that are known at some pixels are spread over others, smoothly where neighbours belong together.

It minimises

    sum over known pixels of weight (x - known)^2 + sum over neighbours of bond (x - x')^2,

which is the discrete Laplace equation where nothing is known. It is gradient-domain blending (Perez et al., "Poisson
Image Editing", 2003) with one difference: known pixels pull the membrane but do not fix it, so that their noise is
averaged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .tuning import TUNING


@dataclass(frozen=True)
class Bonds:
    """Weights, 0 or more, by which neighbouring pixels of a membrane are tied.

    right (H, W - 1) are those between a pixel and the next in its row, down (H - 1, W) those between it and the one
    below.
    """

    right: NDArray[np.float32]
    down: NDArray[np.float32]

    @staticmethod
    def within(domain: NDArray[np.bool_]) -> Bonds:
        """Return bonds of 1 between neighbours that are both in the domain (H, W), and of 0 elsewhere."""
        right, down = domain[:, 1:] & domain[:, :-1], domain[1:] & domain[:-1]
        return Bonds(right.astype(np.float32), down.astype(np.float32))


def spread(
    known: NDArray[np.floating],
    weight: NDArray[np.floating],
    domain: NDArray[np.bool_],
    bonds: Bonds,
    *,
    tolerance: float | None = None,
) -> NDArray[np.float32]:
    """Return the membrane (H, W, C): known values spread smoothly over `domain` (H, W), along the bonds.

    known (H, W, C) counts where weight (H, W) is above 0, and the more the greater that is. Bonds count within the
    domain. The result is 0 outside the domain, and where no bonds lead to a known pixel. tolerance is the residual, as
    a share of the first one, at which the solution is good enough.
    """
    result = np.zeros(known.shape, np.float32)
    if not domain.any():
        return result
    system = _System(domain, bonds, weight)
    values = np.where(system.pull[:, None] > 0.0, known[domain], 0.0).astype(np.float64)
    result[domain] = system.solve(values, TUNING.membrane_tolerance if tolerance is None else tolerance)
    return result


class _System:
    """The membrane's linear system over the N pixels of the domain (H, W), in the mask's order.

    pull (N,) is the weight of the known value of each, 0 where none is known.
    """

    def __init__(self, domain: NDArray[np.bool_], bonds: Bonds, weight: NDArray) -> None:
        self.pull = weight[domain].astype(np.float64)
        count = self.pull.size
        places = np.full(domain.shape, count, np.intp)
        places[domain] = np.arange(count)
        # Neighbours before, after, above and below. The place past the last stands for none: the value there is 0.
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
        """Return the solution (N, C) for known values (N, C), all channels at once, by preconditioned conjugate
        gradients.

        It ends when the residual is below `tolerance` of the first one in all channels, or after a fixed number of
        rounds.
        """
        x, reached = self._islands(known)
        inverse = np.where(reached, 1.0 / np.where(reached, self._diagonal, 1.0), 0.0)[:, None]
        residual = self.pull[:, None] * known - self._apply(x)
        residual[~reached] = 0.0
        direction = inverse * residual
        steepness = np.sum(residual * direction, axis=0)
        enough = tolerance**2 * steepness
        for _ in range(TUNING.max_membrane_rounds):
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
        """Return the product of the system's matrix with x (N, C)."""
        padded = np.concatenate([x, np.zeros((1, x.shape[1]))])
        result = self._diagonal[:, None] * x
        for neighbours, strength in zip(self._neighbours, self._strength, strict=True):
            result -= strength[:, None] * padded[neighbours]
        return result

    def _islands(self, known: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return a first guess (N, C) of the solution, and the pixels (N,) that bonds connect to any known value.

        The guess is, in each connected island of pixels, the mean of its known values; 0 where it has none.
        """
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
    """Return all pairs of neighbours along an axis, as two arrays: places (H, W) without the last along it, and without
    the first."""
    return (places[:, :-1], places[:, 1:]) if axis == 1 else (places[:-1], places[1:])


def _over(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a / b, and 0 where b is 0 or negative."""
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0.0)
