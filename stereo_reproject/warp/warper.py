"""From the source's passes to the target's: grid, forward warp, colours, and where nothing landed.

That is the part of the warp stage which a GPU may do as well, see `warp.stage`; this is how numpy does it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..images.passes import DEPTH_PASS, Passes
from ..views.camera import Camera
from .composite import warp_passes
from .discontinuities import TEAR, DepthDiscontinuities, disparity_of, disparity_steps
from .empty import empty_reasons
from .forward import Warp, forward_warp
from .grid import Grid, build_grid
from .motion import Moving


@dataclass(frozen=True)
class WarpedView:
    """The source's passes as the target sees them; empty (H, W) the `Reason` flags of the pixels on which nothing
    landed. steps are the source's, where they were found on the way; by is who has carried: numpy or gpu."""

    passes: Passes
    grid: Grid
    warp: Warp
    empty: NDArray[np.uint16]
    steps: DepthDiscontinuities | None = None
    by: str = "numpy"


class Warper(Protocol):
    """Who carries. source holds the colour (H, W, 4) and depth (H, W, 1) passes, and any other; grid_threshold is in
    arc minutes; both interpolations and motion are as for `composite.warp_passes`."""

    def __call__(
        self,
        source: Passes,
        source_camera: Camera,
        target_camera: Camera,
        *,
        grid_threshold: float = 1.0,
        interpolation: str = "linear",
        colour_interpolation: str | None = None,
        motion: tuple[Moving, Moving] | None = None,
    ) -> WarpedView: ...


def warp_view(
    source: Passes,
    source_camera: Camera,
    target_camera: Camera,
    *,
    grid_threshold: float = 1.0,
    interpolation: str = "linear",
    colour_interpolation: str | None = None,
    motion: tuple[Moving, Moving] | None = None,
) -> WarpedView:
    """As `Warper` has it, in numpy."""
    depth = source[DEPTH_PASS][..., 0]
    grid = build_grid(depth, source_camera, target_camera, threshold=grid_threshold, most=TEAR)
    steps = disparity_steps(disparity_of(depth, source_camera, target_camera))
    warp = forward_warp(
        depth, source_camera, target_camera, grid, cut_right=steps.right > TEAR, cut_down=steps.down > TEAR
    )
    passes = warp_passes(
        source,
        warp,
        source_camera,
        target_camera,
        interpolation=interpolation,
        colour_interpolation=colour_interpolation,
        motion=motion,
    )
    return WarpedView(passes, grid, warp, empty_reasons(warp, source_camera, target_camera), steps)
