"""Camera models: the two maps that a warp needs, pixel to ray and point to pixel.

Every model answers both in its own camera space, so that nothing in the warp depends on a 4 x 4 projection matrix. A
ray is (origin, direction) with the direction scaled to advance one unit of depth: the point at depth z is
`origin + z * direction`. Depth is measured along the camera's axis by planar cameras, and along the ray by panoramic
ones (`views.panorama`). Points are homogeneous, (x, y, z) and a weight, so that the sky is a point like any other: its
weight is 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TypeGuard

import numpy as np
from numpy.typing import NDArray

from .tuning import TUNING

Array = NDArray[np.floating]
Vector = tuple[Array, Array, Array]

PANORAMA_LATTICE = 5
"""Places across and down by which the parallax of a panorama is judged: the middle and some on all sides of it."""

SAME_PERIOD_PIXELS = 1e-3
"""Pixels by which a whole turn may differ from one or two widths of the picture and is still that: angles in Blender
are of single precision."""

ROWS_AT_ONCE = 64
"""Rows of a picture whose rays are worked out at once, so that temporaries stay small."""


@dataclass(frozen=True)
class ViewPlane:
    """The rectangle that a view shows, by its four sides in camera space: x to the right, y upwards.

    It lies at unit depth for a perspective camera; for an orthographic one it is in scene units.
    """

    left: float
    right: float
    bottom: float
    top: float


class Camera(Protocol):
    """A camera model: its two maps, pixel to ray and point to pixel, its size in pixels, and its pose.

    Camera space has x to the right, y upwards, and looks along -z. Pixel positions count from the picture's upper left
    corner, x to the right and y downwards, so that the first pixel's centre is (0.5, 0.5).
    """

    @property
    def width(self) -> int:
        """Width of the picture in pixels."""
        ...

    @property
    def height(self) -> int:
        """Height of the picture in pixels."""
        ...

    @property
    def period_px(self) -> float:
        """Pixels to the right after which the same direction is shown again; +inf where that is never so."""
        ...

    @property
    def is_flat(self) -> bool:
        """True where people look at the picture on a flat screen, each pixel as large as any other; False where they
        see each pixel under the angle that the camera has for it."""
        ...

    @property
    def lens(self) -> object:
        """All that decides, besides size and pose, what the picture shows: cameras in one place with equal ones see the
        same."""
        ...

    @property
    def world_from_camera(self) -> Array:
        """Pose of the camera: the transform (4, 4) from camera space to the world, rigid but for cameras with a sheared
        parent."""
        ...

    def ray_from_px(self, x: Array, y: Array) -> tuple[Vector, Vector]:
        """Return origin and direction, each as x, y, z in camera space, of the rays through pixel positions (x, y).

        A direction advances one unit of depth: the point at depth d is origin + d * direction.
        """
        ...

    def px_from_point(self, point: Vector, weight: Array) -> tuple[Array, Array, Array]:
        """Return pixel position x, y and depth of camera-space points; NaN for points that are not ahead of the camera.

        `point` is homogeneous: x, y and z of the point, each multiplied by `weight`. The weight of the sky is 0.
        """
        ...

    def nearness_from_depth(self, depth: Array) -> Array:
        """Return the nearness of points at a depth: it grows towards the camera, and is linear over the picture on any
        plane."""
        ...

    def depth_from_nearness(self, nearness: Array) -> Array:
        """Return the depth of points by their nearness: the inverse of `nearness_from_depth`."""
        ...

    def depth_from_pass(self, x: Array, y: Array, value: Array) -> Array:
        """Return the depth of the points at pixel positions (x, y) of which Blender's Depth pass has this value."""
        ...

    def pass_from_depth(self, x: Array, y: Array, depth: Array) -> Array:
        """Return the value that Blender's Depth pass has for points at pixel positions (x, y) and this depth: the
        inverse of `depth_from_pass`."""
        ...


