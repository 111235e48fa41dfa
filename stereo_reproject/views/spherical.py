"""Spherical stereo: a ray of its own for each direction, whose origin lies on a circle around the camera.

Directions and points are in the frame of the stereo: z up, and the circle horizontal. In a panorama that is the
camera's own frame; a perspective camera turns around the world's z. Source: Cycles, `spherical_stereo_transform`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .camera import Array, Vector
from .projections import unit

SEARCH_ROUNDS = 80
"""Rounds in which the altitude of a point near a pole is looked for, at most: some five are usual, and where the pole
merge has no width it is bisected to the last digit."""

SAME_ALTITUDE = 1e-13
"""Radians up to which an altitude counts as found."""


@dataclass(frozen=True)
class PoleMerge:
    """The range of altitudes, in radians, over which the eyes come together towards the poles: apart as everywhere up
    to `begin`, and in one place from `end` on."""

    begin: float
    end: float

    def share(self, altitude: Array) -> Array:
        """Return the share of the interocular distance, 1 to 0, at altitudes from 0 to half pi."""
        if self.end <= self.begin:
            return np.where(altitude > self.end, 0.0, 1.0)
        faded = np.clip((altitude - self.begin) / (self.end - self.begin), 0.0, 1.0)
        return np.where(faded < 1.0, np.cos(0.5 * np.pi * faded), 0.0)


@dataclass(frozen=True)
class SphericalStereo:
    """One eye of a spherical stereo pair.

    offset: scene units from the camera to the eye, positive to the right; half the interocular distance. convergence:
    distance at which the rays of both eyes meet, +inf for parallel ones. poles: the pole merge; None without.
    """

    offset: float
    convergence: float
    poles: PoleMerge | None = None

    def rays(self, direction: Vector) -> tuple[Vector, Vector]:
        """Return origin and unit direction of the eye's rays where the camera alone would look in a direction.

        Its length counts: the rays of both eyes meet at `convergence` times the direction. A direction straight up or
        down has no side, and NaN.
        """
        ahead, left, up = direction
        with np.errstate(invalid="ignore"):
            horizontal = np.hypot(ahead, left)
            offset = self.offset * self._share(np.arcsin(np.minimum(np.abs(up), 1.0)))
            along, across = left / horizontal * offset, -ahead / horizontal * offset
        origin: Vector = (along, across, np.zeros_like(along))
        if np.isinf(self.convergence):
            return origin, unit(direction)
        # Over the convergence distance, so that no product leaves what a float64 holds.
        return origin, unit((ahead - along / self.convergence, left - across / self.convergence, up))

    def directions(self, point: Vector, weight: Array, *, is_unit: bool) -> tuple[Vector, Array]:
        """Return the directions, of any length, in which the camera alone would look where the eye sees these points,
        and the distance along the eye's rays.

        It is the inverse of `rays`. point is homogeneous, as for `Camera.px_from_point`; the sky's weight is 0. is_unit
        is `Projection.is_unit`. Points that no ray of the eye meets have NaN.
        """
        seen = _Seen(point, weight, self.convergence, is_unit)
        share = np.array(1.0) if self.poles is None else self._share_at(seen)
        forward, aside = seen.parts(self.offset * share)
        with np.errstate(divide="ignore", invalid="ignore"):
            turned_x, turned_y = forward * point[0] - aside * point[1], forward * point[1] + aside * point[0]
            across = np.square(forward) + np.square(aside)
            # Straight above the camera there is no side.
            scale = np.where(across == 0.0, 0.0, forward / across)
            distance = np.sqrt(
                np.square(forward) + np.square(point[2]) + np.square(aside - self.offset * share * weight)
            )
            return (turned_x * scale, turned_y * scale, point[2] + 0.0 * forward), distance / weight

    def _share(self, altitude: Array) -> Array:
        """Return the share of the offset at an altitude, which the pole merge leaves."""
        return np.ones_like(altitude) if self.poles is None else self.poles.share(altitude)

    def _share_at(self, seen: _Seen) -> Array:
        """Return the share of the offset with which points are seen: that of the altitude at which it shows them."""
        poles = self.poles
        assert poles is not None

        def shown(altitude: Array, chosen: NDArray[np.intp]) -> Array:
            return seen.altitude(self.offset * poles.share(altitude), chosen)

        return poles.share(_fixed_altitude(shown, seen.size)).reshape(seen.shape)


class _Seen:
    """Points as an eye of spherical stereo sees them, for any offset of that eye.

    A point is at `forward` along the horizontal direction in which the camera alone looks where the eye sees it, at
    `aside` to the right of it, and at its own height. point (...), weight, convergence and is_unit are as for
    `SphericalStereo.directions`.
    """

    def __init__(self, point: Vector, weight: Array, convergence: float, is_unit: bool) -> None:
        self._convergence = convergence
        x, y, z, weight = np.broadcast_arrays(*point, weight)
        self.shape, self.size = x.shape, x.size
        flat = np.square(x) + np.square(y)
        self._flat, self._height, self._weight = flat.ravel(), z.ravel(), weight.ravel()
        self._reach = (flat + np.square(z)).ravel() if is_unit else self._flat
        self._is_unit = is_unit

    def parts(self, offset: Array) -> tuple[Array, Array]:
        """Return `forward` and `aside` of all points, for an eye with this offset; NaN where it does not see them."""
        every = np.arange(self.size)
        offset = np.broadcast_to(offset, self.shape).ravel()
        with np.errstate(invalid="ignore"):
            aside = self._aside(offset, every)
            forward = np.sqrt(self._flat - np.square(aside))
        return forward.reshape(self.shape), aside.reshape(self.shape)

    def altitude(self, offset: Array, chosen: NDArray[np.intp]) -> Array:
        """Return the altitude, 0 to half pi, that an offset (K,) gives to the points chosen (K,): that by which Cycles
        merges poles. What the eye does not see counts as a pole's."""
        with np.errstate(invalid="ignore"):
            forward = np.sqrt(np.maximum(self._flat[chosen] - np.square(self._aside(offset, chosen)), 0.0))
            height = np.abs(self._height[chosen])
            if self._is_unit:
                return np.arctan2(height, forward)
            return np.arcsin(np.minimum(height / np.maximum(forward, np.finfo(np.float64).tiny), 1.0))

    def _aside(self, offset: Array, chosen: NDArray[np.intp]) -> Array:
        """Return how far points lie to the right of the direction in which the camera alone looks."""
        weight, beside = self._weight[chosen], np.square(offset)
        if np.isinf(self._convergence):
            return offset * weight
        # The ray is offset * side + k (convergence * direction - offset * side): k follows from the point's distance.
        square = beside + self._convergence**2
        root = np.square(beside * weight) - square * (beside * np.square(weight) - self._reach[chosen])
        return offset * (weight - (beside * weight + np.sqrt(root)) / square)


