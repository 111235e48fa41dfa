"""Camera models: the two maps that a warp needs, pixel to ray and point to pixel.

Every model answers both in its own camera space, so that nothing in the warp depends on a 4 x 4 projection matrix. A
ray is (origin, direction) with the direction scaled to advance one unit of depth: the point at depth z is
`origin + z * direction`. Points are homogeneous, (x, y, z) and a weight, so that the sky is a point like any other:
its weight is 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .tuning import TUNING

Array = NDArray[np.floating]
Vector = tuple[Array, Array, Array]


@dataclass(frozen=True)
class ViewPlane:
    """The rectangle of a view: at unit depth for a perspective camera, in scene units for an orthographic one."""

    left: float
    right: float
    bottom: float
    top: float


class Camera(Protocol):
    """A camera model: its two maps, its size in pixels, and its pose `world_from_camera` (4, 4), which is rigid."""

    @property
    def width(self) -> int: ...

    @property
    def height(self) -> int: ...

    @property
    def plane(self) -> ViewPlane: ...

    @property
    def world_from_camera(self) -> Array: ...

    def ray_from_px(self, x: Array, y: Array) -> tuple[Vector, Vector]:
        """Return origin and direction, in camera space, of the rays through pixel positions (x, y)."""
        ...

    def px_from_point(self, point: Vector, weight: Array) -> tuple[Array, Array, Array]:
        """Return the pixel position (x, y) and depth of homogeneous camera-space points; NaN where there is none."""
        ...

    def nearness_from_depth(self, depth: Array) -> Array:
        """Return the nearness: it grows towards the camera, and is linear over the picture on any plane."""
        ...

    def depth_from_nearness(self, nearness: Array) -> Array:
        """Return the depth: the inverse of `nearness_from_depth`."""
        ...


@dataclass(frozen=True)
class _PlanarCamera:
    width: int
    height: int
    world_from_camera: Array
    plane: ViewPlane

    def _plane_from_px(self, x: Array, y: Array) -> tuple[Array, Array]:
        plane = self.plane
        plane_x = plane.left + (plane.right - plane.left) / self.width * x
        plane_y = plane.top - (plane.top - plane.bottom) / self.height * y
        return plane_x, plane_y

    def _px_from_plane(self, plane_x: Array, plane_y: Array) -> tuple[Array, Array]:
        plane = self.plane
        x = (plane_x - plane.left) * (self.width / (plane.right - plane.left))
        y = (plane.top - plane_y) * (self.height / (plane.top - plane.bottom))
        return x, y


@dataclass(frozen=True)
class PerspectiveCamera(_PlanarCamera):
    """A pinhole; an off-axis view is nothing but a view plane that is not centred."""

    def ray_from_px(self, x: Array, y: Array) -> tuple[Vector, Vector]:
        zero, forward = np.array(0.0), np.array(-1.0)
        plane_x, plane_y = self._plane_from_px(x, y)
        return (zero, zero, zero), (plane_x, plane_y, forward)

    def px_from_point(self, point: Vector, weight: Array) -> tuple[Array, Array, Array]:
        px, py, pz = point
        with np.errstate(divide="ignore", invalid="ignore"):
            ahead = np.where(pz < 0, -pz, np.nan)
            x, y = self._px_from_plane(px / ahead, py / ahead)
            return x, y, ahead / weight

    def nearness_from_depth(self, depth: Array) -> Array:
        with np.errstate(divide="ignore"):
            return 1.0 / depth

    def depth_from_nearness(self, nearness: Array) -> Array:
        # Beside the sky a mean of two may be so small that it is the sky.
        with np.errstate(divide="ignore", over="ignore"):
            return 1.0 / nearness


@dataclass(frozen=True)
class OrthographicCamera(_PlanarCamera):
    """Parallel rays; the view plane is in scene units. Its sky is put at a depth that float32 still tells apart."""

    SKY_DEPTH = 1e9
    SKY_ROUNDING = 1e-6

    def ray_from_px(self, x: Array, y: Array) -> tuple[Vector, Vector]:
        zero, forward = np.array(0.0), np.array(-1.0)
        plane_x, plane_y = self._plane_from_px(x, y)
        return (plane_x, plane_y, zero), (zero, zero, forward)

    def px_from_point(self, point: Vector, weight: Array) -> tuple[Array, Array, Array]:
        px, py, pz = point
        weight = np.maximum(weight, 1.0 / self.SKY_DEPTH)
        ahead = np.where(pz < 0, weight, np.nan)
        x, y = self._px_from_plane(px / ahead, py / ahead)
        return x, y, -pz / ahead

    def nearness_from_depth(self, depth: Array) -> Array:
        return -np.minimum(depth, self.SKY_DEPTH)

    def depth_from_nearness(self, nearness: Array) -> Array:
        return np.where(nearness > -self.SKY_DEPTH * (1.0 - self.SKY_ROUNDING), -nearness, np.inf)


def ray_length_per_depth(camera: Camera, x: Array, y: Array) -> Array:
    """Return the length of the rays through pixel positions (x, y), for one unit of depth."""
    _, direction = camera.ray_from_px(x, y)
    return np.sqrt(sum(np.square(part) for part in direction))


def depth_from_ray_length(camera: Camera, length: Array, clip_start: float) -> Array:
    """Return the depth (H, W) of points at this length (H, W) along the pixels' rays, from where these are clipped."""
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    return length / ray_length_per_depth(camera, x, y) + clip_start


