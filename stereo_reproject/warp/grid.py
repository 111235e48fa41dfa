"""The adaptive 3D grid of the paper (section 3.2): where a coarse cell will do, and where every pixel counts.

The grid's vertices are the source's pixel centres, with one more ring outside the frame so that the outermost half
pixels are covered too. A cell spans 16 x 16 quads between vertices.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..views.camera import (
    Camera,
    PerspectiveCamera,
    disparity_per_nearness,
    eye_distance,
    goes_round,
    is_planar,
    target_px_from_source_px,
)
from ..views.parallax import ARC_MINUTE, parallax_difference
from .tuning import TUNING

CELL_QUADS = 16
"""Quads along the side of a cell (paper, section 3.2)."""


@dataclass(frozen=True)
class Grid:
    """The source's grid: which of its cells are drawn quad by quad, and which as one quad.

    subdivided (R, C), by rows and columns of cells, is set for the first kind. width and height are the source's, in
    pixels.
    """

    subdivided: NDArray[np.bool_]
    width: int
    height: int

    @property
    def cells(self) -> int:
        """Number of cells, coarse and subdivided."""
        return self.subdivided.size

    @property
    def triangles(self) -> int:
        """Number of triangles: two for each coarse cell, and two for each quad of a subdivided one."""
        rows = np.minimum(CELL_QUADS, self.height + 1 - CELL_QUADS * np.arange(self.subdivided.shape[0]))
        columns = np.minimum(CELL_QUADS, self.width + 1 - CELL_QUADS * np.arange(self.subdivided.shape[1]))
        quads = np.where(self.subdivided, rows[:, None] * columns[None, :], 1)
        return 2 * int(quads.sum())


def lattice_depth(depth: NDArray, *, wraps: bool = False) -> NDArray:
    """Return the depth at the grid's vertices, (16 R + 1, 16 C + 1) for R x C cells, from the depth (H, W) of the
    pixels.

    Vertex (i, j) stands at pixel position (j - 0.5, i - 0.5), the centre of a pixel. Beyond the picture's border the
    vertices have the depth of the border; beside a picture that wraps, that of its other side.
    """
    height, width = depth.shape
    rows, columns = -(-(height + 1) // CELL_QUADS), -(-(width + 1) // CELL_QUADS)
    whole = np.pad(depth, ((1, rows * CELL_QUADS - height), (0, 0)), mode="edge")
    return np.pad(whole, ((0, 0), (1, columns * CELL_QUADS - width)), mode="wrap" if wraps else "edge")


def build_grid(depth: NDArray, source: Camera, target: Camera, *, threshold: float, most: float = float("inf")) -> Grid:
    """Return the grid for a source's depth (H, W), +inf for the sky; cells are subdivided where one quad would not be
    exact.

    That is where a cell's depths differ by more than `threshold` arc minutes of binocular parallax or by more than
    `most` pixels of disparity, where the perspective of toed-in cameras bends by a share of `most`, and where a cell
    holds NaN. The limit in pixels is for long lenses, with many pixels to an arc minute, and for surfaces nearer than
    the cameras are to each other. The four neighbours of a subdivided cell are subdivided too, so that a coarse edge
    only ever meets a fine one where both are flat (paper: no T-junctions).
    """
    height, width = depth.shape
    near, far = _cell_extremes(depth, wraps=goes_round(source))
    difference = _parallax_range(near, far, source, target)
    with np.errstate(invalid="ignore"):
        steep = ~(difference <= threshold * ARC_MINUTE)
        steep |= _disparity_range(near, far, source, target) > most
        if np.isfinite(most):
            steep |= ~(_bend(far, source, target) <= TUNING.bend_share * most)
    guarded = steep.copy()
    guarded[1:] |= steep[:-1]
    guarded[:-1] |= steep[1:]
    guarded[:, 1:] |= steep[:, :-1]
    guarded[:, :-1] |= steep[:, 1:]
    return Grid(guarded, width, height)


def _parallax_range(near: NDArray, far: NDArray, source: Camera, target: Camera) -> NDArray:
    """Return (R, C) the difference in binocular parallax, in radians, between the depths near and far (R, C) of each
    cell.

    For an orthographic source it is the disparity, as an angle under which a usual lens would show it.
    """
    if isinstance(source, PerspectiveCamera):
        baseline = source.world_from_camera[:3, 3] - target.world_from_camera[:3, 3]
        return parallax_difference(near, far, float(np.linalg.norm(baseline)))
    if not is_planar(source):
        return parallax_difference(near, far, eye_distance(source, target))
    return _disparity_range(near, far, source, target) * TUNING.orthographic_width_radians / source.width


def _disparity_range(near: NDArray, far: NDArray, source: Camera, target: Camera) -> NDArray:
    """Return (R, C) the difference in disparity, in pixels, between the depths near and far (R, C) of each cell."""
    near, far = (source.nearness_from_depth(depth.astype(np.float64)) for depth in (near, far))
    return (near - far) * disparity_per_nearness(source, target)


def _bend(depth: NDArray, source: Camera, target: Camera) -> NDArray:
    """Return (R, C) the pixels by which the perspective bends each cell, were it flat and had this depth (R, C).

    It is the distance in the target between the middle of a cell and the middles of its two diagonals, the larger one.
    """
    i, j = (CELL_QUADS * np.arange(count) - 0.5 for count in depth.shape)

    def goes_to(right: int, down: int) -> NDArray:
        x, y, _ = target_px_from_source_px(source, target, j + right, i[:, None] + down, depth)
        return np.array([x, y])

    middle = goes_to(CELL_QUADS // 2, CELL_QUADS // 2)
    falling = 0.5 * (goes_to(0, 0) + goes_to(CELL_QUADS, CELL_QUADS)) - middle
    rising = 0.5 * (goes_to(CELL_QUADS, 0) + goes_to(0, CELL_QUADS)) - middle
    return np.maximum(np.hypot(*falling), np.hypot(*rising))


def _cell_extremes(depth: NDArray, *, wraps: bool) -> tuple[NDArray, NDArray]:
    """Return (R, C) the least and the greatest depth of each cell's 17 x 17 vertices; NaN where the depth of one is
    unknown. wraps is as for `lattice_depth`."""
    height, width = depth.shape
    cells = [-(-(height + 1) // CELL_QUADS), -(-(width + 1) // CELL_QUADS)]
    result = []
    for extreme in (np.minimum, np.maximum):
        lines = np.empty((cells[0], width), depth.dtype)
        for band in range(cells[0]):
            # Lattice row i is the picture's row i - 1; beyond the border they are repeated.
            extreme.reduce(depth[max(band * CELL_QUADS - 1, 0) : (band + 1) * CELL_QUADS], axis=0, out=lines[band])
        columns = np.pad(lines, ((0, 0), (1, cells[1] * CELL_QUADS - width)), mode="wrap" if wraps else "edge")
        shared = columns[:, CELL_QUADS::CELL_QUADS]
        result.append(extreme(extreme.reduce(columns[:, :-1].reshape(cells[0], -1, CELL_QUADS), axis=2), shared))
    return result[0], result[1]