def _fixed_altitude(shown: Callable[[Array, NDArray[np.intp]], Array], size: int) -> Array:
    """Return the altitudes (size,) that are shown at themselves: secants, and bisection where these leave the range in
    which an altitude must be.

    shown(altitude, chosen) returns the altitudes at which the points chosen (K,) appear if they are looked for at an
    altitude (K,).
    """
    result = np.full(size, np.nan)
    chosen = np.arange(size)
    low, high = np.zeros(size), np.full(size, 0.5 * np.pi)
    before, excess_before = low, shown(low, chosen)
    guess = excess_before
    for _ in range(SEARCH_ROUNDS):
        excess = shown(guess, chosen) - guess
        result[chosen] = guess
        left = np.flatnonzero((np.abs(excess) > SAME_ALTITUDE) & (high - low > SAME_ALTITUDE))
        if left.size == 0:
            break
        chosen = chosen[left]
        guess, excess, before, excess_before, low, high = (
            values[left] for values in (guess, excess, before, excess_before, low, high)
        )
        low, high = np.where(excess > 0.0, guess, low), np.where(excess > 0.0, high, guess)
        with np.errstate(divide="ignore", invalid="ignore"):
            secant = guess - excess * (guess - before) / (excess - excess_before)
        inside = (secant > low) & (secant < high)
        before, excess_before = guess, excess
        guess = np.where(inside, secant, 0.5 * (low + high))
    return result
