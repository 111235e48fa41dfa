"""Quilts: all views of a light-field display in one picture, as a grid.

View 0, the leftmost camera, is at the bottom left; the views go right, and then up. A player reads the grid and the
aspect in the file's name, which ends in qsCOLUMNSxROWSaASPECT. Source: Looking Glass Factory's documentation, "Quilts".
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    # The command line, which names quilts too, starts without numpy.
    from numpy.typing import NDArray

QUILT_FILE = re.compile(r"quilt_qs\d+x\d+a[\d.]+\.(png|exr)")
"""Names that `quilt_name` and an extension make."""

ASPECT_DECIMALS = 4
"""Decimals of the aspect in a name: 16:9 is 1.7778."""

MAX_WIDER = 2
"""Greatest number of columns of a chosen grid for each of its rows."""


@dataclass(frozen=True)
class Quilt:
    """The grid of a quilt: its columns and rows, the width over the height of what a view shows, and the width and
    height of a view in pixels."""

    columns: int
    rows: int
    aspect: float
    view_size: tuple[int, int]

    @property
    def tag(self) -> str:
        """The end of the name of the quilt's file, as players read it, such as "qs8x6a0.75"."""
        return quilt_tag(self.columns, self.rows, self.aspect)

    @property
    def movie_view_size(self) -> tuple[int, int]:
        """The width and height of a view in a movie of quilts, whose sides encoders want even: a view has a pixel less
        along a side by which the quilt would be odd."""
        width, height = self.view_size
        return width - width * self.columns % 2, height - height * self.rows % 2

    @property
    def movie_size(self) -> tuple[int, int]:
        """The width and height of a movie of quilts in pixels."""
        width, height = self.movie_view_size
        return width * self.columns, height * self.rows


def quilt_tag(columns: int, rows: int, aspect: float) -> str:
    """Return how the names of a quilt's files end, such as "qs8x6a0.75". aspect is the width over the height of what a
    view shows."""
    return f"qs{columns}x{rows}a{f'{aspect:.{ASPECT_DECIMALS}f}'.rstrip('0').rstrip('.')}"


def quilt_name(columns: int, rows: int, aspect: float) -> str:
    """Return the name of a quilt's file without its extension, such as "quilt_qs8x6a0.75"; the parameters are those of
    `quilt_tag`."""
    return f"quilt_{quilt_tag(columns, rows, aspect)}"


def with_smaller_views(picture: NDArray[Any], quilt: Quilt) -> NDArray[Any]:
    """Return the picture (rows * H, columns * W, C) of a quilt with views of `Quilt.movie_view_size`: without the last
    column of pixels of each view, or its last row, where the quilt's side is odd. All views lose the same, so that
    nothing moves from one to the next."""
    (width, height), (movie_width, movie_height) = quilt.view_size, quilt.movie_view_size
    tiles = picture.reshape(quilt.rows, height, quilt.columns, width, -1)[:, :movie_height, :, :movie_width]
    return tiles.reshape(quilt.rows * movie_height, quilt.columns * movie_width, -1)


def grid_for(count: int) -> tuple[int, int]:
    """Return the columns and rows of a grid for so many views: at least as many columns as rows and at most twice as
    many, with the fewest empty places, and of such grids the one that is nearest to a square. 48 views have 8 x 6."""
    grids = (
        (columns, rows)
        for rows in range(1, count + 1)
        for columns in (max(rows, -(-count // rows)),)
        if columns <= MAX_WIDER * rows
    )
    return min(grids, key=lambda grid: (grid[0] * grid[1], grid[0]))


BAND_PIXELS = 1 << 20
"""Pixels of a quilt that are put together at once: 16 MB in single precision."""


def quilt_bands(pictures: Sequence[NDArray[Any]], columns: int, rows: int) -> Iterator[NDArray[Any]]:
    """Yield a quilt from its top to its bottom in bands (h, columns * W, C), each of one row of views or a part of it.

    pictures are the views (H, W, C), all of one size, at most columns * rows of them; only those of one row are asked
    for at a time, so that a sequence may read them from files. Places without a view are 0, in alpha too.
    """
    import numpy as np

    empty = np.zeros_like(pictures[0])
    for row in reversed(range(rows)):
        places = range(row * columns, (row + 1) * columns)
        in_row = [pictures[k] if k < len(pictures) else empty for k in places]
        step = max(BAND_PIXELS // (columns * empty.shape[1]), 1)
        for top in range(0, empty.shape[0], step):
            yield np.concatenate([picture[top : top + step] for picture in in_row], axis=1)
        # Before the next row is asked for.
        del in_row


def assemble_quilt(pictures: Sequence[NDArray[Any]], columns: int, rows: int) -> NDArray[Any]:
    """Return the quilt (rows * H, columns * W, C) of views (H, W, C), as `quilt_bands` has it."""
    import numpy as np

    return np.concatenate(list(quilt_bands(pictures, columns, rows)))
