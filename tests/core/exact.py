"""What a warp should have found, traced: for each target pixel the place in the source that shows the same point.

And how far off it may be. The rigs here take what Blender's cameras take (lens, sensor, shift, pixel aspect), to the
extremes; the surfaces and the ray caster are `analytic`'s, which share no formula with the engine.
"""

from __future__ import annotations

import contextlib
import warnings
from dataclasses import dataclass, field

import numpy as np
from hypothesis import settings
from scipy.ndimage import maximum_filter

from stereo_reproject.accuracy import Accuracy
from stereo_reproject.camera import (
    Camera,
    OrthographicCamera,
    PerspectiveCamera,
    ViewPlane,
    disparity_per_nearness,
)
from stereo_reproject.composite import contain
from stereo_reproject.grid import CELL, ORTHOGRAPHIC_VIEW_ANGLE, PERSPECTIVE
from stereo_reproject.holes import TEAR
from stereo_reproject.parallax import ARC_MINUTE
from stereo_reproject.rectified import EDGE_TOLERANCE, MAX_STRETCH
from stereo_reproject.reprojection import reproject

from .analytic import pixel_centres, pose, px_from_world, world_rays

SENSOR = 36.0
"""Millimetres, as Blender's cameras have by default."""

STRICT = Accuracy(silhouette_step=0.1, silhouette_radius=2, colour_tolerance=0.0)
"""Every edge is flagged, whether its sides look alike or not: what is not flagged must be right by its place."""

ROUNDINGS = 4.0
"""Roundings to float32 on the way to a position, each by half a unit in the last place of the largest number in it:
depth, nearness, how far it moves, where that is."""

THIRD_DIFFERENCES = 1.5
"""How much more than in the middle of a cell its perspective may be off elsewhere: a lens of 8 mm on 200 pixels changes
by a quarter over one."""

HIDDEN = 0.1
"""Share of a picture, at most, in which something stands that the source does not see, and lands before what it does:
a card that only one frame reaches, twice."""

BETWEEN = 0.3
"""Pixels, at most, that lie between the source's pixel centres, along edges: so many of a row and a column."""

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
            passes, invalid = contain(passes)
        result = reproject(passes, source, target, accuracy=accuracy, invalid=invalid, **options)
        assert result.reasons.shape == (target.height, target.width)
    return result


# How far off a pixel may be


def px_per_slope(eye) -> float:
    """Pixels across per unit of x / depth, or of x for an orthographic camera."""
    return eye.width / (eye.plane.right - eye.plane.left)


def per_nearness_allowed(threshold, source, target, near, far):
    """How far the nearness in a coarse cell whose depths are in near..far may reach; see docs/numerics.md.

    threshold in arc minutes; for perspective cameras.
    """
    ipd = np.linalg.norm(source.world_from_camera[:3, 3] - target.world_from_camera[:3, 3])
    with np.errstate(over="ignore", divide="ignore"):
        saturated = 1.0 + (0.5 * ipd / near) * (0.5 * ipd / far)
        return 2.0 * np.tan(0.5 * threshold * ARC_MINUTE) / ipd * saturated


def most_in_a_cell(threshold, source, target, near, far, *, most):
    """Pixels by which a coarse cell of a rectified pair, with depths in near..far, may be off; see docs/numerics.md."""
    ipd = np.linalg.norm(source.world_from_camera[:3, 3] - target.world_from_camera[:3, 3])
    return min(px_per_slope(target) * ipd * per_nearness_allowed(threshold, source, target, near, far), most)


