"""The source's passes carried into the target: grid, tears, forward warp, lookups, and what stays empty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .camera import Camera, disparity_per_nearness
from .composite import warp_passes
from .grid import Grid, build_grid
from .holes import TEAR, disparity_steps, empty_reasons
from .motion import Moving
from .passes import DEPTH_PASS, OF_SOURCE, Passes
from .warp import Warp, forward_warp


@dataclass(frozen=True)
class Carried:
    """What a warp leaves: passes (H, W, C) as the target sees them, and empty (H, W), the flags of what nothing landed
    on."""

    passes: Passes
    grid: Grid
    warp: Warp
    empty: NDArray[np.uint16]


def carry(
    source: Passes,
    source_camera: Camera,
    target_camera: Camera,
    *,
    grid_threshold: float = 1.0,
    interpolation: str = "linear",
    colour_interpolation: str | None = None,
    motion: tuple[Moving, Moving] | None = None,
) -> Carried:
    """Carry the passes (H, W, C), the depth among them, into the target; the options are `reproject`'s."""
    depth = source[DEPTH_PASS][..., 0]
    grid = build_grid(depth, source_camera, target_camera, threshold=grid_threshold)
    nearness = source_camera.nearness_from_depth(depth.astype(np.float64))
    steps = disparity_steps((nearness * disparity_per_nearness(source_camera, target_camera)).astype(np.float32))
    tears = {"cut_right": steps.right > TEAR, "cut_down": steps.down > TEAR}
    warp = forward_warp(depth, source_camera, target_camera, grid, **tears)
    passes = warp_passes(
        {name: image for name, image in source.items() if name not in OF_SOURCE},
        warp,
        source_camera,
        target_camera,
        interpolation=interpolation,
        colour_interpolation=colour_interpolation,
        motion=motion,
    )
    return Carried(passes, grid, warp, empty_reasons(warp, source_camera, target_camera))
