"""The forward warp: the source's grid, drawn into the target with a depth test.

The result is not a picture but a map: for each target pixel the source position that it shows and its depth in the
target. Colours, and any other pass, are looked up with it afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..images.bands import bands
from ..images.sides import mend_sides
from ..views.camera import Camera, goes_round
from ..views.panorama import has_lens_edge, is_beyond_lens
from .discontinuities import disparity_of, disparity_steps
from .grid import Grid
from .quads import draw_quads
from .scanline import RowLaw, row_law_of, warp_rows


@dataclass(frozen=True)
class Warp:
    """The map of a warp: for each target pixel, the source and the place in it that show the same point.

    x, y (H, W): position in the source in pixels, NaN where nothing landed. nearness (H, W): the nearness to the
    target's camera of the surface that is seen, -inf where nothing landed. source_index (H, W): the number of the
    source; None where there is one alone.
    """

    x: NDArray[np.float32]
    y: NDArray[np.float32]
    nearness: NDArray[np.float32]
    source_index: NDArray[np.uint8] | None = None

    @property
    def covered(self) -> NDArray[np.bool_]:
        """The target pixels (H, W) on which anything landed."""
        return self.nearness > -np.inf

    @property
    def source(self) -> NDArray[np.uint8]:
        """Number of the source (H, W) that each pixel was looked up in, by the order of the sources; 0 where nothing
        landed.

        Of one source it takes no memory, and cannot be written.
        """
        index = np.uint8(0) if self.source_index is None else self.source_index
        return np.broadcast_to(index, self.nearness.shape)

    def of_columns(self, columns: NDArray[np.intp]) -> Warp:
        """Return the map of some columns of the target, whose indices are given."""
        index = None if self.source_index is None else self.source_index[:, columns]
        return Warp(self.x[:, columns], self.y[:, columns], self.nearness[:, columns], index)


def forward_warp(
    depth: NDArray,
    source: Camera,
    target: Camera,
    grid: Grid,
    *,
    cut_right: NDArray[np.bool_],
    cut_down: NDArray[np.bool_],
) -> Warp:
    """Return the map that comes of drawing the source's grid into the target; the nearest surface wins.

    depth (H, W) is the source's, +inf for the sky, NaN where it is unknown. cut_right (H, W - 1) and cut_down (H - 1,
    W) are set between neighbouring pixels where the surface is torn. Quads across a tear are not drawn, so that what it
    uncovers stays a hole instead of being smeared over (paper, section 3.3).
    """
    torn = torn_quads(cut_right, cut_down, depth)
    if goes_round(source):
        tear_sides(torn, depth, source, target)
    disparity = row_law_of(source, target)
    if disparity is not None:
        return _along_rows(depth, source, target, disparity, grid, torn)
    drawn = Warp(*draw_quads(depth, source, target, grid, torn))
    return with_nothing_beyond_lens(drawn, source, target)


def with_nothing_beyond_lens(drawn: Warp, source: Camera, target: Camera) -> Warp:
    """Return a map in which the pixels of the target that show nothing, beyond the edge of a lens, have the same place
    of the source where that shows nothing either, and no nearness. The arrays are written to."""
    if not (has_lens_edge(source) and has_lens_edge(target)):
        return drawn
    x = np.arange(drawn.x.shape[1], dtype=np.float32) + np.float32(0.5)
    for rows in bands(drawn.x.shape):
        y = np.arange(rows.start, rows.stop, dtype=np.float32)[:, None] + np.float32(0.5)
        nothing = is_beyond_lens(source, x, y) & is_beyond_lens(target, x, y)
        np.copyto(drawn.x[rows], x, where=nothing)
        np.copyto(drawn.y[rows], y, where=nothing)
        np.copyto(drawn.nearness[rows], 0.0, where=nothing)
    return drawn


def _along_rows(
    depth: NDArray, source: Camera, target: Camera, disparity: RowLaw, grid: Grid, torn: NDArray[np.bool_]
) -> Warp:
    """Return the map of a pair whose rows match, drawn row by row; torn (H + 1, W + 1) are the quads that are not
    drawn."""
    x, nearness = warp_rows(depth, source, target.width, disparity, grid, torn)
    y = np.empty_like(x)
    for rows in bands(x.shape):
        y[rows] = np.arange(rows.start + 0.5, rows.stop, dtype=np.float32)[:, None]
        np.copyto(y[rows], np.nan, where=np.isnan(x[rows]))
    return Warp(x, y, nearness)


def sub_pixel_features(
    depth: NDArray, *, cut_right: NDArray[np.bool_], cut_down: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return (H, W) source pixels of features about as thin as a pixel, of which the grid draws next to nothing.

    All quads of such a pixel are torn, or stand alone between two that are: even what is drawn of two pixels side by
    side may fall between two of the target's pixel centres. cut_right and cut_down are as for `forward_warp`; pixels of
    unknown depth are not set.
    """
    torn = torn_quads(cut_right, cut_down, depth)
    padded = np.pad(torn, 1, constant_values=True)
    across, down = padded[1:-1, :-2] & padded[1:-1, 2:], padded[:-2, 1:-1] & padded[2:, 1:-1]
    return _all_four(torn | across | down) & ~np.isnan(depth)


def tear_sides(torn: NDArray[np.bool_], depth: NDArray, source: Camera, target: Camera) -> None:
    """Make the torn quads (H + 1, W + 1) of a picture of a whole turn, in place, those that there are across its sides
    too: both of its outer columns are then the quads between its last and its first pixels.

    depth (H, W) is the source's, as for `forward_warp`.
    """

    def of_columns(columns: NDArray[np.intp]) -> list[NDArray[np.bool_]]:
        strip = depth[:, columns]
        return [torn_quads(*disparity_steps(disparity_of(strip, source, target)).torn(), strip)[:, :-1]]

    mend_sides([torn[:, :-1]], of_columns, wraps=True)
    torn[:, -1] = torn[:, 0]


def _all_four(quads: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return (H, W) the pixels for which all four quads around them, of `quads` (H + 1, W + 1), are set."""
    return quads[:-1, :-1] & quads[:-1, 1:] & quads[1:, :-1] & quads[1:, 1:]


def torn_quads(cut_right: NDArray[np.bool_], cut_down: NDArray[np.bool_], depth: NDArray) -> NDArray[np.bool_]:
    """Return (H + 1, W + 1) the quads between the grid's vertices that have a torn side or a corner of unknown depth
    (NaN).

    cut_right and cut_down are as for `forward_warp`.
    """
    height, width = depth.shape
    unknown = np.pad(np.isnan(depth), 1, mode="edge")
    torn = unknown[:-1, :-1] | unknown[:-1, 1:]
    torn |= unknown[1:, :-1]
    torn |= unknown[1:, 1:]
    # Of its four sides; beyond the border they are those of the pixels there.
    for row, rows in ((slice(1, None), slice(None)), (slice(0, height), slice(None)), (height, -1), (0, 0)):
        torn[row, 1:width] |= cut_right[rows]
    for column, columns in ((slice(1, None), slice(None)), (slice(0, width), slice(None)), (width, -1), (0, 0)):
        torn[1:height, column] |= cut_down[:, columns]
    return torn
