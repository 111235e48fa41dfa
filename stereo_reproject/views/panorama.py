"""The camera model of panoramas, and of perspective cameras with spherical stereo: a projection, and the eye's rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .camera import Array, Camera, Vector, ViewPlane
from .projections import Projection
from .spherical import SphericalStereo

PANORAMA_FROM_CAMERA = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""A panorama's own frame (x ahead, y left, z up) from camera space (x right, y up, looking along -z)."""


@dataclass(frozen=True)
class PanoramicCamera:
    """A camera whose depths are distances along its rays, which may begin in places of their own.

    window: the part of the projection's picture that is shown, by its sides in u and v. stereo: the eye's spherical
    stereo; None for a lens whose rays all begin in the camera's own place. around_world: spherical stereo turns around
    the world's z, and around the camera's own y otherwise. ends_at_lens: False for a camera whose rays go on beyond a
    fisheye's edge.
    """

    width: int
    height: int
    world_from_camera: Array
    window: ViewPlane
    projection: Projection
    stereo: SphericalStereo | None = None
    around_world: bool = False
    ends_at_lens: bool = True

    @property
    def lens(self) -> tuple[ViewPlane, Projection, SphericalStereo | None, bool]:
        """Window, projection and stereo, as `Camera.lens` says."""
        return self.window, self.projection, self.stereo, self.around_world

    @property
    def period_px(self) -> float:
        """Pixels to the right after which the same direction is shown again; +inf where that is never so."""
        return self.projection.period * self.width / abs(self.window.right - self.window.left)

    @property
    def is_flat(self) -> bool:
        """True for a perspective camera with spherical stereo, as `Camera.is_flat` says."""
        return self.around_world

    @property
    def has_lens_edge(self) -> bool:
        """True where there is an edge of the lens, as `Projection.has_edge` says."""
        return self.projection.has_edge

    def ray_from_px(self, x: Array, y: Array) -> tuple[Vector, Vector]:
        """Return origin and unit direction of rays, as `Camera.ray_from_px` says; NaN where the picture shows
        nothing."""
        looking = self.looking_from_px(x, y)
        if self.ends_at_lens and self.has_lens_edge:
            looking = _scaled(looking, np.where(self.within_lens(x, y) >= 0.0, 1.0, np.nan))
        camera_from_panorama = PANORAMA_FROM_CAMERA.T
        if self.stereo is None:
            zero = np.array(0.0)
            length = np.sqrt(sum(np.square(part) for part in looking))
            return (zero, zero, zero), _turned(camera_from_panorama, _scaled(looking, 1.0 / length))
        upright = self._upright_from_panorama()
        back = camera_from_panorama @ np.linalg.inv(upright)
        origin, direction = self.stereo.rays(_turned(upright, looking))
        return _turned(back, origin), _turned(back, direction)

    def looking_in_camera(self, x: Array, y: Array) -> Vector:
        """Return the directions, in camera space, in which the camera alone would look at pixel positions (x, y),
        before it is an eye's. Their length counts as in `SphericalStereo.rays`. Beyond a fisheye's edge they go on as
        its formula does."""
        return _turned(PANORAMA_FROM_CAMERA.T, self.looking_from_px(x, y))

    @property
    def up(self) -> Array:
        """Unit vector (3,), in camera space, around which spherical stereo turns."""
        return PANORAMA_FROM_CAMERA.T @ np.linalg.inv(self._upright_from_panorama())[:, 2]

    def px_from_point(self, point: Vector, weight: Array) -> tuple[Array, Array, Array]:
        """Return pixel position x, y and distance of points, as `Camera.px_from_point` says; NaN for points that are
        not seen."""
        local = _turned(PANORAMA_FROM_CAMERA, point)
        if self.stereo is None:
            looking, length = local, np.sqrt(sum(np.square(part) for part in local))
            with np.errstate(divide="ignore"):
                distance = length / weight
        else:
            upright = self._upright_from_panorama()
            seen, distance = self.stereo.directions(_turned(upright, local), weight, is_unit=self.projection.is_unit)
            looking = _turned(np.linalg.inv(upright), seen)
        x, y = self.px_from_looking(looking)
        return x, y, distance

    def px_from_looking(self, direction: Vector) -> tuple[Array, Array]:
        """Return the pixel positions x, y at which directions of any length, in the panorama's frame, are shown: those
        in which the camera alone would look, whatever its stereo is."""
        u, v = self.projection.uv_from_direction(direction)
        window = self.window
        x = (u - window.left) * (self.width / (window.right - window.left))
        if np.isfinite(self.period_px):
            # A window that is shifted or cropped has another middle than the projection.
            x = x - self.period_px * np.round((x - 0.5 * self.width) / self.period_px)
        return x, (window.top - v) * (self.height / (window.top - window.bottom))

    def nearness_from_depth(self, depth: Array) -> Array:
        """Return 1 / distance, which is 0 for the sky."""
        with np.errstate(divide="ignore"):
            return 1.0 / depth

    def depth_from_nearness(self, nearness: Array) -> Array:
        """Return 1 / nearness, which is +inf for 0."""
        with np.errstate(divide="ignore", over="ignore"):
            return 1.0 / nearness

    def depth_from_pass(self, x: Array, y: Array, value: Array) -> Array:
        """Return the distance along the rays, as `Camera.depth_from_pass` says: Blender's pass has the distance from
        the camera's own place, or along its axis for a perspective camera."""
        if self.stereo is None and not self.around_world:
            return np.where(self.within_lens(x, y) >= 0.0, value, np.nan) if self.has_lens_edge else value
        if not self.around_world:
            return self.depth_from_distance(x, y, value)
        origin, direction = self.ray_from_px(x, y)
        return (-value - origin[2]) / direction[2]

    def pass_from_depth(self, x: Array, y: Array, depth: Array) -> Array:
        """Return the value of Blender's Depth pass, as `Camera.pass_from_depth` says; beyond the edge
        of a lens that is the sky's, +inf."""
        if self.around_world:
            origin, direction = self.ray_from_px(x, y)
            return -(origin[2] + depth * direction[2])
        value = depth if self.stereo is None else self.distance_from_depth(x, y, depth)
        return np.where(self.within_lens(x, y) >= 0.0, value, np.inf) if self.has_lens_edge else value

    def distance_from_depth(self, x: Array, y: Array, depth: Array) -> Array:
        """Return the distance from the camera's own place of the points at pixel positions (x, y) and this depth: the
        inverse of `depth_from_distance`."""
        ahead, beside = _past_origin(*self.ray_from_px(x, y))
        return np.sqrt(np.square(depth + ahead) + beside)

    def depth_from_distance(self, x: Array, y: Array, distance: Array) -> Array:
        """Return the distance along the rays through pixel positions (x, y) of points at a distance from the camera's
        own place."""
        ahead, beside = _past_origin(*self.ray_from_px(x, y))
        with np.errstate(invalid="ignore"):
            return np.sqrt(np.maximum(np.square(distance) - beside, 0.0)) - ahead

    def near_clips(self, x: Array, y: Array) -> Array:
        """Return the distance along the rays through pixel positions (x, y), in near clips, at which Cycles clips
        them: 1 in a panorama, and at the plane of the near clip in a perspective camera."""
        if not self.around_world:
            return np.ones(np.broadcast_shapes(np.shape(x), np.shape(y)))
        return 1.0 / self.looking_from_px(x, y)[0]

    def looking_from_px(self, x: Array, y: Array) -> Vector:
        """Return the directions in which the camera alone would look at pixel positions (x, y), in the panorama's
        frame, as the projection has them."""
        return self.projection.direction_from_uv(*self._uv(x, y))

    def within_lens(self, x: Array, y: Array) -> Array:
        """Return how far within the lens's edge pixel positions (x, y) lie, as `Projection.within_lens` says."""
        return self.projection.within_lens(*self._uv(x, y))

    def _uv(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the places u, v in the projection's picture of pixel positions (x, y)."""
        window = self.window
        u = window.left + (window.right - window.left) / self.width * x
        return u, window.top - (window.top - window.bottom) / self.height * y

    def _upright_from_panorama(self) -> Array:
        """Return the turn (3, 3) from the panorama's frame to that in which spherical stereo has its z."""
        if not self.around_world:
            return np.eye(3)
        return self.world_from_camera[:3, :3] @ PANORAMA_FROM_CAMERA.T


def has_lens_edge(camera: Camera) -> bool:
    """Return whether a camera has an edge of its lens, beyond which its picture may show nothing."""
    return isinstance(camera, PanoramicCamera) and camera.has_lens_edge


def shows_lens_edge(camera: Camera) -> bool:
    """Return whether the edge of a camera's lens is in its picture: whether a corner lies beyond it."""
    corners = np.array([0.0, camera.width]), np.array([[0.0], [camera.height]])
    return has_lens_edge(camera) and bool(is_beyond_lens(camera, *corners).any())


def is_beyond_lens(camera: Camera, x: Array, y: Array) -> NDArray[np.bool_]:
    """Return whether pixel positions (x, y) of a camera with an edge of its lens lie beyond it."""
    assert isinstance(camera, PanoramicCamera)
    return camera.within_lens(x, y) < 0.0


def share_between_eyes(camera: Camera, distance: Array) -> float:
    """Return the share of a picture in which something is nearer to the camera than the eyes of its spherical stereo
    are to each other, by the distances (H, W) from the camera's own place: 0 is where the lens shows nothing. Eyes see
    no such thing alike. The share is 0 for cameras without spherical stereo.
    """
    if not isinstance(camera, PanoramicCamera) or camera.stereo is None:
        return 0.0
    return float(np.mean((distance > 0.0) & (distance < 2.0 * abs(camera.stereo.offset))))


def _past_origin(origin: Vector, direction: Vector) -> tuple[Array, Array]:
    """Return how far ahead along unit rays they begin, counted from where they come nearest to the camera's own place,
    and the square of their distance from it there."""
    ahead = sum((o * d for o, d in zip(origin, direction, strict=True)), start=np.array(0.0))
    return ahead, sum((np.square(o) for o in origin), start=np.array(0.0)) - np.square(ahead)


def _scaled(vector: Vector, factor: Array) -> Vector:
    """Return a vector times a factor."""
    x, y, z = vector
    return x * factor, y * factor, z * factor


def _turned(matrix: Array, vector: Vector) -> Vector:
    """Return a matrix (3, 3) times a vector, without the products with 0."""
    rows: list[list[float]] = matrix.tolist()
    parts = []
    for row in rows:
        used = [factor * part if factor != 1.0 else part for factor, part in zip(row, vector, strict=True) if factor]
        parts.append(sum(used[1:], start=used[0]))
    x, y, z = parts
    return x, y, z
