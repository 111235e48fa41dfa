"""What a warp should have found, traced: for each target pixel the place in the source that shows the same point.

The rigs here take what Blender's cameras take (lens, sensor, shift, pixel aspect), to the extremes; the surfaces and
the ray caster are `analytic`'s, which share no formula with the engine.
"""

from __future__ import annotations

import contextlib
import warnings
from dataclasses import dataclass, field

import numpy as np
from hypothesis import settings

from stereo_reproject.settings.accuracy import Accuracy
from stereo_reproject.views.camera import Camera, OrthographicCamera, PerspectiveCamera, ViewPlane
from stereo_reproject.warp.composite import replace_non_finite
from tests.warp.analytic import pixel_centres, pose, px_from_world, world_rays
from tests.warp.pairs import reproject_pair

SENSOR = 36.0
"""Millimetres, as Blender's cameras have by default."""

STRICT = Accuracy(silhouette_step=0.1, silhouette_radius=2, colour_tolerance=0.0)
"""Every edge is flagged, whether its sides look alike or not: what is not flagged must be right by its place."""

SEEN = 1e-6
"""Share by which the source may see something nearer and still see the same point: the rounding of two traces."""


def examples(count):
    """Hypothesis's, the same in every run."""
    return settings(max_examples=count, derandomize=True, deadline=None, database=None)


@dataclass(frozen=True)
class Rig:
    """Two eyes as Blender sets them up. ipd < 0 swaps them; scale makes them parallel projections, so wide."""

    size: tuple[int, int] = (96, 64)
    lens: float = 50.0
    ipd: float = 0.065
    convergence: float = 2.0
    mode: str = "off-axis"
    shift: tuple[float, float] = (0.0, 0.0)
    aspect: float = 1.0
    """Width of a pixel over its height."""
    scale: float | None = None
    world: np.ndarray = field(default_factory=lambda: np.eye(4))

    def eye(self, side: float) -> Camera:
        """side: -0.5 is the left one, 0.5 the right one."""
        width, height = self.size
        wide, high = width * self.aspect, float(height)
        extent = SENSOR / self.lens if self.scale is None else self.scale
        unit = extent / max(wide, high)
        offset = side * self.ipd
        moved = 0.0
        if self.mode == "off-axis" and self.scale is None:
            moved = -offset / self.convergence
        yaw = float(np.arctan(offset / self.convergence)) if self.mode == "toe-in" else 0.0
        middle_x, middle_y = self.shift[0] * extent + moved, self.shift[1] * extent
        half_x, half_y = 0.5 * wide * unit, 0.5 * high * unit
        plane = ViewPlane(middle_x - half_x, middle_x + half_x, middle_y - half_y, middle_y + half_y)
        model = PerspectiveCamera if self.scale is None else OrthographicCamera
        return model(width, height, self.world @ pose((offset, 0.0, 0.0), yaw=yaw), plane)

    @property
    def eyes(self) -> tuple[Camera, Camera]:
        """Left and right."""
        return self.eye(-0.5), self.eye(0.5)


@dataclass(frozen=True)
class Exact:
    """(H, W) of the target: where the source has the same point, its depth in the target, and whether it is seen."""

    x: np.ndarray
    y: np.ndarray
    depth: np.ndarray
    index: np.ndarray
    seen: np.ndarray


def traced(world, source, target) -> Exact:
    """What a target pixel's centre shows, and where in the source that is."""
    column, row = pixel_centres(target)
    depth, index = world.hit(target, column, row)
    origin, direction = world_rays(target, column, row)
    sky = np.isinf(depth)
    points = origin + np.where(sky, 1.0, depth)[..., None] * direction
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y, source_depth = px_from_world(source, points)
        if isinstance(source, PerspectiveCamera):
            at = source.world_from_camera[:3, 3] + direction
            sky_x, sky_y, ahead = px_from_world(source, at)
            x, y = np.where(sky, sky_x, x), np.where(sky, sky_y, y)
            source_depth = np.where(sky, np.where(ahead > 0, np.inf, -1.0), source_depth)
        else:
            source_depth = np.where(sky, np.inf, source_depth)
        inside = (x >= 0) & (x <= source.width) & (y >= 0) & (y <= source.height) & (source_depth > 0)
        place_x, place_y = np.where(inside, x, 0.5), np.where(inside, y, 0.5)
        nearest, _ = world.hit(source, place_x, place_y)
        seen = inside & (nearest >= source_depth * (1.0 - SEEN))
    return Exact(x, y, depth, index, seen)


@contextlib.contextmanager
def nothing_said():
    """No warning of any kind, and no floating-point one that the code has not expected; denormals are let be."""
    with warnings.catch_warnings(), np.errstate(all="raise", under="ignore"):
        warnings.simplefilter("error")
        yield


def passes_of(depth, colour=None, **others):
    """A source's passes: depth (H, W), and a colour that tells every place if there is none given."""
    depth = np.asarray(depth, np.float32)
    height, width = depth.shape
    if colour is None:
        x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        colour = np.stack([x / width, y / height, 0.5 + 0.0 * x, 1.0 + 0.0 * x], axis=-1)
    return {"Combined": np.asarray(colour, np.float32), "Depth": depth[..., None], **others}


def reprojected(passes, source, target, *, accuracy=STRICT, cleaned=True, **options):
    """The way of a render: its passes are cleaned, then warped; without cleaned they go in as they are."""
    with nothing_said():
        invalid = np.zeros(passes["Combined"].shape[:2], bool)
        if cleaned:
            passes, invalid = replace_non_finite(passes)
        result = reproject_pair(passes, source, target, accuracy=accuracy, invalid=invalid, **options)
        assert result.reasons.shape == (target.height, target.width)
    return result


def where_they_go(source, target, depth):
    """Target x, y (H, W) of the source's pixel centres at `depth`; NaN behind the target."""
    return project(source, target, *pixel_centres(source), depth)


def project(source, target, x, y, depth):
    """Target x, y of what is at `depth` at source positions, by plain projection."""
    origin, direction = world_rays(source, x, y)
    sky = np.isinf(depth)
    with np.errstate(divide="ignore", invalid="ignore"):
        place = px_from_world(target, origin + np.where(sky, 1.0, depth)[..., None] * direction)
        if isinstance(source, PerspectiveCamera):
            far = px_from_world(target, target.world_from_camera[:3, 3] + direction)
            place = [np.where(sky, f, p) for f, p in zip(far, place, strict=True)]
    return np.where(place[2] > 0, place[0], np.nan), np.where(place[2] > 0, place[1], np.nan)
