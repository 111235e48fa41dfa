"""Projections of panoramic cameras: a place in the picture to a direction, and back.

Directions are in a panorama's own frame: x ahead, y to the left, z up. Places u, v are 0 to 1 over the whole picture, u
to the right and v upwards; beyond that where a picture is shifted. Sizes of the sensor and focal lengths are in
millimetres, angles in radians. Source: Cycles, `kernel/camera/projection.h`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .camera import Array, Vector

NEWTON_ROUNDS = 30
"""Rounds in which a polynomial lens is inverted, at most: some four are usual."""

SAME_ANGLE = 1e-9
"""Radians up to which the inverse of a polynomial lens counts as found."""


class Projection(Protocol):
    """A projection: its two maps, and what of a panorama it shows."""

    @property
    def is_unit(self) -> bool:
        """True if directions have the length 1; otherwise their horizontal part has."""
        ...

    @property
    def period(self) -> float:
        """Distance in u after which the same direction is shown again; +inf where that is never so."""
        ...

    @property
    def columns_alike(self) -> bool:
        """True if all columns of the picture show as much as each other, so that a pixel's size depends on its row
        alone."""
        ...

    @property
    def has_edge(self) -> bool:
        """True if there is an edge of the lens beyond which nothing is shown; otherwise `within_lens` is 1."""
        ...

    def direction_from_uv(self, u: Array, v: Array) -> Vector:
        """Return the directions that are shown at places u, v. Beyond the edge of a lens it goes on as the formula
        does, as far as that has any direction; NaN further out."""
        ...

    def within_lens(self, u: Array, v: Array) -> Array:
        """Return how far within the lens's edge places u, v lie, in a unit of the projection's own: 0 at the edge and
        negative beyond, where the picture shows nothing. It is 1 where a lens has no edge."""
        ...

    def uv_from_direction(self, direction: Vector) -> tuple[Array, Array]:
        """Return the places u, v at which directions of any length are shown; NaN where there is none.

        Beyond the picture's edge it goes on as the projection's formula does.
        """
        ...


def _azimuth_near(middle: float, direction: Vector) -> Array:
    """Return the angle to the right of straight ahead of directions, within half a turn of `middle`."""
    ahead, aside, _ = direction
    turned = -np.arctan2(aside, ahead) - middle
    return middle + turned - 2.0 * np.pi * np.round(turned / (2.0 * np.pi))


class _WholePicture:
    """Common part of the projections that fill the whole picture."""

    has_edge = False
    columns_alike = False

    def within_lens(self, u: Array, v: Array) -> Array:
        """Return 1: there is no edge."""
        return np.ones(np.broadcast_shapes(np.shape(u), np.shape(v)))


@dataclass(frozen=True)
class Equirectangular(_WholePicture):
    """The projection whose columns are longitudes and whose rows are latitudes, from the first to the last in each."""

    longitudes: tuple[float, float]
    latitudes: tuple[float, float]

    is_unit = True
    columns_alike = True

    @property
    def period(self) -> float:
        """Distance in u of a whole turn."""
        return 2.0 * np.pi / abs(self.longitudes[1] - self.longitudes[0])

    def direction_from_uv(self, u: Array, v: Array) -> Vector:
        """Return unit directions, as `Projection` says."""
        (west, east), (south, north) = self.longitudes, self.latitudes
        azimuth, altitude = -west - u * (east - west), south + v * (north - south)
        return np.cos(altitude) * np.cos(azimuth), np.cos(altitude) * np.sin(azimuth), np.sin(altitude)

    def uv_from_direction(self, direction: Vector) -> tuple[Array, Array]:
        """Return places u, v, as `Projection` says; u is the one nearest to the picture's middle."""
        (west, east), (south, north) = self.longitudes, self.latitudes
        altitude = np.arctan2(direction[2], np.hypot(direction[0], direction[1]))
        u = (_azimuth_near(0.5 * (west + east), direction) - west) / (east - west)
        return u, (altitude - south) / (north - south)