def misses(depth, result, source, target, *, threshold=1.0):
    """Of the pixels that are not flagged (N,): how far beside their centres lands what they show, and how far it may.

    What they show is at warp.x, warp.y, between the depths (H, W) of the pixels around. Beside rounding and what a
    coarse cell misses that may be as much as the perspective within one pixel is, which is the third.
    """
    row, column = np.nonzero((result.reasons == 0) & result.warp.covered)
    x, y = (place[row, column].astype(np.float64) for place in (result.warp.x, result.warp.y))
    # All of a parallel projection's sky is as far away.
    most = np.inf if isinstance(source, PerspectiveCamera) else OrthographicCamera.SKY_DEPTH
    depth = np.minimum(depth.astype(np.float32).astype(np.float64), most)
    height, width = depth.shape
    left, top = (np.floor(p - 0.5).astype(int) for p in (x, y))
    across, down = x - 0.5 - left, y - 0.5 - top
    corners = [(top, left), (top, left + 1), (top + 1, left), (top + 1, left + 1)]
    # Two triangles, cut from top right to bottom left; on a rectified pair y lies on a row.
    upper = across + down <= 1.0
    shares = [
        np.where(upper, 1.0 - across - down, 0.0),
        np.where(upper, across, 1.0 - down),
        np.where(upper, down, 1.0 - across),
        np.where(upper, 0.0, across + down - 1.0),
    ]
    # In the frame's outermost half pixels depth stays as it is; what has no share may be no number.
    at = [depth[np.clip(i, 0, height - 1), np.clip(j, 0, width - 1)] for i, j in corners]
    flat = isinstance(source, OrthographicCamera)
    with np.errstate(divide="ignore"):
        linear = at if flat else [1.0 / z for z in at]
        mixed = sum(np.where(s > 0.0, s * n, 0.0) for s, n in zip(shares, linear, strict=True))
        mixed = mixed if flat else 1.0 / mixed
    landed = np.array(_where(source, target, x, y, mixed))
    off = np.hypot(*(landed - np.array([column + 0.5, row + 0.5])))
    straight = np.zeros(landed.shape)
    for share, (i, j), z in zip(shares, corners, at, strict=True):
        straight += np.where(share > 0.0, share * np.array(_where(source, target, j + 0.5, i + 0.5, z)), 0.0)
    perspective = np.hypot(*(straight - landed))
    goes_to = where_they_go(source, target, depth)
    coarse = _at(_coarse(depth, *goes_to, source, target, result.grid, threshold), x, y)
    if not np.array_equal(source.world_from_camera[:3, :3], target.world_from_camera[:3, :3]):
        # A quad may have a centre so far beyond its side, where the next one goes on otherwise; no further than a tear.
        bend = sum(8.0 * bent(p, np.zeros(depth.shape, int)) for p in goes_to)
        coarse += EDGE_TOLERANCE * np.minimum(_at(bend, x, y), TEAR)
    size = 2 * max(width, height) + np.abs(x) + np.abs(y)
    rounding = ROUNDINGS * np.finfo(np.float32).eps * (size + _shift_terms(mixed, source, target))
    return off, rounding + coarse + perspective, perspective


def where_they_go(source, target, depth):
    """Target x, y (H, W) of the source's pixel centres at `depth`; NaN behind the target."""
    return _where(source, target, *pixel_centres(source), depth)


def spread(image, reach):
    """(H, W): the largest within `reach` pixels; NaN is none."""
    return maximum_filter(np.nan_to_num(image), size=2 * reach + 1, mode="nearest")


def bent(moved, index):
    """(H, W) pixels: how far two neighbouring pixels and a straight line between them miss a surface that bends.

    moved (H, W) target positions. An eighth of the second difference along the longest line in a quad, its diagonal:
    d² = xx + 2 xy + yy; the largest around each pixel.
    """
    total = np.zeros(moved.shape)
    for axis in (0, 1):
        if moved.shape[axis] < 3:
            continue
        along, which = np.moveaxis(moved, axis, 0), np.moveaxis(index, axis, 0)
        one = (which[2:] == which[1:-1]) & (which[:-2] == which[1:-1])
        second = np.zeros(along.shape)
        second[1:-1] = np.where(one, np.abs(along[2:] - 2.0 * along[1:-1] + along[:-2]), 0.0)
        # The frame's own is not known; towards an edge it grows.
        second[0], second[-1] = 2.0 * second[1], 2.0 * second[-2]
        total += np.moveaxis(second, 0, axis)
    if min(moved.shape) > 1:
        one = (
            (np.diff(index, axis=0) == 0)[:, 1:]
            & (np.diff(index, axis=1) == 0)[1:]
            & (np.diff(index, axis=0) == 0)[:, :-1]
        )
        total[:-1, :-1] += 2.0 * np.where(one, np.abs(np.diff(np.diff(moved, axis=0), axis=1)), 0.0)
    return 0.125 * spread(total, 2)


