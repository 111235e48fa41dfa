"""The forward warp of a rectified pair, whose rows match: the grid is then row segments, between the corners in a row.

Both eyes look the same way and stand side by side, as all but those that are toed in. A row of target pixel centres is
a row of the grid's corners, so nothing is left of its quads but their sides: intervals between corner columns, one
column long where a cell is subdivided, as long as the cell where it is not. With c the column of an interval's first
corner and d how far that moves, in pixels, it covers the centres from c - 1 + ceil(d) up to the same of its last
corner, which is left out: each by exactly one interval of a surface that does not fold.

No depth test is needed. Of two intervals that cover a centre, the one that comes later in the direction in which what
is near moves less is the nearer one (McMillan's occlusion-compatible order, 1995): with x + c n the same for two
points, n grows along the row as 1 / -c.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..images.bands import bands
from ..views.camera import Camera, OrthographicCamera, target_from_source
from .grid import CELL_QUADS, Grid
from .tuning import TUNING

FARTHEST_PIXELS = 1e6
"""Disparity beyond which it is held: a point that moves further is outside any picture, and integers hold its place."""

LARGEST_NEARNESS = 1e38
"""Nearness beyond which it is held: less than half a float32's range, so that two of them have a difference."""

SAME_SHARE = 1e-12
"""Relative difference between numbers of two cameras up to which they are the same: rounding of double precision."""


@dataclass(frozen=True)
class RowDisparity:
    """The row disparity of a rectified pair: a point moves offset + per_nearness * nearness pixels to the right."""

    offset: float
    per_nearness: float


def row_disparity_of(source: Camera, target: Camera) -> RowDisparity | None:
    """Return the row disparity of a rectified pair, whose rows match; None for any other pair."""
    transform = target_from_source(source, target)
    moved = np.array(transform)
    moved[0, 3] = 0.0
    # So much is lost of the difference between two places that are far from the world's origin.
    lost = 8.0 * np.finfo(np.float64).eps * float(np.abs(source.world_from_camera[:3, 3]).max())
    aside, moved[1:3, 3] = np.abs(moved[1:3, 3]), 0.0
    if type(source) is not type(target) or not np.allclose(moved, np.eye(4), rtol=0.0, atol=SAME_SHARE):
        return None
    if aside.max() > SAME_SHARE + lost:
        return None
    one, other = source.plane, target.plane
    rows = (one.bottom, one.top, source.height) == (other.bottom, other.top, target.height)
    size, other_size = (one.right - one.left) / source.width, (other.right - other.left) / target.width
    if not rows or not np.isclose(size, other_size, rtol=SAME_SHARE, atol=0.0):
        return None
    offset, baseline = (one.left - other.left) / size, float(transform[0, 3]) / size
    return (
        RowDisparity(offset + baseline, 0.0)
        if isinstance(source, OrthographicCamera)
        else RowDisparity(offset, baseline)
    )