def target_from_source(source: Camera, target: Camera) -> Array:
    """Return the transform (4, 4) from source camera space to target camera space, free of the world's own offset.

    Rigid for most cameras; Blender leaves the axes of one with a sheared parent as they are.
    """
    rotation = np.linalg.inv(target.world_from_camera[:3, :3])
    result = np.eye(4)
    result[:3, :3] = rotation @ source.world_from_camera[:3, :3]
    result[:3, 3] = rotation @ (source.world_from_camera[:3, 3] - target.world_from_camera[:3, 3])
    return result


def see_the_same(source: Camera, target: Camera) -> bool:
    """Return whether both cameras have the same place, direction and view plane: then nothing moves between them."""
    same_place = np.allclose(target_from_source(source, target), np.eye(4), rtol=0.0, atol=1e-12)
    return same_place and source.plane == target.plane


def target_px_from_source_px(
    source: Camera, target: Camera, x: Array, y: Array, depth: Array
) -> tuple[Array, Array, Array]:
    """Return the target pixel positions x, y and depths of points seen at source positions x, y and `depth`.

    x, y and depth broadcast; depth may be +inf. The result is NaN where a point lies behind the target camera.
    """
    transform = target_from_source(source, target)
    origin, direction = source.ray_from_px(np.asarray(x, np.float64), np.asarray(y, np.float64))
    depth = np.asarray(depth, np.float64)
    # In its plane an orthographic camera sees as well as anywhere.
    weight = 1.0 / np.where(depth == 0.0, np.finfo(np.float32).tiny, depth)
    if isinstance(source, OrthographicCamera):
        weight = np.maximum(weight, 1.0 / OrthographicCamera.SKY_DEPTH)
    local = [o * weight + d for o, d in zip(origin, direction, strict=True)]
    rows: list[list[float]] = transform[:3].tolist()
    point_x, point_y, point_z = (
        sum((row[k] * local[k] for k in range(3) if row[k] != 0.0), start=row[3] * weight) for row in rows
    )
    return target.px_from_point((point_x, point_y, point_z), weight)


def disparity_per_nearness(source: Camera, target: Camera) -> float:
    """Return the pixels that a point moves in the target for one unit of source nearness, at the middle of the picture.

    Exact for rigs whose image planes coincide, a first-order estimate for toe-in: good enough to judge how large a
    step in depth is, which is all that it is used for.
    """
    transform = target_from_source(source, target)
    baseline = float(np.linalg.norm(transform[:3, 3]))
    if isinstance(source, OrthographicCamera) and isinstance(target, OrthographicCamera):
        return float(np.linalg.norm(transform[:2, 2] * _px_per_unit(target)))
    x, y = np.array(source.width / 2), np.array(source.height / 2)
    # Some tens of baselines away, where the finite difference loses no digits.
    scale = 50.0 * baseline if baseline > 0 else 1.0
    depth = np.array([scale, 2.0 * scale])
    target_x, target_y, _ = target_px_from_source_px(source, target, x, y, depth)
    moved = float(np.hypot(target_x[0] - target_x[1], target_y[0] - target_y[1]))
    nearness = source.nearness_from_depth(depth)
    estimate = moved / float(abs(nearness[0] - nearness[1]))
    if not isinstance(source, PerspectiveCamera) or not isinstance(target, PerspectiveCamera):
        return estimate
    # Where the middle of one eye's picture is far to the side of the other's, or behind it, that tells nothing.
    limit = TUNING.max_toe_in_factor * float(_px_per_unit(target).max()) * baseline
    return min(estimate, limit) if np.isfinite(estimate) else limit


def _px_per_unit(camera: Camera) -> Array:
    """Return (2,) the pixels per unit of the view plane, across and down."""
    plane = camera.plane
    return np.array([camera.width / (plane.right - plane.left), camera.height / (plane.top - plane.bottom)])
