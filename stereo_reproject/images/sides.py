"""The sides of a picture of a whole turn: it goes on at its left beyond its right side.

What is computed of a pixel's neighbours is computed of the whole picture as if it ended at its sides, and then once
more of a strip of columns that runs across them, which takes the place of the former beside them. So nothing that looks
at neighbours has to know of turns, and no pass is copied.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

REACH_PIXELS = 16
"""Columns on either side that are replaced, and columns beyond them that are looked at. The farthest look is that of
the contrast and of the blend around refined tiles, 7 pixels; that of a silhouette is up to 9, in steps."""


def mend_sides(
    images: Sequence[NDArray], of_columns: Callable[[NDArray[np.intp]], Sequence[NDArray]], *, wraps: bool
) -> None:
    """Replace what images (H, W, ...) of a whole turn have beside their sides, in place, by what a strip across the
    sides has there.

    The images were computed of the whole picture. of_columns computes the same ones, (H, K, ...), of K columns alone,
    whose indices are given. Nothing is done where wraps is False.
    """
    if not wraps:
        return
    columns = np.arange(-2 * REACH_PIXELS, 2 * REACH_PIXELS) % images[0].shape[1]
    inner = slice(REACH_PIXELS, 3 * REACH_PIXELS)
    for image, strip in zip(images, of_columns(columns), strict=True):
        image[:, columns[inner]] = strip[:, inner]