@dataclass(frozen=True)
class Limits:
    """(H, W) of the source: by how many pixels of the target what is seen there may land beside its place, by cause.

    native: between its pixels a surface is straight to the warp; within half a pixel of the frame, level. steps: a step
    in disparity that is no edge yet. coarse: what the grid's threshold lets a coarse cell miss, with the perspective
    within one where the image planes do not coincide. stretch: target pixels per source pixel, the least around.
    """

    native: np.ndarray
    steps: np.ndarray
    coarse: np.ndarray
    rounding: np.ndarray
    stretch: np.ndarray

    @property
    def total(self):
        return self.native + self.steps + self.coarse + self.rounding


def limits(depth, index, source, target, grid, *, threshold, step) -> Limits:
    """What docs/numerics.md promises of the warp of a depth map (H, W) that shows the surfaces `index` (H, W)."""
    x, y = where_they_go(source, target, depth)
    native = bent(x, index) + bent(y, index)
    slope = np.zeros(depth.shape)
    stretch = np.ones(depth.shape)
    edge = np.zeros(depth.shape, bool)
    for axis, along in enumerate((y, x)):
        one = np.diff(index, axis=axis) == 0
        # Where a pixel's point would be at its neighbour's depth.
        next_x, next_y = where_they_go(source, target, np.roll(depth, -1, axis=axis))
        change = np.hypot(next_x - x, next_y - y)
        between = np.delete(np.nan_to_num(change), -1, axis=axis)
        slope += _beside(np.where(one, between, 0.0), axis, np.maximum, 0.0)
        run = np.nan_to_num(np.diff(along, axis=axis), nan=1.0)
        stretch = np.minimum(stretch, _beside(np.where(one, run, 1.0), axis, np.minimum, 1.0))
        edge |= _beside(~one, axis, np.logical_or, False)
    ring = np.ones(depth.shape, bool)
    ring[1:-1, 1:-1] = False
    # Half a pixel of the slope, and of what that grows by: eight times an eighth of the second difference.
    native = native + np.where(ring, 0.5 * (slope + 8.0 * native), 0.0)
    steps = np.where(spread(edge.astype(float), 2) > 0, step, 0.0)
    coarse = _coarse(depth, x, y, source, target, grid, threshold)
    size = max(source.width, target.width, source.height, target.height)
    reach = np.nan_to_num(np.abs(x)) + np.nan_to_num(np.abs(y)) + size
    shift = _shift_terms(depth, source, target)
    rounding = ROUNDINGS * np.finfo(np.float32).eps * (reach + shift)
    return Limits(native, steps, coarse, rounding, -spread(-stretch, 2))


def _beside(between, axis, extreme, none):
    """(H, W): of what is between neighbours along an axis, the extreme of a pixel's two."""
    pads = [(0, 0), (0, 0)]
    pads[axis] = (1, 1)
    padded = np.moveaxis(np.pad(between, pads, constant_values=none), axis, 0)
    return np.moveaxis(extreme(padded[1:], padded[:-1]), 0, axis)


def _shift_terms(depth, source, target):
    """(H, W) pixels: what a shift is the difference of, which float32 holds each of: by nearness, and of the frame."""
    scale = px_per_slope(target)
    baseline = np.linalg.norm(source.world_from_camera[:3, 3] - target.world_from_camera[:3, 3])
    frame = scale * abs(source.plane.left - target.plane.left)
    if isinstance(source, OrthographicCamera):
        return frame + scale * baseline
    with np.errstate(divide="ignore"):
        return frame + scale * baseline / depth