@dataclass(frozen=True)
class CentralCylindrical(_WholePicture):
    """The projection onto a cylinder of radius 1 around the vertical, from its axis.

    longitudes are the first and the last, heights those of the lower and the upper edge. is_unit: Cycles hands the
    direction on to spherical stereo as a place on the cylinder, and as a unit direction where the lens has an aperture.
    """

    longitudes: tuple[float, float]
    heights: tuple[float, float]
    is_unit: bool = False

    columns_alike = True

    @property
    def period(self) -> float:
        """Distance in u of a whole turn."""
        return 2.0 * np.pi / abs(self.longitudes[1] - self.longitudes[0])

    def direction_from_uv(self, u: Array, v: Array) -> Vector:
        """Return directions whose horizontal part is of length 1 unless `is_unit`, as `Projection` says."""
        (west, east), (low, high) = self.longitudes, self.heights
        azimuth, height = -west - u * (east - west), low + v * (high - low)
        direction = (np.cos(azimuth) + 0.0 * height, np.sin(azimuth) + 0.0 * height, height + 0.0 * azimuth)
        return unit(direction) if self.is_unit else direction

    def uv_from_direction(self, direction: Vector) -> tuple[Array, Array]:
        """Return places u, v, as `Projection` says; u is the one nearest to the picture's middle."""
        (west, east), (low, high) = self.longitudes, self.heights
        with np.errstate(divide="ignore", invalid="ignore"):
            height = direction[2] / np.hypot(direction[0], direction[1])
        u = (_azimuth_near(0.5 * (west + east), direction) - west) / (east - west)
        return u, (height - low) / (high - low)


class _Fisheye:
    """Common part of fisheye lenses: a direction's angle off the axis is a function of its distance from the middle.

    Subclasses say how large the picture is in the unit of that distance, and have the function and its inverse.
    """

    is_unit = True
    period = np.inf
    has_edge = True
    columns_alike = False

    @property
    def _size(self) -> tuple[float, float]:
        """Width and height of the picture in the unit of `_angle`'s argument."""
        raise NotImplementedError

    @property
    def _widest(self) -> float:
        """Largest angle off the axis that the lens shows."""
        raise NotImplementedError

    def _angle(self, radius: Array) -> Array:
        """Return the angle off the axis at a distance from the picture's middle; NaN where there is none."""
        raise NotImplementedError

    def _radius(self, angle: Array) -> Array:
        """Return the distance from the picture's middle of an angle off the axis; NaN where there is none."""
        raise NotImplementedError

    def direction_from_uv(self, u: Array, v: Array) -> Vector:
        """Return unit directions, as `Projection` says."""
        width, height = self._size
        across, up = (u - 0.5) * width, (v - 0.5) * height
        radius = np.hypot(across, up)
        angle = self._angle(radius)
        middle = radius == 0.0
        with np.errstate(invalid="ignore"):
            # In the very middle Cycles takes what is above it.
            sine = np.sin(angle) / np.where(middle, 1.0, radius)
        return np.cos(angle), -across * sine, np.where(middle, np.sin(angle), up * sine)

    def within_lens(self, u: Array, v: Array) -> Array:
        """Return the radians by which the angle off the axis is smaller than the widest one."""
        width, height = self._size
        angle = np.abs(self._angle(np.hypot((u - 0.5) * width, (v - 0.5) * height)))
        return self._widest - np.nan_to_num(angle, nan=np.pi)

    def uv_from_direction(self, direction: Vector) -> tuple[Array, Array]:
        """Return places u, v, as `Projection` says."""
        width, height = self._size
        ahead, aside, up = direction
        off_axis = np.hypot(aside, up)
        radius = self._radius(np.arctan2(off_axis, ahead))
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.where(off_axis > 0.0, radius / off_axis, 0.0)
        return 0.5 - scale * aside / width, 0.5 + scale * up / height


@dataclass(frozen=True)
class FisheyeEquidistant(_Fisheye):
    """The fisheye lens in which an angle off the axis is proportional to the distance from the middle. It fills the
    picture's width and height alike, whatever their ratio is; field_of_view is its diameter."""

    field_of_view: float

    @property
    def _size(self) -> tuple[float, float]:
        return 2.0, 2.0

    @property
    def _widest(self) -> float:
        return 0.5 * self.field_of_view

    def _angle(self, radius: Array) -> Array:
        return 0.5 * self.field_of_view * radius

    def _radius(self, angle: Array) -> Array:
        return angle / (0.5 * self.field_of_view)


