"""An analytic world to hold the engine against: stereo rigs, and a ray caster that is exact from any of their cameras.

It shares no formula with the engine: rays start from the camera's view plane and pose, not from its two maps.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from stereo_reproject.views.camera import OrthographicCamera, PerspectiveCamera, ViewPlane, is_planar

FOCAL = 1.2
"""Focal length of the test cameras, in widths of the picture's view plane."""

ORTHOGRAPHIC_WIDTH = 5.0
"""Width of the orthographic test cameras' view plane, in scene units."""


def rotation(*, yaw=0.0, pitch=0.0, roll=0.0):
    """(3, 3) from angles in radians about y, x and z, in this order from the outside in."""
    cy, sy, cp, sp, cr, sr = (f(a) for a in (yaw, pitch, roll) for f in (np.cos, np.sin))
    about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cp, -sp], [0.0, sp, cp]])
    about_z = np.array([[cr, -sr, 0.0], [sr, cr, 0.0], [0.0, 0.0, 1.0]])
    return about_y @ about_x @ about_z


def pose(position=(0.0, 0.0, 0.0), **angles):
    """world_from_camera (4, 4) of a camera at `position`, turned by `rotation`'s angles."""
    result = np.eye(4)
    result[:3, :3] = rotation(**angles)
    result[:3, 3] = position
    return result


def camera(size, world_from_camera=None, *, orthographic=False, shift=(0.0, 0.0)):
    """A camera of (width, height) pixels, square ones; shift moves the view plane, in its own units."""
    width, height = size
    half = 0.5 * (ORTHOGRAPHIC_WIDTH if orthographic else 1.0 / FOCAL)
    high = half * height / width
    plane = ViewPlane(shift[0] - half, shift[0] + half, shift[1] - high, shift[1] + high)
    model = OrthographicCamera if orthographic else PerspectiveCamera
    return model(width, height, np.eye(4) if world_from_camera is None else world_from_camera, plane)


def focal_px(size):
    """Pixels per unit of the view plane at unit depth."""
    return FOCAL * size[0]


def stereo_rig(size, *, mode="off-axis", ipd=0.1, convergence=4.0, orthographic=False, world=None):
    """{'left': camera, 'right': camera}, half the interocular distance to either side of `world` (4, 4)."""
    world = np.eye(4) if world is None else world
    eyes = {}
    for view, side in (("left", -0.5), ("right", 0.5)):
        offset = side * ipd
        yaw = np.arctan(offset / convergence) if mode == "toe-in" else 0.0
        shift = -offset / convergence if mode == "off-axis" and not orthographic else 0.0
        eyes[view] = camera(
            size, world @ pose((offset, 0.0, 0.0), yaw=yaw), orthographic=orthographic, shift=(shift, 0.0)
        )
    return eyes


def world_rays(eye, x, y):
    """Origins and directions (N, 3) in the world of the rays through pixel positions; directions advance one depth."""
    turn, place = eye.world_from_camera[:3, :3], eye.world_from_camera[:3, 3]
    if not is_planar(eye):
        origin, direction = (np.stack(np.broadcast_arrays(*part), axis=-1) for part in eye.ray_from_px(x, y))
        return origin @ turn.T + place, direction @ turn.T
    plane = eye.plane
    across = plane.left + (plane.right - plane.left) * x / eye.width
    up = plane.top + (plane.bottom - plane.top) * y / eye.height
    zero = np.zeros_like(across)
    if isinstance(eye, OrthographicCamera):
        origin, direction = np.stack([across, up, zero], -1), np.stack([zero, zero, zero - 1.0], -1)
    else:
        origin, direction = np.stack([zero, zero, zero], -1), np.stack([across, up, zero - 1.0], -1)
    return origin @ turn.T + place, direction @ turn.T


