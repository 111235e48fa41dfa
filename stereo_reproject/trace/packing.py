"""How target pixels are laid out in the dense little picture that is rendered for them.

Cycles gives neighbours noise that is unlike (blue noise), and a denoiser counts on it: where pixels that lie side by
side in the target are packed row by row, what is left of their noise is streaks. Here they follow a Z-curve (Morton,
1966) through the target, and lie along one in the packed picture; whole blocks of the target come first, the largest
before the others, and so each of them is a block of the packed picture too. Pixels that are traced again come last:
their noise must have nothing to do with that of the first time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

BLOCK = 16
"""Pixels along the side of the largest block, a power of two. With 8, what a volume showed was still a little streaked
when it was denoised; 32 was no better."""

SQUARE = 1.5
"""How much wider than high, or higher than wide, the packed picture may be where fewer pixels are wasted so."""

BITS = 17
"""Of a row or a column."""


@dataclass(frozen=True)
class Packing:
    """The packed picture's size in pixels, and (N,) where in it, row by row, each pixel is."""

    width: int
    height: int
    at: NDArray[np.intp]


def pack(places: NDArray[np.intp]) -> Packing:
    """Of target pixels (N, 2), row and column, of which some may be the same."""
    blocks = max(math.ceil(len(places) / BLOCK**2), 1)
    across = _across(blocks)
    number = np.empty(len(places), np.intp)
    number[_order(places)] = np.arange(len(places))
    block, within = np.divmod(number, BLOCK**2)
    row = block // across * BLOCK + _every_second_bit(within >> 1)
    column = block % across * BLOCK + _every_second_bit(within)
    width, height = across * BLOCK, math.ceil(blocks / across) * BLOCK
    return Packing(width, height, row * width + column)


def _across(blocks: int) -> int:
    """Blocks side by side: of nearly square pictures the one that leaves the fewest empty."""
    side = math.sqrt(blocks)
    least, most = math.floor(side / math.sqrt(SQUARE)), math.ceil(side * math.sqrt(SQUARE))
    return min(range(max(least, 1), most + 1), key=lambda across: (-blocks % across, abs(across - side)))


def _order(places: NDArray[np.intp]) -> NDArray[np.intp]:
    """(N,): which comes first."""
    rows, columns = places.T
    along = _spread_bits(columns) | _spread_bits(rows) << 1
    by_curve = np.argsort(along, kind="stable")
    along = along[by_curve]
    again = np.concatenate([[False], along[1:] == along[:-1]])[: along.size]
    largest = np.ones(along.size, np.intp)
    size = 2
    while size <= BLOCK and along.size:
        starts = np.concatenate([[0], 1 + np.nonzero(np.diff(along // size**2))[0]])
        pixels = np.add.reduceat(~again, starts, dtype=np.intp)
        largest[np.repeat(pixels == size**2, np.diff(starts, append=along.size))] = size
        size *= 2
    return by_curve[np.lexsort((-largest, again))]


def _spread_bits(number: NDArray[np.intp]) -> NDArray[np.int64]:
    """The bits of a number, each followed by a zero."""
    result = np.zeros(number.shape, np.int64)
    for bit in range(BITS):
        result |= (number.astype(np.int64) >> bit & 1) << 2 * bit
    return result


def _every_second_bit(number: NDArray[np.intp]) -> NDArray[np.int64]:
    """The other way round."""
    result = np.zeros(number.shape, np.int64)
    for bit in range(BITS):
        result |= (number.astype(np.int64) >> 2 * bit & 1) << bit
    return result
