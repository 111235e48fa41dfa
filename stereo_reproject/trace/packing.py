"""The layout of pixels in the dense little picture that is rendered for them.

Cycles gives neighbours noise that is unlike (blue noise), and a denoiser counts on it: where pixels that lie side by
side in a view are packed row by row, what is left of their noise is streaks. Here they follow a Z-curve (Morton, 1966)
through the view, and lie along one in the packed picture; whole blocks of the view come first, the largest before the
others, and so each of them is a block of the packed picture too. Pixels that are traced again come last: their noise
must have nothing to do with that of the first time. Each view has blocks of its own, one view after the other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .tuning import TUNING

COORDINATE_BITS = 17
"""Bits of a row or a column: Blender's pictures have at most 65536."""


@dataclass(frozen=True)
class Packing:
    """The layout of a packed picture.

    width and height are its size in pixels. at has, for each view, the places (N,) of that view's N pixels in it,
    counted row by row.
    """

    width: int
    height: int
    at: tuple[NDArray[np.intp], ...]


def pack(views: Sequence[NDArray[np.intp]]) -> Packing:
    """Return a layout for pixels of any number of views in one packed picture.

    views has rows and columns (N, 2) for each view. A pixel that is to be traced twice is in it twice.
    """
    side = TUNING.block_side_pixels
    counts = [math.ceil(len(places) / side**2) for places in views]
    blocks = max(sum(counts), 1)
    across = _across(blocks)
    width, height = across * side, math.ceil(blocks / across) * side
    at: list[NDArray[np.intp]] = []
    for places, first in zip(views, np.cumsum([0, *counts]), strict=False):
        number = np.empty(len(places), np.intp)
        number[_order(places)] = np.arange(len(places))
        block, within = np.divmod(number + first * side**2, side**2)
        row = block // across * side + _every_second_bit(within >> 1)
        column = block % across * side + _every_second_bit(within)
        at.append(row * width + column)
    return Packing(width, height, tuple(at))


def _across(blocks: int) -> int:
    """Return the number of blocks that stand side by side: that of the nearly square picture that leaves the fewest
    empty."""
    side = math.sqrt(blocks)
    least, most = math.floor(side / math.sqrt(TUNING.max_aspect)), math.ceil(side * math.sqrt(TUNING.max_aspect))
    return min(range(max(least, 1), most + 1), key=lambda across: (-blocks % across, abs(across - side)))


def _order(places: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return (N,) the indices of a view's pixels in the order in which they are packed.

    places (N, 2) are their rows and columns. Pixels that come a second time are last, and the largest whole blocks
    first.
    """
    rows, columns = places.T
    along = _spread_bits(columns) | _spread_bits(rows) << 1
    by_curve = np.argsort(along, kind="stable")
    along = along[by_curve]
    again = np.concatenate([[False], along[1:] == along[:-1]])[: along.size]
    largest = np.ones(along.size, np.intp)
    size = 2
    while size <= TUNING.block_side_pixels and along.size:
        starts = np.concatenate([[0], 1 + np.nonzero(np.diff(along // size**2))[0]])
        pixels = np.add.reduceat(~again, starts, dtype=np.intp)
        largest[np.repeat(pixels == size**2, np.diff(starts, append=along.size))] = size
        size *= 2
    return by_curve[np.lexsort((-largest, again))]


def _spread_bits(number: NDArray[np.intp]) -> NDArray[np.int64]:
    """Return the numbers with a zero put before each of their bits: binary 11 becomes 0101."""
    result = np.zeros(number.shape, np.int64)
    for bit in range(COORDINATE_BITS):
        result |= (number.astype(np.int64) >> bit & 1) << 2 * bit
    return result


def _every_second_bit(number: NDArray[np.intp]) -> NDArray[np.int64]:
    """Return the numbers made of every second bit, from the lowest on: the inverse of `_spread_bits`."""
    result = np.zeros(number.shape, np.int64)
    for bit in range(COORDINATE_BITS):
        result |= (number.astype(np.int64) >> 2 * bit & 1) << bit
    return result