def px_from_world(eye, points):
    """Pixel x, y and depth (N,) of world points (N, 3), by plain pinhole or orthographic projection."""
    local = (points - eye.world_from_camera[:3, 3]) @ eye.world_from_camera[:3, :3]
    depth = -local[..., 2]
    scale = 1.0 if isinstance(eye, OrthographicCamera) else 1.0 / depth
    plane = eye.plane
    x = (local[..., 0] * scale - plane.left) / (plane.right - plane.left) * eye.width
    y = (local[..., 1] * scale - plane.top) / (plane.bottom - plane.top) * eye.height
    return x, y, depth


def pixel_centres(eye):
    """x, y (H, W) of the pixel centres."""
    return np.meshgrid(np.arange(eye.width) + 0.5, np.arange(eye.height) + 0.5)


@dataclass(frozen=True)
class Plane:
    """A plane through `point`; with `half`, only the square of that half size around it."""

    point: tuple[float, float, float]
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    half: float = np.inf

    def depth_along(self, origin, direction):
        normal = np.asarray(self.normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = (np.asarray(self.point) - origin) @ normal / (direction @ normal)
            beyond = np.abs(origin + depth[..., None] * direction - self.point).max(axis=-1) > self.half
        return np.where((depth > 0) & ~beyond, depth, np.inf)


@dataclass(frozen=True)
class Sphere:
    centre: tuple[float, float, float]
    radius: float

    def depth_along(self, origin, direction):
        towards = origin - np.asarray(self.centre)
        a, b = np.sum(direction**2, -1), np.sum(towards * direction, -1)
        under = b * b - a * (np.sum(towards**2, -1) - self.radius**2)
        with np.errstate(invalid="ignore"):
            depth = (-b - np.sqrt(under)) / a
        return np.where((under >= 0) & (depth > 0), depth, np.inf)


@dataclass(frozen=True)
class World:
    """Matte surfaces whose colour depends on the place alone, and a sky whose colour depends on the direction alone.

    So where two surfaces meet, their colours meet too. frequency: of the texture, in radians per scene unit.
    """

    surfaces: tuple = ()
    frequency: float = 1.5
    contrast: float = 0.3
    waves: np.ndarray = field(default_factory=lambda: np.random.default_rng(7).normal(size=(3, 3)))

    def hit(self, eye, x, y):
        """Depth (…) and index of the surface seen at pixel positions; +inf and 0 for the sky, 1 for the first."""
        origin, direction = world_rays(eye, np.asarray(x, np.float64), np.asarray(y, np.float64))
        depths = [np.full(np.shape(x), np.inf), *(s.depth_along(origin, direction) for s in self.surfaces)]
        index = np.argmin(depths, axis=0)
        return np.take_along_axis(np.array(depths), index[None], axis=0)[0], index

    def colour(self, eye, x, y):
        """(…, 4) scene-linear colour at pixel positions."""
        depth, _ = self.hit(eye, x, y)
        origin, direction = world_rays(eye, np.asarray(x, np.float64), np.asarray(y, np.float64))
        sky = np.isinf(depth)
        along = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
        place = np.where(sky[..., None], 2.0 * along, origin + np.where(sky, 0.0, depth)[..., None] * direction)
        rgb = 0.5 + self.contrast * np.sin(self.frequency * (place @ self.waves.T))
        return np.concatenate([rgb, np.ones((*rgb.shape[:-1], 1))], axis=-1)

    def render(self, eye, *, noise=0.0, seed=0, subpixels=1):
        """Passes as Blender would deliver them: colour box-filtered over subpixels², depth and index of the centre.

        noise is the standard deviation that is added to the colour, from a generator of its own.
        """
        x, y = pixel_centres(eye)
        depth, index = self.hit(eye, x, y)
        offsets = (np.arange(subpixels) + 0.5) / subpixels - 0.5
        colour = np.mean([self.colour(eye, x + dx, y + dy) for dx in offsets for dy in offsets], axis=0)
        if noise > 0.0:
            colour[..., :3] += np.random.default_rng(seed).normal(scale=noise, size=colour[..., :3].shape)
        return {
            "Combined": colour.astype(np.float32),
            "Depth": depth[..., None].astype(np.float32),
            "IndexOB": index[..., None].astype(np.float32),
        }
