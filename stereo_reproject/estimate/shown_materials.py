"""Materials judged as a whole: what all probes on one say of a tile that shows it, wherever they are.

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

FEWEST = 4
"""Other probes on a material without which it tells nothing."""


@dataclass(frozen=True)
class ShownMaterials:
    """Which materials the tiles (N,) show, as pairs (P,) of a tile and a material in it, and what their probes found.

    risk (P,) is summed over the tile's pixels that show the material (see `probes.TileEvidence`); of_probe (N,) is the
    material at each tile's probe, and found (N,) the excess that it found, summed over its tile. Materials are numbers
    from 0; what they stand for does not matter here.
    """

    tile: NDArray[np.intp]
    material: NDArray[np.intp]
    risk: NDArray[np.float64]
    of_probe: NDArray[np.intp]
    found: NDArray[np.float64]

    def likely(self, nearby: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(N,): the excess that each tile is likely to have, its own probe left out; and what of its standard error the
        materials bring in.

        nearby (N,) is what the probes around each tell of it.
        """
        told, error = self._told_by_materials(nearby)
        apart = told - self._part_of(nearby)
        share = self._belief(self._of_tiles(apart), self.found - nearby)
        likely = nearby + self._of_tiles(share * apart)
        return likely, np.sqrt(self._of_tiles((share * error) ** 2))

    def _told_by_materials(self, nearby: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(P,): the excess of each pair, were the material as wrong for its risk as it is in all other tiles, and the
        standard error of that.

        Its part of nearby (N,), and 0, where fewer than FEWEST other probes tell, or more is at risk here than there.
        """
        others = self._by_material(np.ones_like(self.found)) - self._own
        elsewhere = np.bincount(self.material, weights=self.risk, minlength=self._count)[self.material] - self.risk
        # What little is at risk elsewhere must not be scaled up to much.
        known = (others >= FEWEST) & (elsewhere >= self.risk)
        per_risk = np.where(known, self.risk / np.where(known, elsewhere, 1.0), 0.0)
        found = self._by_material(self.found) - self._own * self.found[self.tile]
        squares = self._by_material(self.found**2) - self._own * self.found[self.tile] ** 2
        told = np.where(known, found * per_risk, self._part_of(nearby))
        return told, np.sqrt(np.maximum(squares, 0.0)) * per_risk

    def _belief(self, told: NDArray[np.float64], found: NDArray[np.float64]) -> NDArray[np.float64]:
        """(P,) share of what each material tells that is believed: the least-squares slope of found on told (N,), both
        from what those nearby tell, over the other tiles that have their probe on it."""
        mean_risk = np.bincount(self.of_probe, weights=self._tile_risk, minlength=self._count)
        mean_risk = mean_risk / np.maximum(np.bincount(self.of_probe, minlength=self._count), 1)
        # Per risk, so that bright tiles do not decide alone; but flat ones, where hardly anything is, not at all.
        scale = np.maximum(self._tile_risk, mean_risk[self.of_probe])
        scale = np.where(scale > 0.0, 1.0 / np.where(scale > 0.0, scale, 1.0), 0.0)
        products, squares = scale**2 * told * found, (scale * told) ** 2
        products = self._by_material(products) - self._own * products[self.tile]
        squares = self._by_material(squares) - self._own * squares[self.tile]
        return np.where(squares > 0.0, np.clip(products / np.where(squares > 0.0, squares, 1.0), 0.0, 1.0), 0.0)

    @cached_property
    def _count(self) -> int:
        return 1 + int(max(self.material.max(initial=0), self.of_probe.max(initial=0)))

    @cached_property
    def _own(self) -> NDArray[np.bool_]:
        """(P,): whether the tile's own probe is on the material."""
        return self.material == self.of_probe[self.tile]

    @cached_property
    def _tile_risk(self) -> NDArray[np.float64]:
        """(N,): the risk of each tile."""
        return self._of_tiles(self.risk)

    def _by_material(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(P,): the sum of values (N,) over all tiles that have their probe on the material."""
        # Of nothing, bincount makes integers.
        return np.bincount(self.of_probe, weights=values, minlength=self._count)[self.material].astype(np.float64)

    def _of_tiles(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N,): the sum of values (P,) over each tile's materials."""
        return np.bincount(self.tile, weights=values, minlength=self.of_probe.size).astype(np.float64)

    def _part_of(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(P,): what of values (N,) is on each of the tile's materials, by their risk."""
        return values[self.tile] * self.risk / self._tile_risk[self.tile]


def materials_by_tile(
    rows: Iterable[tuple[NDArray[np.intp], NDArray[np.intp], NDArray]],
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """Pairs (P,) of a tile and a material in it: both, and their risk, which is above 0.

    rows hold the tile, the material and the risk of pixels (M,), a row of tiles after the other.
    """
    pairs = []
    for tile, material, risk in rows:
        if not tile.size:
            continue
        first = int(tile.min())
        # A row shows few of the picture's materials.
        kinds = np.flatnonzero(np.bincount(material))
        number = np.zeros(int(kinds[-1]) + 1, np.intp)
        number[kinds] = np.arange(kinds.size)
        summed = np.bincount((tile - first) * kinds.size + number[material], weights=risk)
        codes = np.flatnonzero(summed)
        pairs.append((first + codes // kinds.size, kinds[codes % kinds.size], summed[codes]))
    if not pairs:
        return np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0)
    tile, material, risk = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    return tile, material, risk