def warp_rows(
    depth: NDArray, source: Camera, width: int, disparity: RowDisparity, grid: Grid, torn: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the source x (H, width) in pixels, NaN where nothing lands, and the nearness (H, width), -inf there.

    depth (H, W) as for `forward.forward_warp`; torn (H + 1, W + 1) are quads that, in a subdivided cell, are not drawn.
    """
    height = depth.shape[0]
    x, nearness = np.empty((height, width), np.float32), np.empty((height, width), np.float32)
    for cells in _alike(~grid.subdivided):
        # Lattice row i is the picture's row i - 1.
        lattice = np.arange(max(cells.start * CELL_QUADS, 1), min(cells.stop * CELL_QUADS, height + 1))
        coarse = ~grid.subdivided[cells.start]
        segments = _RowSegments(coarse, grid.width, width, disparity)
        for part in bands((lattice.size, width)):
            rows = slice(lattice[part][0] - 1, lattice[part][-1])
            undrawn = None if coarse.all() else torn[rows] & torn[rows.start + 1 : rows.stop + 1]
            x[rows], nearness[rows] = segments.warp(_corners(depth, source, segments, lattice[part]), undrawn)
    return x, nearness


def _alike(coarse: NDArray[np.bool_]) -> Iterator[slice]:
    """Yield the rows of cells (R, C): those that are wholly coarse together, all others one by one."""
    whole = coarse.all(axis=1)
    ends = np.flatnonzero(~(whole[1:] & whole[:-1])) + 1
    for start, stop in itertools.pairwise([0, *ends.tolist(), len(whole)]):
        yield slice(start, stop)


def _corners(depth: NDArray, source: Camera, segments: _RowSegments, lattice: NDArray) -> NDArray[np.float32]:
    """Return (h, K + 1) the nearness of the segments' corners in these rows (h,) of the lattice of vertices.

    At a corner where only coarse cells meet it is linear between the cells' first and last row.
    """
    height, width = depth.shape
    column = np.clip(segments.corner - 1, 0, width - 1)

    def near(lines: NDArray) -> NDArray[np.float32]:
        with np.errstate(over="ignore"):
            return np.clip(
                source.nearness_from_depth(lines.astype(np.float32, copy=False)), -LARGEST_NEARNESS, LARGEST_NEARNESS
            )

    cell = lattice // CELL_QUADS
    edges = np.minimum(np.arange(cell[0], cell[-1] + 2) * CELL_QUADS, height + 1)
    above = cell - cell[0]
    down = ((lattice - edges[above]) / (edges[above + 1] - edges[above])).astype(np.float32)[:, None]
    flat = column[segments.flat]
    line = near(depth[np.clip(edges - 1, 0, height - 1)[:, None], flat])
    between = line[above] * (1.0 - down) + line[above + 1] * down
    if flat.size == column.size:
        return between
    result = near(depth[lattice[0] - 1 : lattice[-1]].take(column, axis=1))
    result[:, segments.flat] = between
    return result


class _RowSegments:
    """The segments between the corners of a row of cells, drawn into rows of `width` target pixels.

    coarse (C,): the row's coarse cells. corner (K + 1,): the corners' columns in the lattice. flat (K + 1,): corners at
    which no subdivided cell ends.
    """

    def __init__(self, coarse: NDArray[np.bool_], columns: int, width: int, disparity: RowDisparity) -> None:
        self._width, self._disparity = width, disparity
        lattice = np.arange(columns + 2, dtype=np.int32)
        in_coarse = coarse.repeat(CELL_QUADS)[: columns + 1]
        self.coarse = coarse
        self.corner = lattice[np.append(~in_coarse | (lattice[:-1] % CELL_QUADS == 0), True)]
        after = np.append(in_coarse, in_coarse[-1])[self.corner]
        before = np.insert(in_coarse, 0, in_coarse[0])[self.corner]
        self.flat = before & after
        self._torn_column = self.corner[:-1][~after[:-1]]
        self._tearable = np.flatnonzero(~after[:-1])
        self._length = np.diff(self.corner).astype(np.float32)
        self._longest = self._length.max()
        # Where intervals begin in the source, and target pixels' centres as if nothing moved.
        self._begin = (self.corner[:-1] - 0.5).astype(np.float32)
        self._before = (self.corner - 1.0).astype(np.float32)
        self._beyond = np.arange(width, dtype=np.float32) + np.float32(0.5)

    def warp(self, near: NDArray[np.float32], torn: NDArray[np.bool_] | None) -> tuple[NDArray, NDArray]:
        """Return the source x and the nearness (h, width) of the target pixels.

        near (h, K + 1): nearness of the corners. torn (h, W + 1): the lattice's intervals that are not drawn; None
        where all are.
        """
        moved = self._moved(near)
        stretched = self._length + (moved[:, 1:] - moved[:, :-1])
        undrawn = np.zeros(stretched.shape, bool)
        if torn is not None:
            undrawn[:, self._tearable] = torn[:, self._torn_column]
        nearest = self._nearest(moved, undrawn, stretched < TUNING.max_stretch * self._length)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            slope = self._length / stretched
            table = np.stack([moved[:, :-1], slope, near[:, :-1], (near[:, 1:] - near[:, :-1]) / self._length], axis=-1)
            return self._looked_up(nearest, table, bounded=torn is not None)

    def _looked_up(self, nearest: NDArray[np.int32], table: NDArray, *, bounded: bool) -> tuple[NDArray, NDArray]:
        """Return the source x and the nearness (h, width), by the nearest intervals (h, width).

        These are places in the table (h, K, 4), which has, for each interval, the disparity of its first corner, source
        pixels per target pixel, the nearness there, and its change per source pixel. bounded: True where a centre may
        lie beside an interval.
        """
        empty = nearest < 0
        found = table.reshape(-1, 4).take(nearest, axis=0, mode="clip")
        x = np.tile(self._begin, table.shape[0]).take(nearest, mode="clip")
        along = self._beyond - x
        along -= found[..., 0]
        along *= found[..., 1]
        if bounded:
            # Within the tolerance beyond a corner it has what is there, however narrow the interval is.
            np.fmin(np.fmax(along, 0.0, out=along), self._reach(nearest, table.shape[0]), out=along)
        x += along
        along *= found[..., 3]
        along += found[..., 2]
        if empty.any():
            np.copyto(x, np.nan, where=empty)
            np.copyto(along, -np.inf, where=empty)
        return x, along

    def _reach(self, nearest: NDArray[np.int32], height: int) -> NDArray[np.float32] | np.float32:
        """Return the length of the intervals (h, width), by their places in a table of this height."""
        if self._longest == 1.0:
            return self._longest
        return np.tile(self._length, height).take(nearest, mode="clip")

    def _moved(self, near: NDArray[np.float32]) -> NDArray[np.float32]:
        with np.errstate(over="ignore", invalid="ignore"):
            moved = near * np.float32(self._disparity.per_nearness) + np.float32(self._disparity.offset)
        # Of a NaN, fmin and fmax have the other: what has no depth is torn.
        return np.fmax(np.fmin(moved, FARTHEST_PIXELS, out=moved), -FARTHEST_PIXELS, out=moved)

    def _nearest(
        self, moved: NDArray[np.float32], torn: NDArray[np.bool_], tight: NDArray[np.bool_]
    ) -> NDArray[np.int32]:
        """Return (h, width) the nearest of the intervals (h, K) that cover a pixel, counted over all rows.

        -1 where there is none, or where the nearest shows nothing: it is seen from its other side, or overstretched,
        which is any that is not tight. moved (h, K + 1): the corners' disparities. A torn interval covers nothing.
        """
        height = torn.shape[0]
        first = (np.ceil(moved) + self._before).astype(np.int32)
        interval = np.arange(torn.size, dtype=np.int32)
        edge = np.clip(first, 0, self._width)
        count = edge[:, 1:] - edge[:, :-1]
        if count.min() >= 0 and not torn.any():
            # Nothing lies before anything else: each row is one interval after the other.
            nothing = np.full((height, 1), -1, np.int32)
            inside = np.where(tight, interval.reshape(count.shape), nothing)
            whole = np.hstack([edge[:, :1], count, self._width - edge[:, -1:]])
            return np.hstack([nothing, inside, nothing]).repeat(whole.ravel()).reshape(height, self._width)
        start, stop = (np.clip(ends, 0, self._width) for ends in self._ends(first, moved, torn))
        shown = tight & ~torn & (stop > start)
        low, wide = np.minimum(start, stop), np.where(torn, 0, np.abs(stop - start))
        broad = ~shown & (wide > TUNING.broad_pixels)
        hidden = _within(low, wide, broad, self._width)
        wide = np.where(broad, 0, wide).ravel()
        low += (np.arange(height, dtype=np.int32) * self._width)[:, None]
        ahead = np.cumsum(wide, dtype=np.int64) - wide
        place = (low.ravel() - ahead).repeat(wide)
        place += np.arange(place.size)
        interval = interval.repeat(wide)
        if self._disparity.per_nearness > 0.0:
            place, interval = place[::-1].copy(), interval[::-1].copy()
        won = np.full(height * self._width, -1, np.int32)
        # Of several that are written to one place the last one stands.
        won[place] = interval
        np.copyto(won, -1, where=~shown.ravel().take(won, mode="clip"))
        won = won.reshape(height, self._width)
        return won if hidden is None else np.where(hidden, np.int32(-1), won)

    def _ends(
        self, first: NDArray[np.int32], moved: NDArray[np.float32], torn: NDArray[np.bool_]
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Return (h, K) the first pixel of each interval, and the one after its last.

        A centre on a corner belongs to the interval after it; beside what is torn, to the one that is left.
        """
        start, stop = first[:, :-1].copy(), first[:, 1:].copy()
        row, column = np.nonzero(torn[:, 1:])
        corner = moved[row, column + 1] + np.float32(TUNING.edge_tolerance)
        stop[row, column] = np.floor(corner) + self._before[column + 1] + 1.0
        row, column = np.nonzero(torn[:, :-1])
        corner = moved[row, column + 1] - np.float32(TUNING.edge_tolerance)
        start[row, column + 1] = np.ceil(corner) + self._before[column + 1]
        return start, stop


def _within(low: NDArray, wide: NDArray, chosen: NDArray[np.bool_], width: int) -> NDArray[np.bool_] | None:
    """Return (h, width) pixels that the chosen intervals (h, K) cover, `wide` many from `low` on; None without any."""
    row, column = np.nonzero(chosen)
    if row.size == 0:
        return None
    change = np.zeros((low.shape[0], width + 1), np.int32)
    first = low[row, column]
    np.add.at(change, (row, first), 1)
    np.add.at(change, (row, first + wide[row, column]), -1)
    return np.cumsum(change, axis=1)[:, :width] > 0
