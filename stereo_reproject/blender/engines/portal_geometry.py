"""The place of the portal's sheet, and the pixels of the packed camera that looks at it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...views.camera import Camera, OrthographicCamera, pixel_size
from .packed_camera import PackedTask
from .packed_views import PackedPixels
from .tuning import TUNING

MIN_NEAR_CLIP_UNITS = 1e-6
"""Smallest near clip that Blender takes, in scene units."""


@dataclass(frozen=True)
class SheetPlace:
    """Place of the sheet before the packed camera, in scene units: its depth, the camera's near clip, and the radius of
    its aperture where it has one."""

    depth: float
    near_clip: float
    lens_radius: float


def place_of(task: PackedTask) -> SheetPlace:
    """Return where the sheet of a packed render stands; there is room for it."""
    place = sheet_place(task.rendered, task.clip_start)
    assert place is not None
    return place


def sheet_place(camera: Camera, clip_start: float) -> SheetPlace | None:
    """Return where the sheet stands before a camera with this near clip; None where there is no room for it."""
    rounding = float(np.spacing(np.float32(np.abs(camera.world_from_camera[:3, 3]).max())))
    least = max(TUNING.min_sheet_depth_roundings * rounding, 2.0 * MIN_NEAR_CLIP_UNITS)
    depth = max(TUNING.sheet_depth_near_clips * clip_start, least)
    if depth > 0.5 * clip_start:
        return None
    return SheetPlace(depth, 0.5 * depth, max(depth, TUNING.min_lens_radius_roundings * rounding))


def on_plane(pixels: PackedPixels) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return x and y (N,) of the pixels' centres on their camera's view plane."""
    camera, plane = pixels.camera, pixels.camera.plane
    across, up = pixel_size(camera)
    return plane.left + (pixels.places[:, 1] + 0.5) * across, plane.top - (pixels.places[:, 0] + 0.5) * up


def packed_step(task: PackedTask) -> tuple[float, float]:
    """Return the width and the height of a packed pixel on the packed camera's plane: those of the rendered view's
    pixels, times how much wider the views' pixels are seen than those in the middle of its picture.
    """
    across, up = pixel_size(task.rendered)
    if isinstance(task.rendered, OrthographicCamera):
        return across, up
    packing = task.packing
    wanted = np.concatenate([spread(*on_plane(pixels), *pixel_size(pixels.camera)) for pixels in task.views])
    x, y = np.meshgrid(
        (np.arange(packing.width) + 0.5 - 0.5 * packing.width) * across,
        (np.arange(packing.height) + 0.5 - 0.5 * packing.height) * up,
    )
    share = float(np.mean(wanted) / np.mean(spread(x, y, across, up))) if wanted.size else 1.0
    return across * share, up * share


def spread_ratio(camera: Camera) -> float:
    """Return how much wider apart the rays of neighbouring pixels are in the middle of a view than in its corners."""
    if isinstance(camera, OrthographicCamera):
        return 1.0
    plane = camera.plane
    x, y = np.meshgrid((plane.left, 0.0, plane.right), (plane.bottom, 0.0, plane.top))
    spreads = spread(x, y, *pixel_size(camera))
    return float(spreads.max() / spreads.min())


def spread(x: NDArray, y: NDArray, across: float, up: float) -> NDArray[np.float64]:
    """Return how far apart the directions of neighbouring pixels are, at places x, y on a plane at unit depth, on which
    pixels are `across` wide and `up` high: the mean of both sides, as Cycles spreads its rays (`camera_sample`).
    """
    squared = 1.0 + x**2 + y**2
    return 0.5 * (across * np.sqrt(1.0 + y**2) + up * np.sqrt(1.0 + x**2)) / squared
