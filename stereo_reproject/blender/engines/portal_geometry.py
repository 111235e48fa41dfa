"""The place of the portal's sheet, and the pixels of the packed camera that looks at it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...views.camera import Camera, OrthographicCamera, pixel_size
from ...views.panorama import PanoramicCamera
from .packed_camera import PackedTask
from .packed_views import PackedPixels
from .tuning import TUNING

MIN_NEAR_CLIP_UNITS = 1e-6
"""Smallest near clip that Blender takes, in scene units."""


CAMERA_FROM_PANORAMAS_SHEET = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
"""A panorama's camera space from its sheet's, which stands to the camera's right: straight ahead a panorama's aperture
has no axes."""

SPREAD_PLACES = 33
"""Places across and down a panorama between which spreads are compared."""

SPREAD_PIXELS = 1 << 14
"""Pixels, at most, of which the mean spread is taken."""


@dataclass(frozen=True)
class SheetPlace:
    """Place of the sheet before the packed camera, in scene units: its depth, the camera's near clip, and the radius of
    its aperture where it has one."""

    depth: float
    near_clip: float
    lens_radius: float


@dataclass(frozen=True)
class SheetRays:
    """Rays of a packed picture up to the sheet, in the sheet's space and scene units.

    kind is Blender's name of the packed camera's. size is the picture's width and height in pixels, and step a pixel's
    width and height on its plane: at unit depth, for an orthographic camera in scene units, for a panorama in radians.
    depth is the sheet's. widening is the width of the scene's pixel filter over that of the packed picture.
    """

    kind: str
    size: tuple[int, int]
    step: tuple[float, float]
    depth: float
    widening: float


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
    if kind_of(camera) == "PANO":
        most = TUNING.max_panorama_sheet_near_clips * clip_start
        if depth > most:
            return None
        fine = TUNING.min_panorama_lens_roundings * rounding / TUNING.panorama_lens_depths
        depth = max(depth, min(fine, most))
        return SheetPlace(depth, 0.5 * depth, TUNING.panorama_lens_depths * depth)
    if depth > 0.5 * clip_start:
        return None
    return SheetPlace(depth, 0.5 * depth, max(depth, TUNING.min_lens_radius_roundings * rounding))


def tells_lens_apart(camera: Camera, place: SheetPlace) -> bool:
    """Return whether single precision tells enough places on the packed camera's aperture apart."""
    rounding = float(np.spacing(np.float32(np.abs(camera.world_from_camera[:3, 3]).max())))
    return place.lens_radius >= TUNING.min_panorama_lens_roundings * rounding


def sheet_from_camera(camera: Camera) -> NDArray[np.float64]:
    """Return the turn (3, 3) from a view's camera space to that of the sheet before it."""
    return CAMERA_FROM_PANORAMAS_SHEET.T if kind_of(camera) == "PANO" else np.eye(3)


def kind_of(camera: Camera) -> str:
    """Return Blender's name of the kind of camera that a view's packed camera is: that of the view itself."""
    if isinstance(camera, PanoramicCamera):
        return "PERSP" if camera.around_world else "PANO"
    return "ORTHO" if isinstance(camera, OrthographicCamera) else "PERSP"


def on_plane(pixels: PackedPixels) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return x and y (N,) of the pixels' centres on their camera's view plane."""
    camera, plane = pixels.camera, pixels.camera.plane
    across, up = pixel_size(camera)
    return plane.left + (pixels.places[:, 1] + 0.5) * across, plane.top - (pixels.places[:, 0] + 0.5) * up


def packed_step(task: PackedTask) -> tuple[float, float]:
    """Return the width and the height of a packed pixel on the packed camera's plane: those of the rendered view's
    pixels, times how much wider the views' pixels are seen than those in the middle of its picture. A panorama's are in
    radians.
    """
    packing, kind = task.packing, kind_of(task.rendered)
    if kind == "ORTHO":
        return pixel_size(task.rendered)
    wanted = np.concatenate([_spreads(pixels) for pixels in task.views])
    mean = float(np.mean(wanted)) if wanted.size else 1.0
    if kind == "PANO":
        step = min(mean, 2.0 * TUNING.panorama_half_angle_radians / max(packing.width, packing.height))
        return step, step
    across, up = (mean, mean) if isinstance(task.rendered, PanoramicCamera) else pixel_size(task.rendered)
    x, y = np.meshgrid(
        (np.arange(packing.width) + 0.5 - 0.5 * packing.width) * across,
        (np.arange(packing.height) + 0.5 - 0.5 * packing.height) * up,
    )
    share = mean / float(np.mean(spread(x, y, across, up))) if wanted.size else 1.0
    return across * share, up * share


def spread_ratio(camera: Camera) -> float:
    """Return how much wider apart the rays of neighbouring pixels are where they are widest apart in a view than where
    they are least: in a planar one, in the middle and in the corners."""
    if isinstance(camera, OrthographicCamera):
        return 1.0
    if isinstance(camera, PanoramicCamera):
        rows, columns = (
            np.linspace(0, side - 1, SPREAD_PLACES).astype(np.intp) for side in (camera.height, camera.width)
        )
        lattice = np.stack(np.meshgrid(rows, columns), axis=-1).reshape(-1, 2)
        spreads = _spreads(PackedPixels(camera, lattice))
        return float(spreads.max() / spreads.min()) if spreads.size else 1.0
    plane = camera.plane
    x, y = np.meshgrid((plane.left, 0.0, plane.right), (plane.bottom, 0.0, plane.top))
    spreads = spread(x, y, *pixel_size(camera))
    return float(spreads.max() / spreads.min())


def _spreads(pixels: PackedPixels) -> NDArray[np.float64]:
    """Return how far apart the directions of neighbouring pixels are, for pixels of a view or, of many, for some spread
    evenly among them: as `spread` says."""
    camera = pixels.camera
    pixels = PackedPixels(camera, pixels.places[:: -(-len(pixels.places) // SPREAD_PIXELS) or 1])
    if not isinstance(camera, PanoramicCamera):
        return spread(*on_plane(pixels), *pixel_size(camera))
    x, y = pixels.places[:, 1] + 0.5, pixels.places[:, 0] + 0.5

    def apart(right: float, down: float) -> NDArray:
        _, one = camera.ray_from_px(x - right, y - down)
        _, other = camera.ray_from_px(x + right, y + down)
        return np.sqrt(sum(np.square(a - b) for a, b in zip(one, other, strict=True)))

    spreads = 0.5 * (apart(0.5, 0.0) + apart(0.0, 0.5))
    return spreads[np.isfinite(spreads)]


def spread(x: NDArray, y: NDArray, across: float, up: float) -> NDArray[np.float64]:
    """Return how far apart the directions of neighbouring pixels are, at places x, y on a plane at unit depth, on which
    pixels are `across` wide and `up` high: the mean of both sides, as Cycles spreads its rays (`camera_sample`).
    """
    squared = 1.0 + x**2 + y**2
    return 0.5 * (across * np.sqrt(1.0 + y**2) + up * np.sqrt(1.0 + x**2)) / squared
