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

    rows, columns (N,) are their pixels, row by row. weight (N,) is the number of warped pixels in each probe's tile,
    for all of which it stands. shape is that of the picture, (H, W).
    """

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    weight: NDArray[np.float64]
    spacing: int
    shape: tuple[int, int]

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

    def neighbour_sum(self, values: NDArray, reach: int = 2) -> NDArray[np.float64]:
        """Return for each probe the sum (N,) of values (N,) over the probes within `reach` tiles each way, without its
        own."""
        grid = self.on_grid(values, 0.0)
        return box_sum(grid, (reach, reach))[self.tiles] - values

    def neighbourhood_mean(self, values: NDArray) -> NDArray[np.float64]:
        """Return for each probe the mean (N,) of values (N,) over the probes within 2 tiles each way, its own
        included."""
        count = self.neighbour_sum(np.ones_like(values, np.float64)) + 1.0
        return (self.neighbour_sum(values) + values) / count

    def over_pixels(self, values: NDArray, elsewhere: float) -> NDArray:
        """Return values (N, ...) of the probes spread over all pixels of their tiles, (H, W, ...).

        Pixels of tiles without a probe get `elsewhere`.
        """
        tiles = self.on_grid(values, elsewhere)
        height, width = self.shape
        return np.repeat(np.repeat(tiles, self.spacing, axis=0), self.spacing, axis=1)[:height, :width]

    def pixels_of(self, chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return (H, W) all pixels of the tiles whose probes are set in `chosen` (N,)."""
        return self.over_pixels(chosen, False)


def place_random_probes(
    warped: NDArray[np.bool_], *, spacing: int, seed: int, contrast: Contrast | None = None
) -> Probes:
    """Return one probe for each tile of `spacing` pixels, at a random pixel of `warped` (H, W) in it; none for a tile
    without any. The seed is that of the places.

    With contrast, a share of the chance (even_probe_chance) is spread evenly over the tile, the rest in proportion to
    the contrast's signal, where an error would show; without, all pixels have the same chance.
    """
    rows, columns = np.nonzero(warped)
    tiles = rows // spacing, columns // spacing
    chance = 1.0 / _tile_sums(warped, spacing)[tiles] if rows.size else np.zeros(0)
    if contrast is not None:
        signal = np.where(warped, contrast.signal, 0.0)
        total = _tile_sums(signal, spacing)[tiles]
        uneven = signal[rows, columns] / np.where(total > 0.0, total, 1.0)
        share = TUNING.even_probe_chance
        chance = np.where(total > 0.0, share * chance + (1.0 - share) * uneven, chance)
    # The largest of log(chance) + Gumbel noise falls on each pixel with its chance.
    order = np.argsort(-(np.log(chance) + np.random.default_rng(seed).gumbel(size=chance.size)), kind="stable")
    return _first_of_tiles(warped, order, spacing, chance)


def place_regular_probes(warped: NDArray[np.bool_], *, spacing: int, seed: int) -> Probes:
    """Return one probe for each tile of `spacing` pixels, at nearly the same place in all tiles, drawn by the seed.

    It is the pixel of `warped` (H, W) nearest to that place; a tile without any has no probe. Together the probes are a
    small picture, which can be denoised.
    """
    place = np.random.default_rng(seed).integers(0, spacing, 2)
    rows, columns = np.nonzero(warped)
    apart = (rows % spacing - place[0]) ** 2 + (columns % spacing - place[1]) ** 2
    return _first_of_tiles(warped, np.argsort(apart, kind="stable"), spacing)


def _first_of_tiles(
    warped: NDArray[np.bool_], order: NDArray[np.intp], spacing: int, chance: NDArray | None = None
) -> Probes:
    """Return one probe for each tile of `spacing` pixels: that of its pixels which comes first in `order`.

    order (P,) has the numbers of the P set pixels of `warped` (H, W), counted row by row. A probe stands for one over
    the chance (P,) with which its pixel was drawn; None: for all of its tile's set pixels.
    """
    height, width = warped.shape
    rows, columns = np.nonzero(warped)
    tiles = rows // spacing * -(-width // spacing) + columns // spacing
    _, first, pixels = np.unique(tiles[order], return_index=True, return_counts=True)
    in_order = np.argsort(order[first])
    chosen = order[first][in_order]
    weight = pixels[in_order].astype(np.float64) if chance is None else 1.0 / chance[chosen]
    return Probes(rows[chosen], columns[chosen], weight, spacing, (height, width))


def _tile_sums(image: NDArray, spacing: int) -> NDArray[np.float64]:
    """Return the sum of an image (H, W) over each tile of `spacing` pixels, by rows and columns of tiles, (R, C)."""
    edges = [np.arange(0, size, spacing) for size in image.shape]
    return np.add.reduceat(np.add.reduceat(image.astype(np.float64), edges[0], axis=0), edges[1], axis=1)
