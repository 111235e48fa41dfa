"""The warp stage as a whole: steps in depth, grid, forward warp, and which pixels it leaves to be traced."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .accuracy import Accuracy
from .camera import Camera, disparity_per_nearness
from .composite import warp_passes
from .grid import Grid, build_grid
from .holes import TEAR, Reason, Steps, disparity_steps, empty_reasons
from .lookup import touches
from .masks import dilate
from .passes import COLOUR_PASS, DEPTH_PASS, MASKED_PASS, Passes
from .silhouettes import differing, edge_band
from .warp import Warp, forward_warp

TOUCHED = 0.02
"""Share of a looked-up colour that may come from a pixel that should not be looked up."""


@dataclass(frozen=True)
class Reprojection:
    """The source's passes as the target sees them, and (H, W) `Reason` flags where they are not the answer."""

    passes: Passes
    reasons: NDArray[np.uint16]
    grid: Grid
    warp: Warp


def reproject(
    source: Passes,
    source_camera: Camera,
    target_camera: Camera,
    *,
    accuracy: Accuracy,
    invalid: NDArray[np.bool_],
    grid_threshold: float = 1.0,
    interpolation: str = "linear",
) -> Reprojection:
    """Warp the source into the target and flag what is to be traced.

    source holds the colour (H, W, 4) and depth (H, W, 1) passes, and any other; invalid (H, W) marks source pixels
    whose colour is no number; grid_threshold is in arc minutes.
    """
    depth = source[DEPTH_PASS][..., 0]
    grid = build_grid(depth, source_camera, target_camera, threshold=grid_threshold)
    disparity = _disparity(depth, source_camera, target_camera)
    steps = disparity_steps(disparity)
    warp = forward_warp(
        depth, source_camera, target_camera, grid, cut_right=steps.right > TEAR, cut_down=steps.down > TEAR
    )
    warped = warp_passes(source, warp, source_camera, target_camera, interpolation=interpolation)

    reasons = empty_reasons(warp, source_camera, target_camera)
    answered = reasons == 0
    blurred = _source_silhouettes(source, disparity, steps, invalid, accuracy)
    edges = _target_silhouettes(warped, warp, reasons, target_camera, source_camera, accuracy)
    reasons[answered & (edges | touches(blurred, warp.x, warp.y, share=TOUCHED))] |= Reason.SILHOUETTE.bit
    if MASKED_PASS in source:
        masked = source[MASKED_PASS][..., 0] > 0.0
        reasons[answered & touches(masked, warp.x, warp.y, share=TOUCHED)] |= Reason.VIEW_DEPENDENT.bit
    if invalid.any():
        # The cubic kernel reaches one pixel further, and no share of what is no number may be had.
        spoilt = dilate(invalid, 1) if interpolation == "cubic" else invalid
        reasons[answered & touches(spoilt, warp.x, warp.y, share=0.0)] |= Reason.INVALID.bit
    return Reprojection(warped, reasons, grid, warp)


def _disparity(depth: NDArray, camera: Camera, other: Camera) -> NDArray[np.float32]:
    """(H, W): how far, in pixels, the surface seen by `camera` moves in the other eye, but for a constant."""
    nearness = camera.nearness_from_depth(depth.astype(np.float64))
    return (nearness * disparity_per_nearness(camera, other)).astype(np.float32)


def _source_silhouettes(
    source: Passes, disparity: NDArray, steps: Steps, invalid: NDArray[np.bool_], accuracy: Accuracy
) -> NDArray[np.bool_]:
    """(H, W) source pixels that mix what the two sides of an edge show."""
    band = edge_band(steps, threshold=accuracy.silhouette_step, radius=accuracy.silhouette_radius)
    unknown = invalid | ~np.isfinite(disparity)
    return differing(band, disparity, source[COLOUR_PASS], tolerance=accuracy.colour_tolerance, unknown=unknown)


def _target_silhouettes(
    warped: Passes,
    warp: Warp,
    empty: NDArray[np.uint16],
    target_camera: Camera,
    source_camera: Camera,
    accuracy: Accuracy,
) -> NDArray[np.bool_]:
    """(H, W) target pixels that a plain render would filter over an edge, judged by the warped depth.

    Beside a disoccluded pixel the other side's colour is not known yet: there the band is always traced.
    """
    disparity = np.where(warp.covered, warp.nearness, np.nan) * disparity_per_nearness(target_camera, source_camera)
    steps = disparity_steps(disparity.astype(np.float32))
    band = edge_band(steps, threshold=accuracy.silhouette_step, radius=accuracy.silhouette_radius)
    edges = differing(band, disparity, warped[COLOUR_PASS], tolerance=accuracy.colour_tolerance, unknown=~warp.covered)
    uncovered = (empty & Reason.DISOCCLUDED.bit) > 0
    return edges | dilate(uncovered, accuracy.silhouette_radius)
