"""Materials judged as a whole: what all probes on one say of a tile that shows it, wherever they are.

A polished floor is as wrong at its far end as at the near one, and a small mirror as the other mirrors. But a material
may also be wrong in one place alone, where something is reflected in it, say; so each is believed by as much as its own
probes are foretold better by it than by the probes around them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FEWEST = 4
"""Other probes of a material from which they tell anything."""


@dataclass(frozen=True)
class ShownMaterials:
    """Which materials the tiles (N,) show, as pairs (P,) of a tile and a material in it.

    risk (P,) is that part of the tile's (see `probes.Measured`) which its pixels have that show the material; of_probe
    (N,) is the material at each tile's probe. A material is a number, and what shows through another is one of its own.
    """

    tile: NDArray[np.intp]
    material: NDArray[np.intp]
    risk: NDArray[np.float64]
    of_probe: NDArray[np.intp]

    @classmethod
    def of_pixels(
        cls, tile: NDArray[np.intp], material: NDArray[np.intp], risk: NDArray, of_probe: NDArray[np.intp]
    ) -> ShownMaterials:
        """From the tile, the material and the risk of each of some pixels (M,)."""
        count = int(material.max(initial=0)) + 1
        pairs, place = np.unique(tile * count + material, return_inverse=True)
        summed = np.bincount(place, weights=risk, minlength=pairs.size)
        return cls(pairs // count, pairs % count, summed, of_probe)

    def likely(self, excess: NDArray[np.float64], nearby: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N,): the excess that each tile is likely to have; what its own probe says plays next to no part in it.

        excess (N,) is what each probe found, nearby (N,) what those around each tell of it.
        """
        told = self.excess(excess, nearby)
        risk = self._of_tiles(self.risk)
        # Each tile has the same say, however much is at risk in it.
        scale = 1.0 / np.where(risk > 0.0, risk, np.inf)
        apart, off = scale * (told - nearby), scale * (excess - nearby)
        agreed, size = (np.bincount(self.of_probe, weights=apart * by) for by in (off, apart))
        share = np.clip(agreed / np.where(size > 0.0, size, 1.0), 0.0, 1.0)
        return nearby + share[self.of_probe] * (told - nearby)

    def excess(self, excess: NDArray[np.float64], otherwise: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N,): the excess of each tile, were its materials as wrong for their risk as they are in all other tiles.

        excess (N,) is what each probe found; otherwise (N,) is taken where fewer than FEWEST other probes tell of a
        material, or nothing is at risk.
        """
        count = 1 + max(self.material.max(initial=0), self.of_probe.max(initial=0))
        own = self.material == self.of_probe[self.tile]
        others = np.bincount(self.of_probe, minlength=count)[self.material] - own
        found = np.bincount(self.of_probe, weights=excess, minlength=count)[self.material]
        found = found - np.where(own, excess[self.tile], 0.0)
        elsewhere = np.bincount(self.material, weights=self.risk, minlength=count)[self.material] - self.risk
        known = (others >= FEWEST) & (elsewhere > 0.0)
        risk = self._of_tiles(self.risk)
        by_rest = otherwise[self.tile] * self.risk / risk[self.tile]
        told = np.where(known, found / np.where(known, elsewhere, 1.0) * self.risk, by_rest)
        return np.where(risk > 0.0, self._of_tiles(told), otherwise)

    def _of_tiles(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N,): the sum of values (P,) over each tile's materials."""
        return np.bincount(self.tile, weights=values, minlength=self.of_probe.size)
