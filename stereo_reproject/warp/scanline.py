"""The forward warp of a pair whose rows match: the grid is then row segments, between the corners in a row.

Both eyes look the same way and stand side by side, as all but those that are toed in; or they are the eyes of spherical
stereo in an equirectangular picture. How far a point moves in its row is the pair's own law (`RowLaw`). A row of target
pixel centres is a row of the grid's corners, so nothing is left of its quads but their sides: intervals between corner
columns, one column long where a cell is subdivided, as long as the cell where it is not. With c the column of an
interval's first corner and d how far that moves, in pixels, it covers the centres from c - 1 + ceil(d) up to the same
of its last corner, which is left out: each by exactly one interval of a surface that does not fold.

No depth test is needed. Of two intervals that cover a centre, the one that comes later in the direction in which what
is near moves less is the nearer one (McMillan's occlusion-compatible order, 1995): with x + c n the same for two
points, n grows along the row as 1 / -c.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..images.bands import bands
from ..views.camera import Camera, OrthographicCamera, is_planar, target_from_source
from .grid import CELL_QUADS, Grid
from .spherical_rows import spherical_rows_of
from .tuning import TUNING

FARTHEST_PIXELS = 1e6
"""Disparity beyond which it is held: a point that moves further is outside any picture, and integers hold its place."""

LARGEST_NEARNESS = 1e38
"""Nearness beyond which it is held: less than half a float32's range, so that two of them have a difference."""

SAME_SHARE = 1e-12
"""Relative difference between numbers of two cameras up to which they are the same: rounding of double precision."""


@dataclass(frozen=True)
class RowDisparity:
    """The shift of a rectified pair, in pixels: a point moves offset + per_nearness * nearness to the right in the
    target."""

    offset: float
    per_nearness: float

    wraps = False
    pixels_per_tangent = None

    @property
    def grows(self) -> bool:
        """True where what is nearer moves farther to the right."""
        return self.per_nearness > 0.0

    def lines(self, height: int) -> NDArray[np.float64]:
        """Return (H, 2) slope and start, as `RowLaw.lines` says: the same ones in all H rows."""
        return np.tile((self.per_nearness, self.offset), (height, 1))

    def moved(self, near: NDArray[np.float32], rows: NDArray[np.intp]) -> NDArray[np.float32]:  # noqa: ARG002
        """Return the disparity (h, K), in pixels, of points with this nearness (h, K), whatever their rows (h,) are."""
        return near * np.float32(self.per_nearness) + np.float32(self.offset)


class RowLaw(Protocol):
    """The shift of a pair whose rows match: how far each point moves in its row. What is nearer moves farther, to one
    side in all rows."""

    @property
    def wraps(self) -> bool:
        """True where the picture's right side goes on at its left."""
        ...

    @property
    def grows(self) -> bool:
        """True where what is nearer moves farther to the right."""
        ...

    @property
    def pixels_per_tangent(self) -> float | None:
        """Pixels that a point moves for one radian of the arc tangent of its row's line; None where the line itself is
        the shift."""
        ...

    def lines(self, height: int) -> NDArray[np.float64]:
        """Return (H, 2) slope and start of each row's line, slope * nearness + start, in a picture of H rows."""
        ...

    def moved(self, near: NDArray[np.float32], rows: NDArray[np.intp]) -> NDArray[np.float32]:
        """Return the disparity (h, K), in pixels, of points with this nearness (h, K) in these rows (h,)."""
        ...


def row_law_of(source: Camera, target: Camera) -> RowLaw | None:
    """Return the shift of points between two cameras whose pictures show each point in the same row and at the same
    nearness; None for any other pair."""
    return row_disparity_of(source, target) or spherical_rows_of(source, target)


