"""Probes: a sparse set of pixels of the target that are traced twice, and the tiles around them.

There is one probe in each square tile that has a warped pixel. `evidence` has the formulas by which they are read.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..images.contrast import Contrast, box_sum
from .tuning import TUNING


@dataclass(frozen=True)
class Probes:
    """Places of the probes, one in each tile of `spacing` x `spacing` pixels that has a warped pixel.

    rows, columns (N,) are in the order in which a mask of the probes names them; weight (N,) is the number of warped
    pixels of its tile that each stands for, on average over the places it may have: one over its chance. shape is that
    of the picture, (H, W).
    """

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    weight: NDArray[np.float64]
    spacing: int
    shape: tuple[int, int]

    @property
    def mask(self) -> NDArray[np.bool_]:
        """(H, W) set at the probes."""
        result = np.zeros(self.shape, bool)
        result[self.rows, self.columns] = True
        return result

    @property
    def tiles(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Row and column (N,) of each probe's tile, in tiles."""
        return self.rows // self.spacing, self.columns // self.spacing

    @property
    def tile_grid(self) -> tuple[int, int]:
        """Number of rows and of columns of tiles."""
        height, width = self.shape
        return -(-height // self.spacing), -(-width // self.spacing)

    def tile_sum(self, image: NDArray) -> NDArray[np.float64]:
        """Return the sum (N,) of an image (H, W) over each probe's tile."""
        return _tile_sums(image, self.spacing)[self.tiles]

    def tile_mean(self, image: NDArray, pixels: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return the mean (N,) of an image (H, W) over the pixels (H, W) that are set in each probe's tile; 0 where
        none is."""
        return self.tile_sum(np.where(pixels, image, 0.0)) / np.maximum(self.tile_sum(pixels), 1.0)

    def on_grid(self, values: NDArray, elsewhere: float) -> NDArray:
        """Return values (N, ...) as rows and columns of tiles, with `elsewhere` in tiles without a probe."""
        grid = np.full((*self.tile_grid, *values.shape[1:]), elsewhere, values.dtype)
        grid[self.tiles] = values
        return grid

    def neighbour_sum(self, values: NDArray, reach: int = 2) -> NDArray[np.float64]:
        """Return the sum (N,) of values (N,) over the tiles within `reach` of each, without its own."""
        grid = self.on_grid(values, 0.0)
        return box_sum(grid, (reach, reach))[self.tiles] - values

    def neighbourhood_mean(self, values: NDArray) -> NDArray[np.float64]:
        """Return the mean (N,) of values (N,) over the tiles within 2 of each that have a probe, its own included."""
        count = self.neighbour_sum(np.ones_like(values, np.float64)) + 1.0
        return (self.neighbour_sum(values) + values) / count

    def over_pixels(self, values: NDArray, elsewhere: float) -> NDArray:
        """Return values (N, ...) spread over the pixels of each probe's tile, (H, W, ...), with `elsewhere` in tiles
        without a probe."""
        tiles = self.on_grid(values, elsewhere)
        height, width = self.shape
        return np.repeat(np.repeat(tiles, self.spacing, axis=0), self.spacing, axis=1)[:height, :width]

    def pixels_of(self, chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return the pixels (H, W) of the tiles whose probes are set in `chosen` (N,)."""
        return self.over_pixels(chosen, False)


def place_random_probes(warped: NDArray[np.bool_], contrast: Contrast, *, spacing: int, seed: int) -> Probes:
    """Place one probe in each tile of `spacing` pixels, at a random pixel of `warped` (H, W).

    Half of the chance is spread evenly over the tile, half over the picture's contrast, where an error would show.
    """
    rng = np.random.default_rng(seed)
    rows, columns = np.nonzero(warped)
    tiles = rows // spacing, columns // spacing
    signal = np.where(warped, contrast.signal, 0.0)
    even = 1.0 / _tile_sums(warped, spacing)[tiles] if rows.size else np.zeros(0)
    total = _tile_sums(signal, spacing)[tiles]
    uneven = signal[rows, columns] / np.where(total > 0.0, total, 1.0)
    share = TUNING.even_probe_chance
    chance = np.where(total > 0.0, share * even + (1.0 - share) * uneven, even)
    # The largest of log(chance) + Gumbel noise falls on each pixel with its chance.
    order = np.argsort(-(np.log(chance) + rng.gumbel(size=chance.size)), kind="stable")
    names = tiles[0] * -(-warped.shape[1] // spacing) + tiles[1]
    _, first = np.unique(names[order], return_index=True)
    chosen = np.sort(order[first])
    return Probes(rows[chosen], columns[chosen], 1.0 / chance[chosen], spacing, (warped.shape[0], warped.shape[1]))


def place_regular_probes(warped: NDArray[np.bool_], *, spacing: int, seed: int) -> Probes:
    """Place one probe in each tile of `spacing` pixels, at the pixel of `warped` (H, W) nearest to one place that is
    the same in all tiles and drawn by the seed: together they are a small picture, which can be denoised."""
    height, width = warped.shape
    place = np.random.default_rng(seed).integers(0, spacing, 2)
    rows, columns = np.nonzero(warped)
    apart = (rows % spacing - place[0]) ** 2 + (columns % spacing - place[1]) ** 2
    names = rows // spacing * -(-width // spacing) + columns // spacing
    order = np.lexsort((apart, names))
    _, first, pixels = np.unique(names[order], return_index=True, return_counts=True)
    chosen = order[first]
    in_order = np.argsort(chosen)
    chosen = chosen[in_order]
    return Probes(rows[chosen], columns[chosen], pixels[in_order].astype(np.float64), spacing, (height, width))


def _tile_sums(image: NDArray, spacing: int) -> NDArray[np.float64]:
    """Return the sum of an image (H, W) over each tile, as rows and columns of tiles."""
    edges = [np.arange(0, size, spacing) for size in image.shape]
    return np.add.reduceat(np.add.reduceat(image.astype(np.float64), edges[0], axis=0), edges[1], axis=1)