@dataclass(frozen=True)
class FisheyeEquisolid(_Fisheye):
    """The fisheye lens in which equal areas show equal solid angles: radius = 2 focal length sin(angle / 2).

    sensor: width and height of what the whole picture covers. field_of_view is the lens's diameter.
    """

    focal_length: float
    field_of_view: float
    sensor: tuple[float, float]

    @property
    def _size(self) -> tuple[float, float]:
        return self.sensor

    @property
    def _widest(self) -> float:
        return 0.5 * self.field_of_view

    def _angle(self, radius: Array) -> Array:
        with np.errstate(invalid="ignore"):
            return 2.0 * np.arcsin(radius / (2.0 * self.focal_length))

    def _radius(self, angle: Array) -> Array:
        return 2.0 * self.focal_length * np.sin(0.5 * angle)


@dataclass(frozen=True)
class FisheyePolynomial(_Fisheye):
    """The fisheye lens whose angle off the axis is a polynomial of the distance r from the middle, of fourth order:
    -(k0 + k1 r + k2 r² + k3 r³ + k4 r⁴).

    sensor: width and height of what the whole picture covers. field_of_view is the lens's diameter.
    """

    coefficients: tuple[float, float, float, float, float]
    field_of_view: float
    sensor: tuple[float, float]

    @property
    def _size(self) -> tuple[float, float]:
        return self.sensor

    @property
    def _widest(self) -> float:
        return 0.5 * self.field_of_view

    def _angle(self, radius: Array) -> Array:
        return -np.polynomial.polynomial.polyval(radius, self.coefficients)

    def _radius(self, angle: Array) -> Array:
        polynomial = -np.polynomial.Polynomial(self.coefficients)
        slope = polynomial.deriv()
        with np.errstate(all="ignore"):
            radius = (angle - self.coefficients[0]) / -self.coefficients[1]
            for _ in range(NEWTON_ROUNDS):
                step = (polynomial(radius) - angle) / slope(radius)
                radius = radius - step
                if not np.any(np.abs(step) > 1e-12 * (1.0 + np.abs(radius))):
                    break
            return np.where(np.abs(polynomial(radius) - angle) < SAME_ANGLE, radius, np.nan)


@dataclass(frozen=True)
class EquiangularCubeFace(_WholePicture):
    """One face of a cube map, 90° wide and high, whose columns and rows are equal angles apart."""

    is_unit = True
    period = np.inf

    def direction_from_uv(self, u: Array, v: Array) -> Vector:
        """Return unit directions, as `Projection` says."""
        aside, up = np.tan((0.5 - u) * (0.5 * np.pi)), np.tan((v - 0.5) * (0.5 * np.pi))
        return unit((np.ones(np.broadcast_shapes(np.shape(u), np.shape(v))), aside, up))

    def uv_from_direction(self, direction: Vector) -> tuple[Array, Array]:
        """Return places u, v, as `Projection` says; NaN behind the camera."""
        ahead = np.where(direction[0] > 0.0, direction[0], np.nan)
        quarter = 0.5 * np.pi
        return 0.5 - np.arctan2(direction[1], ahead) / quarter, 0.5 + np.arctan2(direction[2], ahead) / quarter


@dataclass(frozen=True)
class Rectilinear(_WholePicture):
    """The projection of a perspective camera. u and v are places on the view plane at unit depth, u to the right."""

    is_unit = True
    period = np.inf

    def direction_from_uv(self, u: Array, v: Array) -> Vector:
        """Return unit directions, as `Projection` says."""
        return unit((np.ones(np.broadcast_shapes(np.shape(u), np.shape(v))), -u, v))

    def uv_from_direction(self, direction: Vector) -> tuple[Array, Array]:
        """Return places u, v, as `Projection` says; NaN behind the camera."""
        ahead = np.where(direction[0] > 0.0, direction[0], np.nan)
        return -direction[1] / ahead, direction[2] / ahead


def unit(direction: Vector) -> Vector:
    """Return directions made as long as 1."""
    length: NDArray[np.floating] = np.sqrt(sum(np.square(part) for part in direction))
    first, second, third = (part / length for part in direction)
    return first, second, third
