"""The forward warp of any pair: the grid, drawn into the target quad by quad, with a depth test."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..images import bands
from ..images.masks import dilate
from ..views.camera import Camera, goes_round, is_planar, target_px_from_source_px
from .corners import Corners, project_corners
from .grid import CELL_QUADS, Grid, lattice_depth
from .tuning import TUNING

CHUNK_CELLS = 192
"""Cells drawn at a time: some 49 000 quads, whose temporaries stay in a processor's cache."""

ALL = slice(None)

LARGEST_AREA_PIXELS = 1e12
"""Area of a triangle, in square pixels of the target, above which it is a rounding error."""


def draw_quads(
    depth: NDArray, source: Camera, target: Camera, grid: Grid, torn: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Return x, y and nearness, each (H, W), of a `forward.Warp`: the grid drawn into the target quad by quad.

    depth (H, W) is the source's. torn (H + 1, W + 1) are the quads that are not drawn where their cell is subdivided.
    """
    wraps = goes_round(source)
    vertices = lattice_depth(depth, wraps=wraps)
    # Beyond the frame's outer ring there is nothing.
    beyond = ((0, vertices.shape[0] - 1 - torn.shape[0]), (0, vertices.shape[1] - 1 - torn.shape[1]))
    torn = np.pad(torn, beyond, constant_values=True)
    surface = _Surface((target.height, target.width))
    for quads in _fine_quads(vertices, torn, source, target, grid):
        for placed in _all_around(quads, target):
            surface.draw(placed)
    if grid.subdivided.any():
        surface.prefer_what_is_drawn()
    for quads in _coarse_quads(vertices, source, target, grid):
        for placed in _all_around(quads, target):
            surface.draw(placed)
    x, y, nearness = surface.result()
    if wraps:
        x -= np.float32(source.width) * np.floor(x * np.float32(1.0 / source.width))
    return x, y, nearness


def _all_around(quads: _Quads, target: Camera) -> Iterator[_Quads]:
    """Yield quads in all the places in which a target that may look all around shows them, and only in one otherwise.

    In a panorama the corners of a quad may be on either side of where the picture's angles begin anew: they are put
    beside the first one of their cell, and one by one where a cell reaches around half of all angles. A quad that does
    so by itself is behind the camera, or the eye stands within: it is not drawn.
    """
    if is_planar(target):
        yield quads
        return
    half = widest_quad(target)
    placed = _beside_first(quads, target.period_px)
    apart = np.flatnonzero(placed.drawn & (np.ptp(_four(placed.x), axis=0) >= half))
    parts = [placed] if apart.size == 0 else [placed, _beside_first(_one_by_one(quads, apart), target.period_px)]
    for part in parts:
        x = _four(part.x)
        drawn = part.drawn & (np.ptp(x, axis=0) < half)
        yield replace(part, drawn=drawn)
        for shift in (-target.period_px, target.period_px):
            again = drawn & (x.max(axis=0) + shift > 0.0) & (x.min(axis=0) + shift < target.width)
            if again.any():
                yield replace(part, x=part.x + shift, drawn=again)


def widest_quad(target: Camera) -> float:
    """Return the width, in pixels, from which a quad is not drawn in a panorama: that of half of all angles, or of the
    whole picture where no angle is seen twice."""
    return 0.5 * min(target.period_px, 2.0 * target.width)


def _four(corners: NDArray) -> NDArray:
    """Return (4, C, n, n) the four corners of each quad, of values (C, n + 1, n + 1)."""
    return np.array([corners[:, :-1, :-1], corners[:, :-1, 1:], corners[:, 1:, :-1], corners[:, 1:, 1:]])


def _beside_first(quads: _Quads, period: float) -> _Quads:
    """Return quads with all corners of a cell moved by whole periods, in pixels, to within half of one from its first
    corner that is seen."""
    if not np.isfinite(period):
        return quads
    corners = quads.x.reshape(len(quads.x), -1)
    seen = np.isfinite(corners).argmax(axis=1)
    first = np.take_along_axis(corners, seen[:, None], axis=1)[..., None]
    return replace(quads, x=quads.x - period * np.round((quads.x - first) / period))


def _one_by_one(quads: _Quads, chosen: NDArray[np.int64]) -> _Quads:
    """Return the chosen ones (K,) of quads, which are flat indices, each as a cell of its own."""
    corners = quads.x, quads.y, quads.nearness
    x, y, nearness = (_four(values).reshape(4, -1)[:, chosen].T.reshape(-1, 2, 2) for values in corners)
    one = (chosen.size, 1, 1)
    first_x, first_y, wide, high, margin = (
        np.broadcast_to(values, quads.drawn.shape).ravel().take(chosen).reshape(one)
        for values in (quads.source_x, quads.source_y, quads.size_x, quads.size_y, quads.margin)
    )
    return _Quads(x, y, nearness, first_x, first_y, wide, high, np.ones(one, bool), margin)


@dataclass(frozen=True)
class _Quads:
    """The n x n quads of each of C cells of the source's grid, with the places of their corners in the target.

    x, y, nearness (C, n + 1, n + 1): target position and nearness of the corners. source_x, source_y and size_x, size_y
    (C, n, n): position of a quad's first corner and its extent, in source pixels; a size without dimensions is that of
    every quad. drawn (C, n, n): those that are drawn. margin (C, n, n): target pixels by which a quad may cover a
    pixel's centre beyond its own corners. A centre on the side that two quads share belongs to the second; where that
    one is not drawn, the first has it, and where one of them is a coarse cell, both do.
    """

    x: NDArray
    y: NDArray
    nearness: NDArray
    source_x: NDArray
    source_y: NDArray
    size_x: NDArray
    size_y: NDArray
    drawn: NDArray[np.bool_]
    margin: NDArray

    def corners(self, chosen: NDArray[np.int64]) -> Corners:
        """Return target x, target y and nearness (2, 2, K) of the four corners of K quads.

        chosen (K,) are the quads' indices in the flattened (C, n, n). Of the result's first two indices, the first
        counts corners down, the second to the right.
        """
        cells, count, _ = self.drawn.shape
        lattice = np.arange(self.x.size).reshape(cells, count + 1, count + 1)
        first = lattice[:, :-1, :-1].ravel().take(chosen)
        places = first + np.array([[0, 1], [count + 1, count + 2]])[..., None]
        return self.x.ravel().take(places), self.y.ravel().take(places), self.nearness.ravel().take(places)


def _coarse_quads(vertices: NDArray, source: Camera, target: Camera, grid: Grid) -> Iterator[_Quads]:
    """Yield the cells that are not subdivided, some at a time, each as one quad; the last ones end with the frame's
    outer ring.

    vertices (h + 1, w + 1) are the depths at the grid's vertices.
    """
    all_rows, all_columns = np.nonzero(~grid.subdivided)
    for start in range(0, all_rows.size, CHUNK_CELLS):
        top, left = (
            all_rows[start : start + CHUNK_CELLS] * CELL_QUADS,
            all_columns[start : start + CHUNK_CELLS] * CELL_QUADS,
        )
        bottom = np.minimum(top + CELL_QUADS, grid.height + 1)
        right = np.minimum(left + CELL_QUADS, grid.width + 1)
        i = np.stack([top, bottom], axis=-1)[:, :, None]
        j = np.stack([left, right], axis=-1)[:, None, :]
        corners = project_corners(source, target, j - 0.5, i - 0.5, vertices[i, j])
        one = (top.size, 1, 1)
        x, y, wide, high = (a.reshape(one) for a in (left - 0.5, top - 0.5, right - left, bottom - top))
        yield _Quads(*corners, x, y, wide, high, np.ones(one, bool), np.full(one, TUNING.edge_tolerance))


def _fine_quads(
    vertices: NDArray, torn: NDArray[np.bool_], source: Camera, target: Camera, grid: Grid
) -> Iterator[_Quads]:
    """Yield the quads of the subdivided cells, some cells at a time; those that are torn (h, w) are not drawn.

    vertices (h + 1, w + 1) are the depths at the grid's vertices.
    """
    all_rows, all_columns = np.nonzero(grid.subdivided)
    span = np.arange(CELL_QUADS + 1)
    left_out = _left_out(vertices, torn, source, target)
    left_out |= (~grid.subdivided).repeat(CELL_QUADS, axis=0).repeat(CELL_QUADS, axis=1)
    beside = dilate(left_out, 1)
    one = np.array(1, np.int64)
    for start in range(0, all_rows.size, CHUNK_CELLS):
        i = all_rows[start : start + CHUNK_CELLS, None, None] * CELL_QUADS + span[None, :, None]
        j = all_columns[start : start + CHUNK_CELLS, None, None] * CELL_QUADS + span[None, None, :]
        corners = project_corners(source, target, j - 0.5, i - 0.5, vertices[i, j])
        first_i, first_j = np.broadcast_arrays(i[:, :-1], j[:, :, :-1])
        margin = np.where(beside[first_i, first_j], TUNING.edge_tolerance, 0.0)
        yield _Quads(*corners, first_j - 0.5, first_i - 0.5, one, one, ~torn[first_i, first_j], margin)


def _left_out(vertices: NDArray, torn: NDArray[np.bool_], source: Camera, target: Camera) -> NDArray[np.bool_]:
    """Return (h, w) the quads that cannot be drawn: those that are torn (h, w), or have a corner behind the target's
    camera.

    vertices (h + 1, w + 1) are the depths at the grid's vertices.
    """
    i, j = np.arange(vertices.shape[0])[:, None] - 0.5, np.arange(vertices.shape[1]) - 0.5
    # How far ahead something is, is linear: if the corners of all that there may be are ahead, so is everything.
    depths = np.array([np.fmin.reduce(vertices, axis=None), np.fmax.reduce(vertices, axis=None)])[:, None, None]
    linear = is_planar(source) and is_planar(target)
    if linear and not np.isnan(target_px_from_source_px(source, target, j[[0, -1]], i[[0, -1]], depths)[0]).any():
        return torn.copy()
    behind = np.empty(vertices.shape, bool)
    for rows in bands.bands(vertices.shape):
        behind[rows] = np.isnan(target_px_from_source_px(source, target, j, i[rows], vertices[rows])[0])
    return torn | behind[:-1, :-1] | behind[:-1, 1:] | behind[1:, :-1] | behind[1:, 1:]


_Boxes = tuple[NDArray, NDArray, NDArray, NDArray, NDArray, NDArray]
"""The quads that cover any pixel centre (K,): their indices, the first column and row of those centres, the numbers of
columns and rows, and the number of rows that were drawn before."""


class _Surface:
    """The picture that quads are drawn into: for each target pixel, the nearness and the source position of its nearest
    point.

    After all draw calls `result` has it. shape is (H, W).
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self.height, self.width = shape
        pixels = self.height * self.width
        self.nearness = np.full(pixels, -np.inf, np.float32)
        self.x = np.full(pixels, np.nan, np.float32)
        self.y = np.full(pixels, np.nan, np.float32)
        self.preferred: NDArray[np.float32] | None = None

    def prefer_what_is_drawn(self) -> None:
        """Have what is drawn so far win over what is drawn later and is nearer by less than same_nearness_share.

        So fine quads win over coarse ones of the same surface, whose nearness differs by rounding.
        """
        self.preferred = self.nearness.copy()

    def result(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """Return source x, source y and nearness, each (H, W), of all that was drawn; to be called once, at the end.

        Pixels on which nothing was drawn are holes: NaN, NaN and -inf. So are those whose nearest quad hides but shows
        nothing.
        """
        shape = (self.height, self.width)
        # What was drawn without a place hides what is behind it, and is a hole.
        self.nearness[np.isnan(self.x)] = -np.inf
        self.y[np.isnan(self.x)] = np.nan
        return self.x.reshape(shape), self.y.reshape(shape), self.nearness.reshape(shape)

    def draw(self, quads: _Quads) -> None:
        """Draw quads, each as two triangles, cut along the diagonal from top right to bottom left; what is nearer
        wins."""
        for boxes in _boxes(quads, self.width, self.height):
            self._fill(quads, boxes)

    def _fill(self, quads: _Quads, boxes: _Boxes) -> None:
        """Draw the quads in these boxes, all of them step by step at once.

        The steps stand in one function because each hands its arrays to the next: split up, they would be passed around
        by the dozen.
        """
        chosen, left, top, count_x, count_y, drawn = boxes
        size_x, size_y = _of(quads.size_x, chosen), _of(quads.size_y, chosen)
        upper, lower = _triangles(quads.corners(chosen), left + 0.5, top + 0.5, size_x * size_y)
        quad, step_x, step_y = _candidates(count_x, count_y, drawn)

        def at(coefficients: NDArray, candidates: NDArray | slice = ALL) -> NDArray:
            whose, right, down = quad[candidates], step_x[candidates], step_y[candidates]
            base, along_x, along_y = coefficients
            return base.take(whose) + along_x.take(whose) * right + along_y.take(whose) * down

        u, v, nearness = at(upper.u), at(upper.v), at(upper.nearness)
        in_lower = np.flatnonzero(~(u + v <= 1.0))
        least, hides = np.minimum(u, v), upper.hides.take(quad)
        turned_u, turned_v = at(lower.u, in_lower), at(lower.v, in_lower)
        u[in_lower], v[in_lower] = 1.0 - turned_u, 1.0 - turned_v
        least[in_lower] = np.minimum(np.minimum(turned_u, turned_v), 1.0 - turned_u - turned_v)
        nearness[in_lower] = at(lower.nearness, in_lower)
        hides[in_lower] = lower.hides.take(quad[in_lower])
        pixel = (top.take(quad) + step_y) * self.width + left.take(quad) + step_x
        x = _of(quads.source_x, chosen).take(quad) + u * _of(size_x, quad)
        x[hides] = np.nan
        y = _of(quads.source_y, chosen).take(quad) + v * _of(size_y, quad)
        inside = np.flatnonzero(least >= -TUNING.edge_tolerance)
        self._store(pixel.take(inside).astype(np.int64), *(values.take(inside) for values in (nearness, x, y)))

    def _store(self, pixel: NDArray, nearness: NDArray, x: NDArray, y: NDArray) -> None:
        """Store candidates in their pixels, where they are nearer than what is there: nearness and source x, y (K,) at
        pixel (K,).

        Several may fall on one pixel. In each of a few rounds all are written, and those that are still nearer than
        what then stands write again. Each round is a plain scatter, which NumPy does faster than `minimum.at` or a
        sort.
        """
        nearness = nearness.astype(np.float32, copy=False)
        nearer = nearness > self.nearness.take(pixel)
        if self.preferred is not None:
            nearer &= nearness - np.float32(TUNING.same_nearness_share) * np.abs(nearness) > self.preferred.take(pixel)
        waiting = np.flatnonzero(nearer)
        while waiting.size:
            pixel, nearness, x, y = (values.take(waiting) for values in (pixel, nearness, x, y))
            self.nearness[pixel] = nearness
            stands = self.nearness.take(pixel)
            # What is written last stays: of those that are as near, the one that was drawn first.
            won = np.flatnonzero(stands == nearness)[::-1]
            place = pixel.take(won)
            self.x[place] = x.take(won)
            self.y[place] = y.take(won)
            waiting = np.flatnonzero(nearness > stands)


def _of(values: NDArray, chosen: NDArray[np.int64]) -> NDArray:
    """Return (K,) the values (C, n, n) of a field of `_Quads` for the chosen quads (K,), which are flat indices.

    A value without dimensions, which is that of every quad, is returned as it is.
    """
    return values.ravel().take(chosen) if values.ndim else values


def _centres_within(corners: NDArray, size: int, margin: NDArray) -> tuple[NDArray, NDArray]:
    """Return (C, n, n) the first pixel along one axis whose centre a quad may cover, and the number of such pixels.

    corners (C, n + 1, n + 1): places of the quads' corners along that axis, in pixels from 0 to size. margin (C, n, n):
    pixels by which the range between a quad's corners is widened. The range is half-open; a quad with a NaN has no
    pixel.
    """
    low = np.minimum(corners[:, :-1], corners[:, 1:])
    high = np.maximum(corners[:, :-1], corners[:, 1:])
    low = np.minimum(low[:, :, :-1], low[:, :, 1:]) - margin
    high = np.maximum(high[:, :, :-1], high[:, :, 1:]) + margin
    valid = high - low < np.inf
    with np.errstate(invalid="ignore"):
        first = np.clip(np.ceil(np.where(valid, low, 0.0) - 0.5), 0, size).astype(np.int64)
        end = np.clip(np.ceil(np.where(valid, high, 0.0) - 0.5), 0, size).astype(np.int64)
    return first, end - first


def _boxes(quads: _Quads, width: int, height: int) -> Iterator[_Boxes]:
    """Yield the boxes of pixels that drawn quads may cover, in the quads' order, about `bands.BAND_PIXELS` pixels at a
    time.

    A quad that is larger by itself comes some rows at a time: near the plane in which the target's camera stands, a
    quad may cover the whole picture. All of its parts count from its own first row, and so agree to the bit.
    """
    left, count_x = _centres_within(quads.x, width, quads.margin)
    top, count_y = _centres_within(quads.y, height, quads.margin)
    quad = np.flatnonzero((count_x > 0) & (count_y > 0) & quads.drawn)
    left, top, count_x, count_y = (values.ravel().take(quad) for values in (left, top, count_x, count_y))
    pixels, drawn = count_x * count_y, np.zeros_like(top)
    if pixels.max(initial=0) > bands.BAND_PIXELS:
        rows = np.maximum(bands.BAND_PIXELS // count_x, 1)
        parts = -(-count_y // rows)
        part = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
        quad, left, top, count_x, count_y, rows = (
            np.repeat(values, parts) for values in (quad, left, top, count_x, count_y, rows)
        )
        drawn = part * rows
        count_y = np.minimum(count_y - drawn, rows)
        pixels = count_x * count_y
    starts = np.flatnonzero(np.diff((np.cumsum(pixels) - pixels) // bands.BAND_PIXELS, prepend=-1))
    for start, stop in itertools.pairwise([*starts.tolist(), quad.size]):
        part = slice(start, stop)
        yield quad[part], left[part], top[part], count_x[part], count_y[part], drawn[part]


def _candidates(count_x: NDArray, count_y: NDArray, drawn: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Return all pairs of a quad and a pixel in its box: the quad's index, and the pixel's offsets right and down in
    the box.

    count_x, count_y (K,) are the boxes' columns and rows. drawn (K,) is the number of a quad's rows that earlier boxes
    had: offsets down count from the quad's own first row.
    """
    count = count_x * count_y
    quad = np.repeat(np.arange(count.size), count)
    rank = np.arange(quad.size) - np.repeat(np.cumsum(count) - count, count)
    wide = count_x.take(quad)
    step_y = rank // wide
    step_x = (rank - step_y * wide).astype(np.float64)
    if drawn.any():
        step_y += drawn.take(quad)
    return quad, step_x, step_y.astype(np.float64)


@dataclass(frozen=True)
class _Triangle:
    """One triangle of each of Q quads, as linear functions of the place in the target.

    u, v are barycentric coordinates, 0 to 1 along two of its sides. Each function is (3, Q): its value at the first
    pixel centre of the quad's box, and its change per pixel to the right and per pixel down.
    """

    u: NDArray
    v: NDArray
    nearness: NDArray
    hides: NDArray[np.bool_]
    """(Q,) triangles that are turned away or overstretched: they show nothing, but hide what is behind them."""


def _triangles(corners: Corners, x: NDArray, y: NDArray, area: NDArray) -> tuple[_Triangle, _Triangle]:
    """Return the upper left and the lower right halves of quads with these corners (2, 2, K).

    x, y (K,): the first pixel centre of each quad's box. area (K,): the quad's area in the source, in pixels.
    """
    return (
        _triangle(corners, ((0, 0), (0, 1), (1, 0)), (x, y), area),
        _triangle(corners, ((1, 1), (1, 0), (0, 1)), (x, y), area),
    )


def _triangle(
    corners: Corners, chosen: tuple[tuple[int, int], ...], centre: tuple[NDArray, NDArray], area: NDArray
) -> _Triangle:
    """Return one triangle of each quad; its functions are NaN where it has no area.

    corners (2, 2, K) are the quads'. chosen are the indices of the triangle's three: the one at its right angle, and
    those at the ends of the sides u and v. centre: x and y (K,) of the first pixel centre. area (K,): the quad's area
    in the source, in pixels.
    """
    corner_x, corner_y, corner_n = corners
    origin, along_u, along_v = chosen
    x, y = centre
    ux, uy = corner_x[along_u] - corner_x[origin], corner_y[along_u] - corner_y[origin]
    vx, vy = corner_x[along_v] - corner_x[origin], corner_y[along_v] - corner_y[origin]
    determinant = ux * vy - uy * vx
    known = (np.abs(determinant) > 1e-9) & (np.abs(determinant) < LARGEST_AREA_PIXELS)
    hides = (determinant < 0.0) | (determinant >= TUNING.max_stretch * area)
    inverse = np.where(known, 1.0 / np.where(known, determinant, 1.0), np.nan)
    dx, dy = x - corner_x[origin], y - corner_y[origin]
    u = np.array([(dx * vy - dy * vx) * inverse, vy * inverse, -vx * inverse])
    v = np.array([(ux * dy - uy * dx) * inverse, -uy * inverse, ux * inverse])
    near = corner_n[origin]
    slope_u, slope_v = corner_n[along_u] - near, corner_n[along_v] - near
    nearness = u * slope_u + v * slope_v
    nearness[0] += near
    return _Triangle(u.astype(np.float32), v.astype(np.float32), nearness, hides)
