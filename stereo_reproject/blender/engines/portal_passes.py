"""The passes of a packed render through a portal, as a plain camera has them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...images.passes import DEPTH_PASS, VECTOR_PASS, Passes
from ...views.camera import OrthographicCamera, pixel_size
from ...warp.panorama_motion import motion_from_angles
from .packed_camera import PackedTask
from .packed_views import POSITION, PackedPixels, seen_from_view
from .portal_geometry import kind_of, on_plane, packed_step, place_of
from .ray_table import normals_from_camera, panoramic, seen_by_eye, shares_within_lens
from .tuning import TUNING

MEAN_LENGTH, SPECULAR_ALBEDO = "Denoising Depth", "Denoising Specular Albedo"
"""Passes in which the sheet counts: the length of the rays, and what is reflected sharply."""


def as_plain(flat: Passes, task: PackedTask, index: int) -> Passes:
    """Return the passes (N, C) of one view's pixels as `PackedCamera.as_plain` says."""
    pixels = task.views[index]
    sky = _shows_sheet(flat, task, own=pixels.camera is task.rendered)
    passes = _without_sheet(flat, task, index, sky)
    if pixels.camera is not task.rendered:
        return seen_from_view(passes, task.rendered, pixels)
    if VECTOR_PASS in flat:
        passes[VECTOR_PASS] = _motion(flat[VECTOR_PASS], task, pixels, sky[:, 0])
    return passes


def panorama_as_plain(flat: Passes, task: PackedTask, index: int) -> Passes:
    """Return the passes (N, C) of one panorama's pixels as `PackedCamera.as_plain` says."""
    place, camera = place_of(task), panoramic(task.rendered)
    if kind_of(camera) == "PANO":
        # No ray of an eye begins so near.
        sky = flat[DEPTH_PASS] < TUNING.sheet_reach_depths * place.depth
    else:
        sky = _shows_sheet(flat, task, own=task.views[index].camera is camera)
    passes = _without_sheet(flat, task, index, sky | np.isposinf(flat[DEPTH_PASS]))
    camera_from_normals = normals_from_camera(camera).T
    passes = seen_by_eye(passes, task, index, by_distance=False, camera_from_normals=camera_from_normals)
    if VECTOR_PASS in flat:
        pixels, region = task.views[index], task.region
        turned = flat[VECTOR_PASS] * np.float32(packed_step(task)[0])
        x, y = pixels.places[:, 1] + 0.5, pixels.places[:, 0] + 0.5
        size = float(region.full_width), float(region.full_height)
        passes[VECTOR_PASS] = motion_from_angles(turned, camera, x, y, passes[DEPTH_PASS][:, 0], size)
    return passes


def _without_sheet(flat: Passes, task: PackedTask, index: int, sky: NDArray[np.bool_]) -> Passes:
    """Return the passes (N, C) of one view's pixels without the sheet, given where (N, 1) no surface is seen behind it:
    Cycles leaves depth and place of the sheet there, and counts the way to the sheet and what it lets through.
    """
    passes = dict(flat)
    passes[DEPTH_PASS] = np.where(sky, np.float32(np.inf), flat[DEPTH_PASS])
    if POSITION in flat:
        passes[POSITION] = np.where(sky, np.float32(0.0), flat[POSITION])
    if MEAN_LENGTH in flat:
        passes[MEAN_LENGTH] = (flat[MEAN_LENGTH] - _lengths_to_sheet(task, index)[:, None]).astype(np.float32)
    if SPECULAR_ALBEDO in flat:
        # Rays beyond the lens end at the sheet, which reflects nothing there.
        sent_on = shares_within_lens(task, index) if kind_of(task.rendered) == "PANO" else np.float32(1.0)
        passes[SPECULAR_ALBEDO] = np.maximum(flat[SPECULAR_ALBEDO] - sent_on, np.float32(0.0))
    return passes


