"""The result of a warp: the sources' passes as the target sees them, before anything is traced."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..images.passes import Passes
from ..images.sharpness import Sharpness
from .discontinuities import DepthDiscontinuities
from .forward import Warp
from .grid import Grid


@dataclass(frozen=True)
class WarpedView:
    """The result of a warp: the passes (H, W, C) as the target sees them, and the map by which they were looked up.

    grid is the source's; of several sources, the first one's. warp is the map. empty (H, W): `Reason` flags of the
    target pixels on which nothing landed, or only what was not traced in the source. steps: the source's depth
    discontinuities, where they were found on the way; None of several sources. sharpness: that of the colour, where
    light was looked up with the adaptive interpolation; None of several sources. by: "numpy" or "gpu", which warped it.
    """

    passes: Passes
    grid: Grid
    warp: Warp
    empty: NDArray[np.uint16]
    steps: DepthDiscontinuities | None = None
    sharpness: Sharpness | None = None
    by: str = "numpy"

    def of_columns(self, columns: NDArray[np.intp]) -> WarpedView:
        """Return the view in some columns of the target, whose indices are given, without the source's steps."""
        return replace(
            self,
            passes={name: image[:, columns] for name, image in self.passes.items()},
            warp=self.warp.of_columns(columns),
            empty=self.empty[:, columns],
            steps=None,
            sharpness=None if self.sharpness is None else self.sharpness.of_columns(columns),
        )
