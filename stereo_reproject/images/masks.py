"""Masks of pixels: counted in a neighbourhood, widened, and boxed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def count_within(mask: NDArray[np.bool_], radius: int) -> NDArray[np.uint8]:
    """Return the number (H, W) of set pixels in the square that reaches `radius` pixels each way around each pixel.

    radius is at most 7: the count of a larger square would not fit 8 bits.
    """
    height, width = mask.shape
    counts = np.pad(mask.view(np.uint8), radius)
    down = sum((counts[shift : shift + height] for shift in range(1, 2 * radius + 1)), start=counts[:height].copy())
    return sum((down[:, shift : shift + width] for shift in range(1, 2 * radius + 1)), start=down[:, :width].copy())


def opened(mask: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """Return those pixels of a mask (H, W) that lie in a square of set pixels that reaches `reach` pixels each way from
    its middle. Pixels beyond the border count as set."""
    outside = dilate(~np.pad(mask, reach, constant_values=True), reach)
    return dilate(~outside, reach)[reach:-reach, reach:-reach]


def dilate(
    mask: NDArray[np.bool_], radius: int, *, axes: tuple[int, ...] = (0, 1), wraps: bool = False
) -> NDArray[np.bool_]:
    """Return the mask (H, W) widened by `radius` pixels each way along the given axes (0 is down, 1 across).

    Along both it grows by a square, which is the shape that a pixel filter reaches. One that wraps grows beyond its
    right side at its left, and the other way round.
    """
    if wraps:
        around = np.pad(mask, ((0, 0), (radius, radius)), mode="wrap")
        return dilate(around, radius, axes=axes)[:, radius : radius + mask.shape[1]]
    result = mask
    for axis in axes:
        grown = result.copy()
        for shift in range(1, radius + 1):
            ahead = [slice(None), slice(None)]
            behind = [slice(None), slice(None)]
            ahead[axis], behind[axis] = slice(shift, None), slice(None, -shift)
            grown[tuple(ahead)] |= result[tuple(behind)]
            grown[tuple(behind)] |= result[tuple(ahead)]
        result = grown
    return result


def box_around(mask: NDArray[np.bool_], margin: int) -> tuple[slice, slice]:
    """Return the rows and the columns of the smallest box that holds all set pixels of a mask (H, W) and `margin`
    pixels more each way, as far as the picture reaches. The box of a mask without any is empty."""
    box: list[slice] = []
    for axis, size in enumerate(mask.shape):
        set_there = np.flatnonzero(mask.any(axis=1 - axis))
        box.append(
            slice(max(set_there[0] - margin, 0), min(set_there[-1] + margin + 1, size)) if set_there.size else slice(0)
        )
    return box[0], box[1]
