"""The forward warp of any pair: the grid, drawn into the target quad by quad, with a depth test."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .camera import Camera, target_px_from_source_px
from .grid import CELL, Grid, lattice_depth
from .masks import dilate
from .rectified import EDGE_TOLERANCE, MAX_STRETCH

CHUNK = 192
"""Cells drawn at a time: some 25 000 pixels, whose temporaries stay in a processor's cache."""

LARGEST_AREA = 1e12
"""Square pixels: what is larger is so by rounding."""


def draw_quads(
    depth: NDArray, source: Camera, target: Camera, grid: Grid, torn: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """x, y and nearness of a `warp.Warp`; torn (H + 1, W + 1) are quads that, in a subdivided cell, are not drawn."""
    vertices = lattice_depth(depth)
    # Beyond the frame's outer ring there is nothing.
    beyond = ((0, vertices.shape[0] - 1 - torn.shape[0]), (0, vertices.shape[1] - 1 - torn.shape[1]))
    torn = np.pad(torn, beyond, constant_values=True)
    surface = _Surface((target.height, target.width))
    for quads in _coarse_quads(vertices, source, target, grid):
        surface.draw(quads)
    for quads in _fine_quads(vertices, torn, source, target, grid):
        surface.draw(quads)
    return surface.result()


@dataclass(frozen=True)
class _Quads:
    """Corners (2, 2, Q), first index down, second right: target position and nearness; origin and size in source px.

    A size without dimensions is that of every quad. margin (Q,): how far beyond its corners, in target pixels, a quad
    may cover a pixel centre. A centre on the side that two quads share belongs to the second; where that one is torn,
    the first has it.
    """

    x: NDArray
    y: NDArray
    nearness: NDArray
    source_x: NDArray
    source_y: NDArray
    size_x: NDArray
    size_y: NDArray
    margin: NDArray


def _project(source: Camera, target: Camera, x: NDArray, y: NDArray, depth: NDArray) -> tuple[NDArray, ...]:
    target_x, target_y, target_depth = target_px_from_source_px(source, target, x, y, depth)
    nearness = target.nearness_from_depth(target_depth)
    shape = np.broadcast_shapes(depth.shape, np.shape(target_x))
    return tuple(np.broadcast_to(a, shape) for a in (target_x, target_y, nearness))


def _coarse_quads(vertices: NDArray, source: Camera, target: Camera, grid: Grid) -> Iterator[_Quads]:
    """The cells that are not subdivided, each as one quad; the last ones end with the frame's outer ring."""
    all_rows, all_columns = np.nonzero(~grid.subdivided)
    for start in range(0, all_rows.size, CHUNK):
        top, left = all_rows[start : start + CHUNK] * CELL, all_columns[start : start + CHUNK] * CELL
        bottom = np.minimum(top + CELL, grid.height + 1)
        right = np.minimum(left + CELL, grid.width + 1)
        i = np.array([[top, top], [bottom, bottom]])
        j = np.array([[left, right], [left, right]])
        x, y, nearness = _project(source, target, j - 0.5, i - 0.5, vertices[i, j])
        yield _Quads(x, y, nearness, left - 0.5, top - 0.5, right - left, bottom - top, np.zeros(top.shape))


def _fine_quads(
    vertices: NDArray, torn: NDArray[np.bool_], source: Camera, target: Camera, grid: Grid
) -> Iterator[_Quads]:
    """The quads of the subdivided cells, some cells at a time, without those that are torn."""
    all_rows, all_columns = np.nonzero(grid.subdivided)
    span = np.arange(CELL + 1)
    beside_tear = dilate(torn, 1)
    for start in range(0, all_rows.size, CHUNK):
        i = all_rows[start : start + CHUNK, None, None] * CELL + span[None, :, None]
        j = all_columns[start : start + CHUNK, None, None] * CELL + span[None, None, :]
        x, y, nearness = _project(source, target, j - 0.5, i - 0.5, vertices[i, j])
        corner_i, corner_j = np.broadcast_arrays(i[:, :-1], j[:, :, :-1])
        kept = ~torn[corner_i, corner_j]

        def corners(values: NDArray, kept: NDArray = kept) -> NDArray:
            v = values
            return np.array(
                [[v[:, :-1, :-1][kept], v[:, :-1, 1:][kept]], [v[:, 1:, :-1][kept], v[:, 1:, 1:][kept]]],
            )

        one = np.array(1, np.int64)
        yield _Quads(
            corners(x),
            corners(y),
            corners(nearness),
            corner_j[kept] - 0.5,
            corner_i[kept] - 0.5,
            one,
            one,
            np.where(beside_tear[corner_i, corner_j][kept], EDGE_TOLERANCE, 0.0),
        )


class _Surface:
    """The target's depth buffer, and with it the source position of what won."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self.height, self.width = shape
        pixels = self.height * self.width
        self.nearness = np.full(pixels, -np.inf, np.float32)
        self.x = np.full(pixels, np.nan, np.float32)
        self.y = np.full(pixels, np.nan, np.float32)

    def result(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        shape = (self.height, self.width)
        # What was drawn without a place hides what is behind it, and is a hole.
        self.nearness[np.isnan(self.x)] = -np.inf
        self.y[np.isnan(self.x)] = np.nan
        return self.x.reshape(shape), self.y.reshape(shape), self.nearness.reshape(shape)

    def draw(self, quads: _Quads) -> None:
        """Two triangles per quad, cut along the diagonal from top right to bottom left; every step over all quads.

        The steps stand in one function because each hands its arrays to the next: split up, they would be passed
        around by the dozen.
        """
        left, count_x = _centres_within(quads.x, self.width, quads.margin)
        top, count_y = _centres_within(quads.y, self.height, quads.margin)
        chosen = np.nonzero((count_x > 0) & (count_y > 0))[0]
        if chosen.size == 0:
            return
        left, top, count_x, count_y = left[chosen], top[chosen], count_x[chosen], count_y[chosen]
        upper, lower = _triangles(quads, chosen, left + 0.5, top + 0.5)
        quad, step_x, step_y = _candidates(count_x, count_y)
        single = quad is None

        def at(coefficients: NDArray) -> NDArray:
            base, along_x, along_y = coefficients
            # In one type, or what comes out would depend on what else is drawn at a time.
            return base.astype(np.float64) if single else base[quad] + along_x[quad] * step_x + along_y[quad] * step_y

        def spread(values: NDArray) -> NDArray:
            values = np.broadcast_to(values, quads.x.shape[2:])[chosen]
            return values if single else values[quad]

        upper_u, upper_v = at(upper.u), at(upper.v)
        in_upper = upper_u + upper_v <= 1.0
        u = np.where(in_upper, upper_u, 1.0 - at(lower.u))
        v = np.where(in_upper, upper_v, 1.0 - at(lower.v))
        least = np.where(in_upper, np.minimum(u, v), np.minimum(np.minimum(1.0 - u, 1.0 - v), u + v - 1.0))
        nearness = np.where(in_upper, at(upper.nearness), at(lower.nearness))
        inside = least >= -EDGE_TOLERANCE
        pixel_x, pixel_y = (left, top) if single else (left[quad] + step_x, top[quad] + step_y)
        pixel = (pixel_y * self.width + pixel_x)[inside]
        x = spread(quads.source_x)[inside] + u[inside] * (
            spread(quads.size_x)[inside] if quads.size_x.ndim else quads.size_x
        )
        hides = np.where(in_upper, *((t.hides if single else t.hides[quad]) for t in (upper, lower)))
        x = np.where(hides[inside], np.nan, x)
        y = spread(quads.source_y)[inside] + v[inside] * (
            spread(quads.size_y)[inside] if quads.size_y.ndim else quads.size_y
        )
        self._store(pixel, nearness[inside], x, y)

    def _store(self, pixel: NDArray, nearness: NDArray, x: NDArray, y: NDArray) -> None:
        """Depth test by repeated writing: whoever is still nearer than what stands there writes again.

        A few rounds over ever fewer candidates; each is a plain scatter, which numpy does faster than `minimum.at` or
        a sort.
        """
        nearness = nearness.astype(np.float32, copy=False)
        waiting = np.nonzero(nearness > self.nearness[pixel])[0]
        while waiting.size:
            self.nearness[pixel[waiting]] = nearness[waiting]
            stands = self.nearness[pixel[waiting]]
            mine = nearness[waiting]
            won = waiting[stands == mine]
            self.x[pixel[won]] = x[won]
            self.y[pixel[won]] = y[won]
            waiting = waiting[mine > stands]


def _centres_within(corners: NDArray, size: int, margin: NDArray) -> tuple[NDArray, NDArray]:
    """First pixel whose centre lies in the corners' half-open range, and how many do, inside 0..size; NaN: none."""
    low = corners.min(axis=(0, 1)) - margin
    high = corners.max(axis=(0, 1)) + margin
    valid = high - low < np.inf
    with np.errstate(invalid="ignore"):
        first = np.clip(np.ceil(np.where(valid, low, 0.0) - 0.5), 0, size).astype(np.int64)
        end = np.clip(np.ceil(np.where(valid, high, 0.0) - 0.5), 0, size).astype(np.int64)
    return first, end - first


def _candidates(count_x: NDArray, count_y: NDArray) -> tuple[NDArray | None, NDArray, NDArray]:
    """Every (quad, pixel) pair, as the quad's index and the pixel's offset; None where each quad has just one."""
    count = count_x * count_y
    if int(count.max()) == 1:
        return None, count, count
    quad = np.repeat(np.arange(count.size), count)
    rank = np.arange(quad.size) - np.repeat(np.cumsum(count) - count, count)
    step_y = rank // count_x[quad]
    return quad, rank - step_y * count_x[quad], step_y


@dataclass(frozen=True)
class _Triangle:
    """Barycentric u, v and nearness as (value at the first centre, change per pixel right, per pixel down), (3, Q)."""

    u: NDArray
    v: NDArray
    nearness: NDArray
    hides: NDArray[np.bool_]
    """(Q,): turned away or overstretched: it holds nothing to show, but what is behind it is not seen."""


def _triangles(quads: _Quads, chosen: NDArray, x: NDArray, y: NDArray) -> tuple[_Triangle, _Triangle]:
    corner_x, corner_y, corner_n = (c[:, :, chosen] for c in (quads.x, quads.y, quads.nearness))
    area = np.asarray(quads.size_x * quads.size_y)
    area = area[chosen] if area.ndim else area
    return (
        _triangle(corner_x, corner_y, corner_n, (0, 0), (0, 1), (1, 0), x, y, area),
        _triangle(corner_x, corner_y, corner_n, (1, 1), (1, 0), (0, 1), x, y, area),
    )


def _triangle(corner_x, corner_y, corner_n, origin, along_u, along_v, x, y, area) -> _Triangle:
    """Coefficients of one triangle with its right angle at `origin`; empty where it has no area."""
    ux, uy = corner_x[along_u] - corner_x[origin], corner_y[along_u] - corner_y[origin]
    vx, vy = corner_x[along_v] - corner_x[origin], corner_y[along_v] - corner_y[origin]
    determinant = ux * vy - uy * vx
    known = (np.abs(determinant) > 1e-9) & (np.abs(determinant) < LARGEST_AREA)
    hides = (determinant < 0.0) | (determinant >= MAX_STRETCH * area)
    inverse = np.where(known, 1.0 / np.where(known, determinant, 1.0), np.nan)
    dx, dy = x - corner_x[origin], y - corner_y[origin]
    u = np.array([(dx * vy - dy * vx) * inverse, vy * inverse, -vx * inverse])
    v = np.array([(ux * dy - uy * dx) * inverse, -uy * inverse, ux * inverse])
    near = corner_n[origin]
    slope_u, slope_v = corner_n[along_u] - near, corner_n[along_v] - near
    nearness = u * slope_u + v * slope_v
    nearness[0] += near
    return _Triangle(u.astype(np.float32), v.astype(np.float32), nearness, hides)