@dataclass(frozen=True)
class _PlanarCamera:
    """Common part of the cameras that have a view plane: their fields, and the map between pixels and places on it."""

    width: int
    height: int
    world_from_camera: Array
    plane: ViewPlane

    period_px = np.inf
    is_flat = True

    @property
    def lens(self) -> ViewPlane:
        """The view plane, as `Camera.lens` says."""
        return self.plane

    def depth_from_pass(self, x: Array, y: Array, value: Array) -> Array:  # noqa: ARG002
        """Return the value itself: Blender's Depth pass has the depth."""
        return value

    def pass_from_depth(self, x: Array, y: Array, depth: Array) -> Array:  # noqa: ARG002
        """Return the depth itself: it is what Blender's Depth pass has."""
        return depth

    def _plane_from_px(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return x and y on the view plane, in its units, of pixel positions (x, y)."""
        plane = self.plane
        plane_x = plane.left + (plane.right - plane.left) / self.width * x
        plane_y = plane.top - (plane.top - plane.bottom) / self.height * y
        return plane_x, plane_y

    def _px_from_plane(self, plane_x: Array, plane_y: Array) -> tuple[Array, Array]:
        """Return pixel positions x and y of places on the view plane: the inverse of `_plane_from_px`."""
        plane = self.plane
        x = (plane_x - plane.left) * (self.width / (plane.right - plane.left))
        y = (plane.top - plane_y) * (self.height / (plane.top - plane.bottom))
        return x, y


@dataclass(frozen=True)
class PerspectiveCamera(_PlanarCamera):
    """A pinhole camera. An off-axis view, as of an eye, is one whose view plane is not centred; nothing else
    differs."""

    def ray_from_px(self, x: Array, y: Array) -> tuple[Vector, Vector]:
        """Return origin, which is the camera's own place, and direction of rays, as `Camera.ray_from_px` says."""
        zero, forward = np.array(0.0), np.array(-1.0)
        plane_x, plane_y = self._plane_from_px(x, y)
        return (zero, zero, zero), (plane_x, plane_y, forward)

    def px_from_point(self, point: Vector, weight: Array) -> tuple[Array, Array, Array]:
        """Return pixel position x, y and depth of points, as `Camera.px_from_point` says."""
        px, py, pz = point
        with np.errstate(divide="ignore", invalid="ignore"):
            ahead = np.where(pz < 0, -pz, np.nan)
            x, y = self._px_from_plane(px / ahead, py / ahead)
            return x, y, ahead / weight

    def nearness_from_depth(self, depth: Array) -> Array:
        """Return 1 / depth, which is 0 for the sky."""
        with np.errstate(divide="ignore"):
            return 1.0 / depth

    def depth_from_nearness(self, nearness: Array) -> Array:
        """Return 1 / nearness, which is +inf for 0."""
        # Beside the sky a mean of two may be so small that it is the sky.
        with np.errstate(divide="ignore", over="ignore"):
            return 1.0 / nearness


@dataclass(frozen=True)
class OrthographicCamera(_PlanarCamera):
    """A camera with parallel rays; its view plane is in scene units.

    The sky is put at the depth SKY_DEPTH, where float32 still tells depths apart.
    """

    SKY_DEPTH = 1e9
    SKY_ROUNDING = 1e-6

    def ray_from_px(self, x: Array, y: Array) -> tuple[Vector, Vector]:
        """Return origin, on the view plane, and direction of rays, as `Camera.ray_from_px` says."""
        zero, forward = np.array(0.0), np.array(-1.0)
        plane_x, plane_y = self._plane_from_px(x, y)
        return (plane_x, plane_y, zero), (zero, zero, forward)

    def px_from_point(self, point: Vector, weight: Array) -> tuple[Array, Array, Array]:
        """Return pixel position x, y and depth of points, as `Camera.px_from_point` says; the sky's depth is at most
        SKY_DEPTH."""
        px, py, pz = point
        weight = np.maximum(weight, 1.0 / self.SKY_DEPTH)
        ahead = np.where(pz < 0, weight, np.nan)
        x, y = self._px_from_plane(px / ahead, py / ahead)
        return x, y, -pz / ahead

    def nearness_from_depth(self, depth: Array) -> Array:
        """Return -depth, held at -SKY_DEPTH for the sky."""
        return -np.minimum(depth, self.SKY_DEPTH)

    def depth_from_nearness(self, nearness: Array) -> Array:
        """Return -nearness, and +inf where that is the sky's depth to within rounding."""
        return np.where(nearness > -self.SKY_DEPTH * (1.0 - self.SKY_ROUNDING), -nearness, np.inf)


PlanarCamera = PerspectiveCamera | OrthographicCamera
"""Cameras that have a view plane."""


def is_planar(camera: Camera) -> TypeGuard[PlanarCamera]:
    """Return whether a camera has a view plane."""
    return isinstance(camera, PlanarCamera)


def planar(camera: Camera) -> PlanarCamera:
    """Return the camera itself, for what needs its view plane. Raises TypeError if it has none."""
    if isinstance(camera, PlanarCamera):
        return camera
    raise TypeError(f"{type(camera).__name__} has no view plane")


def pixel_size(camera: Camera) -> tuple[float, float]:
    """Return the width and the height of a camera's pixel on its view plane, in the plane's units."""
    plane = planar(camera).plane
    return (plane.right - plane.left) / camera.width, (plane.top - plane.bottom) / camera.height


def ray_length_per_depth(camera: Camera, x: Array, y: Array) -> Array:
    """Return the length, in scene units, that the rays through pixel positions (x, y) have for one unit of depth."""
    _, direction = camera.ray_from_px(x, y)
    return np.sqrt(sum(np.square(part) for part in direction))


def depth_from_ray_length(camera: Camera, length: Array, clip_start: float) -> Array:
    """Return the depth (H, W) of the points that lie `length` (H, W) along the rays through the pixels' centres.

    Lengths count from the plane at the depth clip_start, where the camera clips its rays. All are in scene units.
    """
    result = np.empty(length.shape)
    x = np.arange(camera.width) + 0.5
    for top in range(0, camera.height, ROWS_AT_ONCE):
        rows = slice(top, top + ROWS_AT_ONCE)
        y = np.arange(camera.height)[rows, None] + 0.5
        result[rows] = length[rows] / ray_length_per_depth(camera, x, y) + clip_start
    return result


def target_from_source(source: Camera, target: Camera) -> Array:
    """Return the transform (4, 4) from source camera space to target camera space.

    It is computed from the distance between the cameras, so that far from the world's origin no digits are lost. It is
    rigid for most cameras; Blender leaves the axes of one with a sheared parent as they are.
    """
    rotation = np.linalg.inv(target.world_from_camera[:3, :3])
    result = np.eye(4)
    result[:3, :3] = rotation @ source.world_from_camera[:3, :3]
    result[:3, 3] = rotation @ (source.world_from_camera[:3, 3] - target.world_from_camera[:3, 3])
    return result


def see_the_same(source: Camera, target: Camera) -> bool:
    """Return whether both cameras have the same place, direction and lens, so that nothing moves between their
    pictures."""
    same_place = np.allclose(target_from_source(source, target), np.eye(4), rtol=0.0, atol=1e-12)
    return same_place and source.lens == target.lens


def target_px_from_source_px(
    source: Camera, target: Camera, x: Array, y: Array, depth: Array
) -> tuple[Array, Array, Array]:
    """Return where points of the source land in the target: pixel positions x and y in the target, and depth there.

    The points are seen at pixel positions x, y in the source, at `depth` (+inf for the sky); the three broadcast. The
    result is NaN where a point lies behind the target camera.
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


def eye_distance(source: Camera, target: Camera) -> float:
    """Return the distance, in scene units, between the places from which two cameras see: those of the cameras, or
    where their rays begin on the circle of spherical stereo, the largest one over a lattice of the picture."""
    if is_planar(source) and is_planar(target):
        return float(np.linalg.norm(target_from_source(source, target)[:3, 3]))
    places = []
    for camera in (source, target):
        x, y = _judged_places(camera)
        origin, _ = camera.ray_from_px(x, y)
        places.append(camera.world_from_camera[:3, :3] @ np.stack(np.broadcast_arrays(*origin, x)[:3]))
    own = source.world_from_camera[:3, 3] - target.world_from_camera[:3, 3]
    return _largest_finite(np.linalg.norm(own[:, None] + places[0] - places[1], axis=0))


def _judged_places(camera: Camera) -> tuple[Array, Array]:
    """Return the pixel positions x and y (N,) by which the parallax of a whole picture is judged: its middle, or a
    lattice in a panorama, which may have no parallax in some directions."""
    count = 1 if is_planar(camera) else PANORAMA_LATTICE
    share = (np.arange(count) + 0.5) / count
    x, y = np.meshgrid(share * camera.width, share * camera.height)
    return x.ravel(), y.ravel()


def goes_round(camera: Camera) -> bool:
    """Return whether a camera's picture closes a whole turn: whether its right side goes on at its left."""
    return abs(camera.period_px - camera.width) < SAME_PERIOD_PIXELS


def _largest_finite(values: Array) -> float:
    """Return the largest finite one of values, 0 or more; 0 where there is none."""
    return float(np.max(values, initial=0.0, where=np.isfinite(values)))


def disparity_per_nearness(source: Camera, target: Camera) -> float:
    """Return the pixels, 0 or more, that a point in the middle of the picture moves in the target for one unit of
    source nearness. In a panorama it is the largest such number over a lattice of the picture, in pixels as wide and as
    high as the largest ones: beside a pole, where pixels are narrow, a point moves over more of them by the same angle.

    It is used to judge how large a step in depth is. It is exact for rigs whose image planes coincide; for toe-in it is
    a first-order estimate, which is good enough for that.
    """
    transform = target_from_source(source, target)
    baseline = eye_distance(source, target)
    if isinstance(source, OrthographicCamera) and isinstance(target, OrthographicCamera):
        return float(np.linalg.norm(transform[:2, 2] * _px_per_unit(target)))
    x, y = _judged_places(source)
    # Some tens of baselines away, where the finite difference loses no digits.
    scale = 50.0 * baseline if baseline > 0 else 1.0
    depth = np.array([scale, 2.0 * scale])
    target_x, target_y, _ = target_px_from_source_px(source, target, x, y, depth[:, None])
    across, down = target_x[0] - target_x[1], target_y[0] - target_y[1]
    if np.isfinite(target.period_px):
        across = across - target.period_px * np.round(across / target.period_px)
    nearness = source.nearness_from_depth(depth)
    if not target.is_flat:
        wide, high = _relative_sizes(target, target_x[1], target_y[1])
        across, down = across * wide, down * high
    estimates = np.hypot(across, down) / abs(nearness[0] - nearness[1])
    if not is_planar(source):
        return _largest_finite(estimates)
    estimate = float(estimates[0])
    if not isinstance(source, PerspectiveCamera) or not isinstance(target, PerspectiveCamera):
        return estimate
    # Where the middle of one eye's picture is far to the side of the other's, or behind it, that tells nothing.
    limit = TUNING.max_toe_in_factor * float(_px_per_unit(target).max()) * baseline
    return min(estimate, limit) if np.isfinite(estimate) else limit


def _relative_sizes(camera: Camera, x: Array, y: Array) -> tuple[Array, Array]:
    """Return the widths and the heights (N,), as angles, of a panorama's pixels around pixel positions x, y (N,), each
    as a share of the largest one of them."""

    def directions(right: float, below: float) -> Array:
        return np.stack(np.broadcast_arrays(*camera.ray_from_px(x + right, y + below)[1]))

    halves = ((0.5, 0.0), (0.0, 0.5))
    sizes = [np.linalg.norm(directions(right, below) - directions(-right, -below), axis=0) for right, below in halves]
    across, down = (size / max(_largest_finite(size), np.finfo(np.float64).tiny) for size in sizes)
    return across, down


def _px_per_unit(camera: Camera) -> Array:
    """Return the pixels (2,) per unit of the view plane: across, then down."""
    plane = planar(camera).plane
    return np.array([camera.width / (plane.right - plane.left), camera.height / (plane.top - plane.bottom)])
