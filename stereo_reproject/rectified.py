"""The forward warp of a rectified pair, whose rows stay rows: the grid is then a chain of corners in each row.

Both eyes look the same way and stand side by side, as all but those that are toed in. A row of target pixel centres is
a row of the grid's corners, so nothing is left of its quads but their sides: interval k, between the corners k and
k + 1. With d how far a corner moves, in pixels, it covers the centres k - 1 + ceil(d[k]) up to k - 1 + ceil(d[k + 1]),
the last one left out, each by exactly one interval of a surface that does not fold.

No depth test is needed. Of two intervals that cover a centre, the one that comes later in the direction in which what
is near moves less is the nearer one (McMillan's occlusion-compatible order, 1995): with x + c n the same for two
points, n grows along the row as 1 / -c.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .camera import Camera, OrthographicCamera, target_from_source
from .grid import CELL, Grid

MAX_STRETCH = 2.5
"""An interval that covers more target pixels than this holds too little to fill them: it is left a hole."""

FARTHEST = 1e6
"""Pixels: what moves further is outside any picture, and its place still a number that integers hold."""

LARGEST = 1e38
"""Of nearness: half a float32's range, so that two of them have a difference."""

SAME = 1e-12


@dataclass(frozen=True)
class Shift:
    """How far, in pixels to the right, a point moves: offset + per_nearness * its nearness."""

    offset: float
    per_nearness: float


def shift_of(source: Camera, target: Camera) -> Shift | None:
    """The shift of a rectified pair; None of any other."""
    transform = target_from_source(source, target)
    moved = np.array(transform)
    moved[0, 3] = 0.0
    # So much is lost of the difference between two places that are far from the world's origin.
    lost = 8.0 * np.finfo(np.float64).eps * float(np.abs(source.world_from_camera[:3, 3]).max())
    aside, moved[1:3, 3] = np.abs(moved[1:3, 3]), 0.0
    if type(source) is not type(target) or not np.allclose(moved, np.eye(4), rtol=0.0, atol=SAME):
        return None
    if aside.max() > SAME + lost:
        return None
    one, other = source.plane, target.plane
    rows = (one.bottom, one.top, source.height) == (other.bottom, other.top, target.height)
    size, other_size = (one.right - one.left) / source.width, (other.right - other.left) / target.width
    if not rows or not np.isclose(size, other_size, rtol=SAME, atol=0.0):
        return None
    offset, baseline = (one.left - other.left) / size, float(transform[0, 3]) / size
    return Shift(offset + baseline, 0.0) if isinstance(source, OrthographicCamera) else Shift(offset, baseline)