def _shows_sheet(flat: Passes, task: PackedTask, *, own: bool) -> NDArray[np.bool_]:
    """Return where (N, 1) depth and place are the sheet's, or depth is endless, as some versions leave it: nothing of
    the rendered view is so near, and of another view (not `own`) nothing is in that place.
    """
    place, endless = place_of(task), np.isposinf(flat[DEPTH_PASS])
    near = np.abs(flat[DEPTH_PASS] - place.depth) < 0.5 * place.depth
    if own:
        return near | endless
    away = np.linalg.norm(flat[POSITION] - task.rendered.world_from_camera[:3, 3], axis=-1, keepdims=True)
    return endless | near & (away < TUNING.sheet_reach_depths * (place.depth + place.lens_radius))


def _lengths_to_sheet(task: PackedTask, index: int) -> NDArray[np.float64]:
    """Return the lengths (N,) of the rays of one view's pixels from the packed camera's near clip to the sheet."""
    place, packing = place_of(task), task.packing
    length = place.depth - place.near_clip
    if isinstance(task.rendered, OrthographicCamera):
        return np.full(len(packing.at[index]), length)
    row, column = np.divmod(packing.at[index], packing.width)
    across, up = packed_step(task)
    x, y = (column + 0.5 - 0.5 * packing.width) * across, (row + 0.5 - 0.5 * packing.height) * up
    if kind_of(task.rendered) == "PANO":
        return place.depth / (np.cos(x) * np.cos(y)) - place.near_clip
    return length * np.sqrt(1.0 + x**2 + y**2)


def _motion(
    vectors: NDArray[np.float32], task: PackedTask, pixels: PackedPixels, sky: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Return motion vectors (N, 4) in pixels of the rendered view, from those in packed pixels. sky (N,) are pixels of
    what is endlessly far.
    """
    (across, up), (packed_across, packed_up) = pixel_size(task.rendered), packed_step(task)
    converted = vectors * np.float32(packed_across / across)
    # 4.5 gives no vectors of the sky: what moves in its pixels is what else is in them.
    if isinstance(task.rendered, OrthographicCamera) or not sky.any() or not vectors[sky].any(axis=-1).all():
        return converted
    plane, region, packing = task.rendered.plane, task.region, task.packing
    x, y = (place[sky] for place in on_plane(pixels))
    ahead = np.stack([x, y, np.ones_like(x)], axis=-1)
    ahead /= np.linalg.norm(ahead, axis=-1, keepdims=True)
    packed = _Raster(1.0 / packed_across, 1.0 / packed_up, 0.5 * packing.width, 0.5 * packing.height)
    below = region.full_height - region.top - region.height
    whole = _Raster(1.0 / across, 1.0 / up, region.left - plane.left / across, below - plane.bottom / up)
    before, after = (packed.turn(ahead, part) for part in (vectors[sky, :2], -vectors[sky, 2:]))
    converted[sky] = np.concatenate([whole.moved(before), -whole.moved(after)], axis=-1)
    return converted


@dataclass(frozen=True)
class _Raster:
    """A picture's pixels, counted from its lower left corner, as Cycles has them for directions: per unit across and
    up, and where the direction straight ahead is."""

    per_x: float
    per_y: float
    middle_x: float
    middle_y: float

    def moved(self, change: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how many pixels (N, 2) a direction that changes by so much (N, 3) moves. Cycles leaves out the
        division by depth.
        """
        x, y, z = change.T
        return np.stack([self.per_x * x + self.middle_x * z, self.per_y * y + self.middle_y * z], axis=-1)

    def turn(self, ahead: NDArray[np.float64], moved: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return by how much (N, 3) unit directions `ahead` (N, 3) change that move by so many pixels (N, 2), and stay
        unit directions: the inverse of `moved`, by Newton's method.
        """
        change = np.zeros_like(ahead)
        slope = np.array([-self.middle_x / self.per_x, -self.middle_y / self.per_y, 1.0])
        start = np.concatenate([moved / np.array([self.per_x, self.per_y]), np.zeros((len(moved), 1))], axis=-1)
        for _ in range(TUNING.motion_newton_steps):
            change = start + change[:, 2:] * slope
            off = ((ahead + change) ** 2).sum(axis=-1) - 1.0
            per_depth = 2.0 * ((ahead + change) * slope).sum(axis=-1)
            change[:, 2] -= off / np.where(per_depth == 0.0, 1.0, per_depth)
        return start + change[:, 2:] * slope
