"""Materials judged as a whole: all probes on a material, wherever they are, tell of each tile that shows it.

A polished floor is as wrong at its far end as at the near one, and a small mirror as the other mirrors. But a material
may also be wrong in one place alone, where something is reflected in it, say; so each is believed by as much as its own
probes are foretold better by it than by the probes around them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class ShownMaterials:
    """Materials that the N tiles show, as P pairs of a tile and a material, and the excess that probes found on them.

    tile and material (P,) are the pairs; contrast (P,) is summed over the tile's pixels that show the material (see
    `evidence.TileEvidence`). of_probe (N,) is the material at each tile's probe, and found (N,) the excess that the
    probe found, for the whole tile. Materials are numbers from 0; which they are does not matter here.
    """

    tile: NDArray[np.intp]
    material: NDArray[np.intp]
    contrast: NDArray[np.float64]
    of_probe: NDArray[np.intp]
    found: NDArray[np.float64]

    def expected(self, nearby: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the expected excess (N,) of each tile, summed over its pixels, and the standard error that its
        materials bring in.

        nearby (N,) is the excess by the probes around each. To this is added as much as is believed of what its
        materials tell beyond it; the tile's own probe is left out.
        """
        told, error = self._by_materials(nearby)
        apart = told - self._part_of(nearby)
        share = self._belief(self._of_tiles(apart), self.found - nearby)
        likely = nearby + self._of_tiles(share * apart)
        return likely, np.sqrt(self._of_tiles((share * error) ** 2))

    def _by_materials(self, nearby: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the excess (P,) that each pair of tile and material would have by that material in all other tiles,
        and its error.

        It is found there for some contrast, and scaled to the pair's own. Where no other probe tells, or there is more
        contrast here than there, it is the pair's part of nearby (N,), with an error of 0.
        """
        others = self._by_material(np.ones_like(self.found)) - self._own
        elsewhere = (
            np.bincount(self.material, weights=self.contrast, minlength=self._count)[self.material] - self.contrast
        )
        # Little contrast elsewhere must not be scaled up to much.
        known = (others > 0.0) & (elsewhere >= self.contrast)
        per_contrast = np.where(known, self.contrast / np.where(known, elsewhere, 1.0), 0.0)
        found = self._by_material(self.found) - self._own * self.found[self.tile]
        squares = self._by_material(self.found**2) - self._own * self.found[self.tile] ** 2
        told = np.where(known, found * per_contrast, self._part_of(nearby))
        return told, np.sqrt(np.maximum(squares, 0.0)) * per_contrast

    def _belief(self, told: NDArray[np.float64], found: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the share (P,), 0 to 1, of its material's evidence that is believed for each pair of tile and
        material.

        It is the least-squares slope of found (N,), the probes' own excess, on told (N,), the excess that materials
        tell. Both are less what the probes nearby tell, and it is fitted over the other tiles that have their probe on
        the material.
        """
        mean_contrast = np.bincount(self.of_probe, weights=self._tile_contrast, minlength=self._count)
        mean_contrast = mean_contrast / np.maximum(np.bincount(self.of_probe, minlength=self._count), 1)
        # Per contrast, so that bright tiles do not decide alone; but flat ones, where hardly anything is, not at all.
        scale = np.maximum(self._tile_contrast, mean_contrast[self.of_probe])
        scale = np.where(scale > 0.0, 1.0 / np.where(scale > 0.0, scale, 1.0), 0.0)
        products, squares = scale**2 * told * found, (scale * told) ** 2
        products = self._by_material(products) - self._own * products[self.tile]
        squares = self._by_material(squares) - self._own * squares[self.tile]
        return np.where(squares > 0.0, np.clip(products / np.where(squares > 0.0, squares, 1.0), 0.0, 1.0), 0.0)

    @cached_property
    def _count(self) -> int:
        """Number of materials: one more than the greatest number of any."""
        return 1 + int(max(self.material.max(initial=0), self.of_probe.max(initial=0)))

    @cached_property
    def _own(self) -> NDArray[np.bool_]:
        """The pairs (P,) whose tile has its own probe on the pair's material."""
        return self.material == self.of_probe[self.tile]

    @cached_property
    def _tile_contrast(self) -> NDArray[np.float64]:
        """Contrast (N,) of each tile, summed over its materials."""
        return self._of_tiles(self.contrast)

    def _by_material(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return for each pair the sum (P,) of values (N,) over all tiles that have their probe on the pair's
        material."""
        # Of nothing, bincount makes integers.
        return np.bincount(self.of_probe, weights=values, minlength=self._count)[self.material].astype(np.float64)

    def _of_tiles(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return for each tile the sum (N,) of values (P,) over its pairs, one for each material that it shows."""
        return np.bincount(self.tile, weights=values, minlength=self.of_probe.size).astype(np.float64)

    def _part_of(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return for each pair the part (P,) of its tile's value (N,) that falls on its material, in proportion to
        contrast."""
        return values[self.tile] * self.contrast / self._tile_contrast[self.tile]


def materials_by_tile(
    rows: Iterable[tuple[NDArray[np.intp], NDArray[np.intp], NDArray]],
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """Return all pairs (P,) of a tile and a material that it shows: tiles, materials, and the contrast, above 0, of
    each pair.

    rows have, for one row of tiles after the other, the tile, the material and the contrast of M pixels, (M,) each.
    """
    pairs = []
    for tile, material, contrast in rows:
        if not tile.size:
            continue
        first = int(tile.min())
        # A row shows few of the picture's materials.
        kinds = np.flatnonzero(np.bincount(material))
        number = np.zeros(int(kinds[-1]) + 1, np.intp)
        number[kinds] = np.arange(kinds.size)
        summed = np.bincount((tile - first) * kinds.size + number[material], weights=contrast)
        codes = np.flatnonzero(summed)
        pairs.append((first + codes // kinds.size, kinds[codes % kinds.size], summed[codes]))
    if not pairs:
        return np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0)
    tile, material, contrast = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    return tile, material, contrast