def row_disparity_of(source: Camera, target: Camera) -> RowDisparity | None:
    """Return the shift of points between two cameras whose pictures show each point in the same row; None for any other
    pair."""
    if not is_planar(source) or not is_planar(target):
        return None
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
    depth: NDArray, source: Camera, width: int, disparity: RowLaw, grid: Grid, torn: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the map of a pair whose rows match: source x (H, width) in pixels, and nearness (H, width) to the target's
    camera.

    They are NaN and -inf where nothing lands. depth (H, W) is as for `forward.forward_warp`; width is the target's;
    torn (H + 1, W + 1) are quads that, in a subdivided cell, are not drawn.
    """
    height = depth.shape[0]
    x, nearness = np.empty((height, width), np.float32), np.empty((height, width), np.float32)
    if disparity.wraps:
        for rows in bands((height, 2 * width)):
            undrawn = torn[rows] & torn[rows.start + 1 : rows.stop + 1]
            x[rows], nearness[rows] = _warp_around(depth[rows], source, disparity, rows, undrawn)
        return x, nearness
    for cells in _alike(~grid.subdivided):
        # Lattice row i is the picture's row i - 1.
        lattice = np.arange(max(cells.start * CELL_QUADS, 1), min(cells.stop * CELL_QUADS, height + 1))
        coarse = ~grid.subdivided[cells.start]
        segments = _RowSegments(coarse, grid.width, width, disparity)
        for part in bands((lattice.size, width)):
            rows = slice(lattice[part][0] - 1, lattice[part][-1])
            undrawn = None if coarse.all() else torn[rows] & torn[rows.start + 1 : rows.stop + 1]
            near = _corners(depth, source, segments, lattice[part])
            x[rows], nearness[rows] = segments.warp(near, lattice[part] - 1, undrawn)
    return x, nearness


def _warp_around(
    depth: NDArray, source: Camera, disparity: RowLaw, rows: slice, torn: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return what `warp_rows` does for these rows of pictures that go on at their left beyond their right side.

    depth (h, W) and torn (h, W + 1) are those of the rows; all cells are subdivided. The first and the last column of
    torn are both that between the last and the first pixels. The picture is drawn with as much of its other end on
    either side as may move into it.
    """
    width, numbers = depth.shape[1], np.arange(rows.start, rows.stop)
    near = _near(source, depth)
    moved = disparity.moved(near, numbers)
    ahead = int(np.ceil(np.fmax.reduce(np.abs(moved), axis=None, initial=0.0))) + 1
    columns = np.arange(-ahead, width + ahead)
    cells = -(-(columns.size + 1) // CELL_QUADS)
    segments = _RowSegments(np.zeros(cells, bool), columns.size, width, disparity, ahead)
    corners = np.arange(-ahead - 1, width + ahead + 1)
    x, nearness = segments.warp(near.take(corners % width, axis=1), numbers, torn.take(corners[1:] % width, axis=1))
    x -= np.float32(width) * np.floor(x * np.float32(1.0 / width))
    return x, nearness


def _alike(coarse: NDArray[np.bool_]) -> Iterator[slice]:
    """Yield slices of the rows of cells that are drawn together.

    coarse (R, C) are the cells that are not subdivided. Rows of nothing but coarse cells that follow each other make
    one slice; every other row has one of its own.
    """
    whole = coarse.all(axis=1)
    ends = np.flatnonzero(~(whole[1:] & whole[:-1])) + 1
    for start, stop in itertools.pairwise([0, *ends.tolist(), len(whole)]):
        yield slice(start, stop)


def _corners(depth: NDArray, source: Camera, segments: _RowSegments, lattice: NDArray) -> NDArray[np.float32]:
    """Return (h, K + 1) the nearness of the segments' corners, in rows (h,) of the grid's vertices.

    At a corner where only coarse cells meet it is linear between the cells' first and last row. depth (H, W) is the
    source's.
    """
    height, width = depth.shape
    column = np.clip(segments.corner - 1, 0, width - 1)
    cell = lattice // CELL_QUADS
    edges = np.minimum(np.arange(cell[0], cell[-1] + 2) * CELL_QUADS, height + 1)
    above = cell - cell[0]
    down = ((lattice - edges[above]) / (edges[above + 1] - edges[above])).astype(np.float32)[:, None]
    flat = column[segments.flat]
    line = _near(source, depth[np.clip(edges - 1, 0, height - 1)[:, None], flat])
    between = line[above] * (1.0 - down) + line[above + 1] * down
    if flat.size == column.size:
        return between
    result = _near(source, depth[lattice[0] - 1 : lattice[-1]].take(column, axis=1))
    result[:, segments.flat] = between
    return result


def _near(source: Camera, depth: NDArray) -> NDArray[np.float32]:
    """Return the nearness (...) to a camera of points at depth (...), held within LARGEST_NEARNESS."""
    with np.errstate(over="ignore"):
        nearness = source.nearness_from_depth(depth.astype(np.float32, copy=False))
    return np.clip(nearness, -LARGEST_NEARNESS, LARGEST_NEARNESS)


class _RowSegments:
    """The pieces into which corners divide the rows of one row of cells, and their drawing into rows of `width` target
    pixels.

    coarse (C,): which of the cells are coarse. columns: the source's width. corner (K + 1,): columns of the grid's
    vertices at which a segment begins or ends. flat (K + 1,): corners at which no subdivided cell ends. An interval is
    a segment, K of them in each row. ahead: columns of the source that stand before the target's first one.
    """

    def __init__(self, coarse: NDArray[np.bool_], columns: int, width: int, disparity: RowLaw, ahead: int = 0) -> None:
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
        self._begin = (self.corner[:-1] - 0.5 - ahead).astype(np.float32)
        self._before = (self.corner - 1.0 - ahead).astype(np.float32)
        self._beyond = np.arange(width, dtype=np.float32) + np.float32(0.5)

    def warp(
        self, near: NDArray[np.float32], rows: NDArray[np.intp], torn: NDArray[np.bool_] | None
    ) -> tuple[NDArray, NDArray]:
        """Return the source x, in pixels, and the nearness, each (h, width), that h rows of target pixels show.

        near (h, K + 1): nearness of the corners; rows (h,): their numbers. torn (h, W + 1): those of the intervals
        between vertices that are not drawn in subdivided cells; None where all are drawn. Pixels without any have NaN
        and -inf.
        """
        moved = self._moved(near, rows)
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
        """Return the source x and the nearness (h, width) of target pixels, by the interval that each shows.

        nearest (h, width) are these intervals, counted over all rows of the table; -1 is none. table (h, K, 4) has for
        each interval the disparity of its first corner, source pixels per target pixel, the nearness at that corner,
        and its change per source pixel. bounded: True where a pixel's centre may lie a little beyond its interval.
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
        """Return the length, in source pixels, of the interval that each target pixel shows, (h, width).

        nearest (h, width) are these intervals, counted over all rows of a table that has `height` rows. Where all
        intervals are one pixel long, a single number is returned.
        """
        if self._longest == 1.0:
            return self._longest
        return np.tile(self._length, height).take(nearest, mode="clip")

    def _moved(self, near: NDArray[np.float32], rows: NDArray[np.intp]) -> NDArray[np.float32]:
        """Return the disparity (h, K + 1), in pixels, of corners with this nearness (h, K + 1) in these rows (h,), held
        within FARTHEST_PIXELS.

        An unknown one, NaN, becomes FARTHEST_PIXELS: its intervals are torn and not drawn.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            moved = self._disparity.moved(near, rows)
        # Of a NaN, fmin and fmax have the other: what has no depth is torn.
        return np.fmax(np.fmin(moved, FARTHEST_PIXELS, out=moved), -FARTHEST_PIXELS, out=moved)

    def _nearest(
        self, moved: NDArray[np.float32], torn: NDArray[np.bool_], tight: NDArray[np.bool_]
    ) -> NDArray[np.int32]:
        """Return (h, width) for each target pixel the index of the nearest interval that covers it, counted over all
        rows.

        It is -1 where no interval does, or where the nearest one shows nothing, because it is seen from its other side
        or is overstretched. moved (h, K + 1): the corners' disparities. torn (h, K): intervals that cover nothing.
        tight (h, K): those that are not overstretched.
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
        if self._disparity.grows:
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
        """Return (h, K) the first target pixel that each interval covers, and the one after its last.

        first (h, K + 1): the first pixel at or after each corner. moved (h, K + 1): the corners' disparities. A pixel's
        centre on a corner belongs to the interval after it; beside one that is torn (h, K), to the one that is drawn.
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
    """Return (h, width) the pixels that any of the chosen intervals (h, K) covers; None where none is chosen.

    Each interval covers `wide` pixels from `low` on, both (h, K).
    """
    row, column = np.nonzero(chosen)
    if row.size == 0:
        return None
    change = np.zeros((low.shape[0], width + 1), np.int32)
    first = low[row, column]
    np.add.at(change, (row, first), 1)
    np.add.at(change, (row, first + wide[row, column]), -1)
    return np.cumsum(change, axis=1)[:, :width] > 0