def _coarse(depth, x, y, source, target, grid, threshold):
    """(H, W) pixels: what may be missed in a coarse cell, 0 in the others."""
    height, width = depth.shape
    rows, columns = ((np.arange(size) + 1) // CELL for size in (height, width))
    # A position half a pixel beside a centre may be the next cell's.
    coarse = ~grid.subdivided[np.ix_(rows, columns)]
    coarse = spread(coarse.astype(float), 1) > 0
    if not coarse.any():
        return np.zeros(depth.shape)
    known = depth[coarse]
    flat = np.full(depth.shape, np.inf if isinstance(source, PerspectiveCamera) else 1.0)
    sky = bent_within_cell(*where_they_go(source, target, flat))
    sky = np.minimum(sky, THIRD_DIFFERENCES * PERSPECTIVE * TEAR)
    if isinstance(source, OrthographicCamera):
        minute = threshold * ARC_MINUTE / ORTHOGRAPHIC_VIEW_ANGLE * source.width
        return np.where(coarse, min(minute, TEAR) + sky, 0.0)
    step = 1e-4
    moved_x, moved_y = where_they_go(source, target, depth * (1.0 + step))
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.hypot(moved_x - x, moved_y - y) / (1.0 / depth - 1.0 / (depth * (1.0 + step)))
    per_nearness = max(np.nanmax(np.nan_to_num(change[coarse])), disparity_per_nearness(source, target))
    nearest = np.nanmin(known)
    reach = per_nearness_allowed(threshold, source, target, nearest, nearest)
    reach = min(reach, TEAR / disparity_per_nearness(source, target)) if per_nearness > 0.0 else 0.0
    return np.where(coarse, per_nearness * reach + sky, 0.0)


def bent_within_cell(x, y):
    """(H, W) pixels by which the perspective of a coarse cell misses: that of a pixel, over CELL of them."""
    one = np.zeros(x.shape, int)
    return CELL**2 * spread(bent(x, one) + bent(y, one), CELL)


@dataclass(frozen=True)
class Judged:
    """Of the target's pixels (H, W): which are flagged, which show what the source cannot know of, which are wrong.

    hidden: something stands before what the warp shows, and the source does not see it; what is shown must land there
    for all that. between: what lies between the source's pixel centres. off: pixels in the target between a centre and
    where what is shown there really is; beside: in the source, from where the right point is. seen: what
    both eyes see, but for the sky of parallel rays, which has no place.
    """

    flagged: np.ndarray
    hidden: np.ndarray
    between: np.ndarray
    off: np.ndarray
    beside: np.ndarray
    limit: np.ndarray
    beside_limit: np.ndarray
    seen: np.ndarray

    @property
    def unknown(self):
        return self.hidden | self.between

    @property
    def told(self):
        """Not flagged, and known to the source: these are right, or wrong."""
        return ~self.flagged & ~self.unknown

    @property
    def excused(self):
        """The share of pixels that are neither flagged nor right, and (hidden, between) why that is no fault."""
        return np.mean(~self.flagged & self.hidden), np.mean(~self.flagged & self.between & ~self.hidden)

    @property
    def vague(self):
        """Whether so much is excused that the rest proves little."""
        hidden, between = self.excused
        return hidden > HIDDEN or between * self.flagged.size > BETWEEN * sum(self.flagged.shape)

    @property
    def wrong(self):
        """Neither flagged nor right."""
        lands, found = self.off <= self.limit, self.beside <= self.beside_limit
        return ~self.flagged & ~self.between & ~(lands & (found | self.hidden))

    @property
    def worst(self):
        """What to say of them."""
        wrong = self.wrong
        row, column = np.argwhere(wrong)[0] if wrong.any() else (0, 0)
        numbers = (self.off, self.limit, self.beside, self.beside_limit)
        off, limit, beside, beside_limit = (float(a[row, column]) for a in numbers)
        return f"{wrong.sum()} pixels, ({row}, {column}): {off:.3g} > {limit:.3g}, {beside:.3g} > {beside_limit:.3g}"


def judged(world, source, target, *, accuracy=STRICT, threshold=1.0, **options) -> Judged:
    """What becomes of a world that is warped, held against tracing it."""
    depth, index = world.hit(source, *pixel_centres(source))
    depth = depth.astype(np.float32).astype(np.float64)
    result = reprojected(passes_of(depth), source, target, accuracy=accuracy, grid_threshold=threshold, **options)
    exact, warp = traced(world, source, target), result.warp
    bound = limits(depth, index, source, target, result.grid, threshold=threshold, step=accuracy.silhouette_step)
    covered = warp.covered
    at_x, at_y = (np.where(covered, p, 0.5).astype(np.float64) for p in (warp.x, warp.y))
    i = np.clip(at_y.astype(int), 0, source.height - 1)
    j = np.clip(at_x.astype(int), 0, source.width - 1)
    there, surface = world.hit(source, at_x, at_y)
    landed_x, landed_y = _where(source, target, at_x, at_y, there)
    centre_x, centre_y = pixel_centres(target)
    off = np.where(covered, np.hypot(landed_x - centre_x, landed_y - centre_y), np.inf)
    beside = np.where(covered, np.hypot(at_x - exact.x, at_y - exact.y), np.inf)
    limit = bound.total[i, j]
    beside_limit = 2.0 * limit / np.clip(bound.stretch[i, j], 1e-3, 1.0)
    nearness = np.where(covered, warp.nearness, -np.inf)
    hidden = ~exact.seen & (target.nearness_from_depth(exact.depth) > nearness)
    between = _in_the_rim(source, at_x, at_y) & (surface != index[i, j])
    between |= _in_the_rim(source, exact.x, exact.y) & _at(_beside_another(index), exact.x, exact.y)
    between |= _sliver(exact, index) | _between_centres(exact.x, exact.y, exact.index, index)
    between |= _between_centres(at_x, at_y, surface, index)
    between |= _at(_small(index), exact.x, exact.y)
    seen = exact.seen & ~(np.isinf(exact.depth) & isinstance(source, OrthographicCamera))
    return Judged(result.reasons != 0, hidden, between, off, beside, limit, beside_limit, seen)


def _sliver(exact, index):
    """(H, W): target pixels of a surface that the source sees too slanted to be drawn, at the last pixel of it.

    How it goes on from there to its edge the source's depths do not tell.
    """
    slanted = np.zeros(exact.x.shape, bool)
    # Turned away as well: then a step to the right is one to the left.
    slow = np.diff(exact.x, axis=1) < 1.0 / MAX_STRETCH
    one = np.diff(exact.index, axis=1) == 0
    slanted[:, 1:] |= slow & one
    slanted[:, :-1] |= slow & one
    # A run of a single pixel has no slope at all.
    alone = np.pad(~one, ((0, 0), (1, 1)), constant_values=True)
    slanted |= alone[:, 1:] & alone[:, :-1]
    return slanted & _at(_beside_another(index), exact.x, exact.y)


def _between_centres(x, y, surface, index):
    """(H, W): whether none of the source's pixel centres around a position has met the surface that it shows."""
    met = np.zeros(x.shape, bool)
    for right in (-0.5, 0.5):
        for down in (-0.5, 0.5):
            met |= _at(index, x + right, y + down) == surface
    return ~met


def _small(index):
    """(H, W): pixels of what is nowhere around three pixels wide and high."""
    height, width = index.shape
    if min(height, width) < 3:
        return np.zeros(index.shape, bool)
    blocks = np.lib.stride_tricks.sliding_window_view(index, (3, 3))
    whole = np.pad((blocks == blocks[:, :, 1:2, 1:2]).all(axis=(2, 3)), 1)
    return spread(whole.astype(float), 2) == 0.0


def _beside_another(index):
    """(H, W): pixels within two of which another surface begins."""
    edge = np.zeros(index.shape, bool)
    for axis in (0, 1):
        edge |= _beside(np.diff(index, axis=axis) != 0, axis, np.logical_or, False)
    return spread(edge.astype(float), 1) > 0


def _at(image, x, y):
    """The pixels of (H, W) that positions lie in, or are nearest to."""
    height, width = image.shape
    return image[tuple(np.clip(np.nan_to_num(p), 0, n - 1).astype(int) for p, n in ((y, height), (x, width)))]


def _in_the_rim(eye, x, y):
    """Whether positions lie in the frame's outermost half pixels, beyond all of its centres."""
    across, down = 0.5 * eye.width, 0.5 * eye.height
    with np.errstate(invalid="ignore"):
        return (np.abs(x - across) > across - 0.5) | (np.abs(y - down) > down - 0.5)


def _where(source, target, x, y, depth):
    """Target x, y of what is at `depth` at source positions, by plain projection."""
    origin, direction = world_rays(source, x, y)
    sky = np.isinf(depth)
    with np.errstate(divide="ignore", invalid="ignore"):
        place = px_from_world(target, origin + np.where(sky, 1.0, depth)[..., None] * direction)
        if isinstance(source, PerspectiveCamera):
            far = px_from_world(target, target.world_from_camera[:3, 3] + direction)
            place = [np.where(sky, f, p) for f, p in zip(far, place, strict=True)]
    return np.where(place[2] > 0, place[0], np.nan), np.where(place[2] > 0, place[1], np.nan)
