"""A warp, held against what it should have found: what is flagged, what no source can know, and what is wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereo_reproject.views.camera import OrthographicCamera, PerspectiveCamera
from stereo_reproject.warp.tuning import TUNING as WARP_TUNING
from tests.warp.analytic import pixel_centres
from tests.warp.bounds import ROUNDINGS, bent, beside, coarse_misses, limits, shift_terms, spread
from tests.warp.exact import STRICT, passes_of, project, reprojected, traced, where_they_go

HIDDEN = 0.1
"""Share of a picture, at most, in which something stands that the source does not see, and lands before what it does:
a card that only one frame reaches, twice."""

BETWEEN = 0.3
"""Pixels, at most, that lie between the source's pixel centres, along edges: so many of a row and a column."""


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
    landed_x, landed_y = project(source, target, at_x, at_y, there)
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
    landed = np.array(project(source, target, x, y, mixed))
    off = np.hypot(*(landed - np.array([column + 0.5, row + 0.5])))
    straight = np.zeros(landed.shape)
    for share, (i, j), z in zip(shares, corners, at, strict=True):
        straight += np.where(share > 0.0, share * np.array(project(source, target, j + 0.5, i + 0.5, z)), 0.0)
    perspective = np.hypot(*(straight - landed))
    goes_to = where_they_go(source, target, depth)
    coarse = _at(coarse_misses(depth, *goes_to, source, target, result.grid, threshold), x, y)
    if not np.array_equal(source.world_from_camera[:3, :3], target.world_from_camera[:3, :3]):
        # A quad may have a centre so far beyond its side, where the next one goes on otherwise; no further than a tear.
        bend = sum(8.0 * bent(p, np.zeros(depth.shape, int)) for p in goes_to)
        coarse += WARP_TUNING.edge_tolerance * np.minimum(_at(bend, x, y), WARP_TUNING.tear_pixels)
    size = 2 * max(width, height) + np.abs(x) + np.abs(y)
    rounding = ROUNDINGS * np.finfo(np.float32).eps * (size + shift_terms(mixed, source, target))
    return off, rounding + coarse + perspective, perspective


def _sliver(exact, index):
    """(H, W): target pixels of a surface that the source sees too slanted to be drawn, at the last pixel of it.

    How it goes on from there to its edge the source's depths do not tell.
    """
    slanted = np.zeros(exact.x.shape, bool)
    # Turned away as well: then a step to the right is one to the left.
    slow = np.diff(exact.x, axis=1) < 1.0 / WARP_TUNING.max_stretch
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
        edge |= beside(np.diff(index, axis=axis) != 0, axis, np.logical_or, False)
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