def warp_rows(
    depth: NDArray, source: Camera, width: int, shift: Shift, grid: Grid, torn: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Source x (H, width) in pixels, NaN where nothing lands, and nearness (H, width), -inf there.

    depth (H, W) as for `warp.forward_warp`; torn (H + 1, W + 1) are the quads of subdivided cells that are not drawn.
    """
    height, columns = depth.shape
    x, nearness = np.empty((height, width), np.float32), np.empty((height, width), np.float32)
    chain = _Chain(columns, width, shift)
    for top in range(0, height + 1, CELL):
        # Lattice row i is the picture's row i - 1.
        rows = slice(max(top, 1) - 1, min(top + CELL, height + 1) - 1)
        if rows.start >= rows.stop:
            continue
        near = _corners(depth, source, grid, top // CELL, rows)
        undrawn = torn[rows.start : rows.stop] & torn[rows.start + 1 : rows.stop + 1]
        x[rows], nearness[rows] = chain.warp(near, undrawn)
    return x, nearness


def _corners(depth: NDArray, source: Camera, grid: Grid, band: int, rows: slice) -> NDArray[np.float32]:
    """(rows, W + 2): nearness of the corners in some rows of a band of cells; on a coarse cell, by its own corners."""
    known = np.pad(depth[rows], ((0, 0), (1, 1)), mode="edge").astype(np.float64)
    near = source.nearness_from_depth(known)
    coarse = ~grid.subdivided[band]
    if coarse.any():
        inside = np.repeat(coarse, CELL)[: grid.width + 1]
        both = np.concatenate([inside[:1], inside[1:] & inside[:-1], inside[-1:]])
        near[:, both] = _flat(depth, source, grid, band, rows)[:, both]
    return np.clip(near, -LARGEST, LARGEST).astype(np.float32)


def _flat(depth: NDArray, source: Camera, grid: Grid, band: int, rows: slice) -> NDArray[np.float64]:
    """(rows, W + 2): the same as if all cells of the band were coarse: two triangles each."""
    height, width = depth.shape
    top, bottom = band * CELL, min((band + 1) * CELL, height + 1)
    edges = np.minimum(np.arange(grid.subdivided.shape[1] + 1) * CELL, width + 1)
    lines = [np.clip(line - 1, 0, height - 1) for line in (top, bottom)]
    above, below = (
        source.nearness_from_depth(depth[line][np.clip(edges - 1, 0, width - 1)].astype(np.float64)) for line in lines
    )
    column = np.arange(width + 2)
    cell = np.minimum(column // CELL, edges.size - 2)
    u = ((column - edges[cell]) / (edges[cell + 1] - edges[cell]))[None]
    v = ((np.arange(rows.start, rows.stop) + 1 - top) / (bottom - top))[:, None]
    upper = above[cell] + u * (above[cell + 1] - above[cell]) + v * (below[cell] - above[cell])
    lower = (
        below[cell + 1] + (1.0 - u) * (below[cell] - below[cell + 1]) + (1.0 - v) * (above[cell + 1] - below[cell + 1])
    )
    return np.where(u + v <= 1.0, upper, lower)


class _Chain:
    """Rows of corners, W + 2 in each, drawn into rows of `width` target pixels."""

    def __init__(self, columns: int, width: int, shift: Shift) -> None:
        self._width, self._shift = width, shift
        self._interval = np.arange(columns + 1, dtype=np.int32)
        self._pixel = np.arange(width, dtype=np.int32)

    def warp(self, near: NDArray[np.float32], undrawn: NDArray[np.bool_]) -> tuple[NDArray, NDArray]:
        """near (h, W + 2) and undrawn (h, W + 1), of corners and intervals, to source x and nearness (h, width)."""
        moved = self._moved(near)
        whole = np.ceil(moved).astype(np.int32)
        first = self._interval - 1 + whole[:, :-1]
        count = 1 + whole[:, 1:] - whole[:, :-1]
        drawn = (count > 0) & (1.0 + moved[:, 1:] - moved[:, :-1] < MAX_STRETCH) & ~undrawn
        nearest = self._nearest(first, count, drawn)
        self._hide(nearest, first, count, (count != 0) & ~drawn & ~undrawn)
        covered = nearest >= 0
        corner = np.where(covered, nearest, 0) + (np.arange(near.shape[0], dtype=np.int32) * near.shape[1])[:, None]
        left, right = moved.ravel().take(corner), moved.ravel().take(corner + 1)
        along = (self._pixel + 1 - nearest - left) / (1.0 + right - left)
        left, right = near.ravel().take(corner), near.ravel().take(corner + 1)
        x = (nearest - np.float32(0.5)) + along
        return np.where(covered, x, np.nan), np.where(covered, left + along * (right - left), -np.inf)

    def _moved(self, near: NDArray[np.float32]) -> NDArray[np.float32]:
        with np.errstate(over="ignore", invalid="ignore"):
            moved = near * np.float32(self._shift.per_nearness) + np.float32(self._shift.offset)
        return np.clip(np.nan_to_num(moved, nan=0.0, posinf=FARTHEST, neginf=-FARTHEST), -FARTHEST, FARTHEST)

    def _nearest(self, first: NDArray, count: NDArray, drawn: NDArray[np.bool_]) -> NDArray[np.int32]:
        """(h, width): the nearest interval that covers each pixel, -1 where none does."""
        height = first.shape[0]
        step = -1 if self._shift.per_nearness > 0.0 else 1
        won = np.full(height * self._width, -1 if step > 0 else self._interval.size, np.int32)
        start = (np.arange(height, dtype=np.int32) * self._width)[:, None]
        interval = np.broadcast_to(self._interval, first.shape)
        for pixel in range(int(np.ceil(MAX_STRETCH))):
            there = drawn & (count > pixel) & (first >= -pixel) & (first < self._width - pixel)
            place, candidate = (first + start)[there][::step] + pixel, interval[there][::step]
            # The last one that is written stands, as a rule; what else may happen is put right.
            waiting = step * (candidate - won[place]) > 0
            while waiting.any():
                place, candidate = place[waiting], candidate[waiting]
                won[place] = candidate
                waiting = step * (candidate - won[place]) > 0
        won[won == self._interval.size] = -1
        return won.reshape(height, self._width)

    def _hide(self, nearest: NDArray, first: NDArray, count: NDArray, surface: NDArray[np.bool_]) -> None:
        """Take from `nearest` what lies behind a surface that is not drawn: too slanted, or seen from behind."""
        rows, interval = np.nonzero(surface)
        if rows.size == 0:
            return
        one = first[rows, interval]
        other = one + count[rows, interval]
        low = np.clip(np.minimum(one, other), 0, self._width)
        wide = np.clip(np.maximum(one, other), 0, self._width) - low
        rows, interval, start = (np.repeat(a, wide) for a in (rows, interval, low - np.cumsum(wide) + wide))
        pixel = start + np.arange(start.size)
        behind = nearest[rows, pixel] < interval if self._shift.per_nearness <= 0.0 else nearest[rows, pixel] > interval
        nearest[rows[behind], pixel[behind]] = -1
