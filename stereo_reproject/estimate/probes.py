"""Probes: a sparse set of pixels of the target that are traced twice, and the tiles around them.

There is one probe in each square tile that has a warped pixel. `evidence` has the formulas by which they are read.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..images.contrast import Contrast, box_sum
from ..views.solid_angle import PixelWeight
from .tuning import TUNING


@dataclass(frozen=True)
class Probes:
    """Places of the probes, one in each tile of `spacing` x `spacing` pixels that has a warped pixel.

    rows, columns (N,) are their pixels, row by row. weight (N,) is the summed weight of the warped pixels in each
    probe's tile, for all of which it stands: their number, where all pixels count alike. shape is that of the picture,
    (H, W). of_pixels is the weight of its pixels (`views.solid_angle`). wraps: True where the picture goes on at its
    left beyond its right side, and so do the neighbours of tiles.
    """

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    weight: NDArray[np.float64]
    spacing: int
    shape: tuple[int, int]
    of_pixels: PixelWeight = 1.0
    wraps: bool = False

    @property
    def frame_weight(self) -> float:
        """Summed weight of all pixels of the picture."""
        return float(np.sum(np.broadcast_to(self.of_pixels, self.shape), dtype=np.float64))

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Mask (H, W) of the pixels that are probes."""
        result = np.zeros(self.shape, bool)
        result[self.rows, self.columns] = True
        return result

    @property
    def tiles(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Row and column (N,) of each probe's tile, counted in tiles."""
        return self.rows // self.spacing, self.columns // self.spacing

    @property
    def tile_grid(self) -> tuple[int, int]:
        """Number of rows and of columns of tiles in the picture; tiles at the right and bottom may be smaller."""
        height, width = self.shape
        return -(-height // self.spacing), -(-width // self.spacing)

    def tile_sum(self, image: NDArray) -> NDArray[np.float64]:
        """Return the sum (N,) of an image (H, W) over each probe's tile."""
        return _tile_sums(image, self.spacing)[self.tiles]

    def weighted_sum(self, image: NDArray) -> NDArray[np.float64]:
        """Return the sum (N,) of an image (H, W) over each probe's tile, with each pixel's weight."""
        return _tile_sums(image, self.spacing, self.of_pixels)[self.tiles]

    def tile_mean(self, image: NDArray, pixels: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return the mean (N,) of an image (H, W) over those pixels of each probe's tile that are set in `pixels` (H,
        W).

        It is 0 where none is set.
        """
        return self.tile_sum(np.where(pixels, image, 0.0)) / np.maximum(self.tile_sum(pixels), 1.0)

    def on_grid(self, values: NDArray, elsewhere: float) -> NDArray:
        """Return values (N, ...) of the probes, laid out by rows and columns of tiles, (R, C, ...); `elsewhere` is put
        in tiles without a probe."""
        grid = np.full((*self.tile_grid, *values.shape[1:]), elsewhere, values.dtype)
        grid[self.tiles] = values
        return grid

    def neighbour_sum(self, values: NDArray, reach: int = 2, *, elsewhere: float = 0.0) -> NDArray[np.float64]:
        """Return for each probe the sum (N,) of values (N,) over the probes within `reach` tiles each way, without its
        own; a tile of the picture without a probe counts as `elsewhere`."""
        grid = self.with_sides(self.on_grid(values, elsewhere), reach)
        rows, columns = self.tiles
        return box_sum(grid, (reach, reach))[rows, columns + self.side_tiles(reach)] - values

    def side_tiles(self, reach: int) -> int:
        """Return how many columns of tiles within `reach` columns of the picture's side stand beyond it, at its other
        side; 0 where the picture ends there. No tile is within reach of both sides of another one."""
        return min(reach, (self.tile_grid[1] - 1) // 2) if self.wraps else 0

    def with_sides(self, grid: NDArray, reach: int) -> NDArray:
        """Return a grid of tiles (R, C, ...) with the columns that stand beyond either side, (R, C + 2 side_tiles,
        ...)."""
        beyond = self.side_tiles(reach)
        return np.pad(grid, ((0, 0), (beyond, beyond), *((0, 0),) * (grid.ndim - 2)), mode="wrap") if beyond else grid

    def neighbourhood_mean(self, values: NDArray) -> NDArray[np.float64]:
        """Return for each probe the mean (N,) of values (N,) over the probes within 2 tiles each way, its own
        included."""
        count = self.neighbour_sum(np.ones_like(values, np.float64)) + 1.0
        return (self.neighbour_sum(values) + values) / count

    def over_pixels(self, values: NDArray, elsewhere: float) -> NDArray:
        """Return values (N, ...) of the probes spread over all pixels of their tiles, (H, W, ...).

        Pixels of tiles without a probe get `elsewhere`.
        """
        return _over_tiles(self.on_grid(values, elsewhere), self.spacing, self.shape)

    def pixels_of(self, chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return (H, W) all pixels of the tiles whose probes are set in `chosen` (N,)."""
        return self.over_pixels(chosen, False)


def place_random_probes(
    warped: NDArray[np.bool_],
    *,
    spacing: int,
    seed: int,
    contrast: Contrast | None = None,
    weight: PixelWeight = 1.0,
    wraps: bool = False,
) -> Probes:
    """Return one probe for each tile of `spacing` pixels, at a random pixel of `warped` (H, W) in it; none for a tile
    without any. The seed is that of the places, weight that of the picture's pixels; wraps is as in `Probes`.

    With contrast, a share of the chance (even_probe_chance) is spread evenly over the tile, the rest in proportion to
    the contrast's signal and the pixels' weight, where an error would show; without, all pixels have the same chance.
    """
    even = 1.0 / np.maximum(_tile_sums(warped, spacing), 1.0)
    signal = None if contrast is None else np.where(warped, contrast.signal, np.float32(0.0))
    if signal is not None:
        signal *= weight
    total = None if signal is None else _tile_sums(signal, spacing)
    random = np.random.default_rng(seed)

    def chance(rows: NDArray[np.intp], columns: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the chance of pixels in these rows and columns, which are broadcast, to be their tile's probe."""
        tile = rows // spacing, columns // spacing
        if signal is None or total is None:
            return even[tile]
        in_tile, share = total[tile], TUNING.even_probe_chance
        uneven = signal[rows, columns] / np.where(in_tile > 0.0, in_tile, 1.0)
        return np.where(in_tile > 0.0, share * even[tile] + (1.0 - share) * uneven, even[tile])

    def rank(rows: slice) -> NDArray[np.float64]:
        # The largest of log(chance) + Gumbel noise falls on each pixel with its chance.
        result, known = np.full(warped[rows].shape, -np.inf), warped[rows]
        here, columns = np.nonzero(known)
        result[known] = np.log(chance(here + rows.start, columns)) + random.gumbel(size=here.size)
        return result

    rows, columns = _first_of_tiles(warped, rank, spacing)
    # A probe stands for one over the chance with which its pixel was drawn.
    stands_for = np.broadcast_to(weight, warped.shape)[rows, columns] / chance(rows, columns)
    return Probes(rows, columns, stands_for, spacing, (warped.shape[0], warped.shape[1]), weight, wraps)


def _first_of_tiles(
    warped: NDArray[np.bool_],
    rank: Callable[[slice], NDArray[np.float64]],
    spacing: int,
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return rows and columns (N,) of one probe for each tile of `spacing` pixels: that of its pixels which has the
    highest rank, of several the first row by row.

    rank gives the ranks (h, W) of a slice of rows, and is asked for each row of tiles once, from top to bottom. Pixels
    not set in `warped` (H, W) have -inf.
    """
    height, width = warped.shape
    across = -(-width // spacing)
    places = []
    for top in range(0, height, spacing):
        best = np.full((spacing, across * spacing), -np.inf)
        band = slice(top, min(top + spacing, height))
        best[: band.stop - top, :width] = rank(band)
        by_tile = best.reshape(spacing, across, spacing).transpose(1, 0, 2).reshape(across, -1)
        within = by_tile.argmax(axis=1)
        tiles = np.flatnonzero(np.isfinite(by_tile[np.arange(across), within]))
        down, right = np.divmod(within[tiles], spacing)
        places.append((top + down, tiles * spacing + right))
    rows, columns = (np.concatenate(parts) for parts in zip(*places, strict=True))
    in_order = np.lexsort((columns, rows))
    return rows[in_order], columns[in_order]


def _over_tiles(values: NDArray, spacing: int, shape: tuple[int, int]) -> NDArray:
    """Return values (R, C, ...) of tiles of `spacing` pixels, spread over all pixels of a picture of this shape (H,
    W)."""
    height, width = shape
    return np.repeat(np.repeat(values, spacing, axis=0), spacing, axis=1)[:height, :width]


def _tile_sums(image: NDArray, spacing: int, weight: PixelWeight = 1.0) -> NDArray[np.float64]:
    """Return the sum of an image (H, W), each pixel times its weight, over each tile of `spacing` pixels, by rows and
    columns of tiles, (R, C)."""
    edges, factor = [np.arange(0, size, spacing) for size in image.shape], np.broadcast_to(weight, image.shape)
    rows_of_tiles = (image[top : top + spacing] * factor[top : top + spacing].astype(np.float64) for top in edges[0])
    down = np.concatenate([np.add.reduceat(rows, [0], axis=0) for rows in rows_of_tiles])
    return np.add.reduceat(down, edges[1], axis=1)
