"""The warp stage as a whole: steps in depth, grid, forward warp, and which pixels it leaves to be traced."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .accuracy import Accuracy
from .camera import Camera, disparity_per_nearness
from .grid import Grid, build_grid
from .holes import (
    TEAR,
    Reason,
    disparity_steps,
    empty_reasons,
    source_silhouettes,
    target_silhouettes,
)
from .lookup import lookup
from .passes import DEPTH_PASS, Passes
from .warp import Warp, forward_warp

TOUCHED = 0.02
"""Share of a looked-up colour that may come from a pixel that should not be looked up."""


@dataclass(frozen=True)
class Reprojection:
    """The warp, its grid, and (H, W) `Reason` flags of the target pixels that it cannot answer for."""

    warp: Warp
    grid: Grid
    reasons: NDArray[np.uint16]


def reproject(
    source: Passes,
    source_camera: Camera,
    target_camera: Camera,
    *,
    accuracy: Accuracy,
    invalid: NDArray[np.bool_],
    grid_threshold: float,
) -> Reprojection:
    """Warp the source's depth into the target and flag what is to be traced.

    source holds the colour (H, W, 4) and depth (H, W, 1) passes; invalid (H, W) marks source pixels whose colour is
    no number; grid_threshold is in arc minutes.
    """
    depth = source[DEPTH_PASS][..., 0]
    grid = build_grid(depth, source_camera, target_camera, threshold=grid_threshold)
    nearness = source_camera.nearness_from_depth(depth.astype(np.float64))
    steps = disparity_steps(nearness, disparity_per_nearness(source_camera, target_camera))
    warp = forward_warp(
        depth, source_camera, target_camera, grid, cut_right=steps.right > TEAR, cut_down=steps.down > TEAR
    )
    reasons = empty_reasons(warp, source_camera, target_camera)
    band = {"threshold": accuracy.silhouette_step, "radius": accuracy.silhouette_radius}
    in_source = source_silhouettes(steps, **band)
    in_target = target_silhouettes(warp, reasons, target_camera, source_camera, **band)
    unfit = np.stack([in_source, invalid], axis=-1).astype(np.float32)
    touched = lookup(unfit, warp.x, warp.y) > TOUCHED
    answered = reasons == 0
    reasons[answered & (in_target | touched[..., 0])] |= Reason.SILHOUETTE.bit
    reasons[answered & touched[..., 1]] |= Reason.INVALID.bit
    return Reprojection(warp, grid, reasons)
