"""Solid angles of pixels: how much of what is seen each pixel of a panorama shows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .camera import Array, Camera
from .panorama import PanoramicCamera
from .projections import unit

PixelWeight = NDArray[np.float32] | float
"""Weight of each pixel (H, W), above 0 and at most 1; 1.0 where all pixels count alike."""

LEAST_WEIGHT = 1e-6
"""Weight of a pixel that shows nothing, or hardly anything beside a pole: far less than counts, so that no sum of
weights is 0."""

BAND_PIXELS = 1 << 16
"""Pixels whose solid angles are computed at a time, if these are more than one row's."""

PLACES = 65
"""Pixels across and down among which the largest one is looked for: an odd number has the middle among them."""


def pixel_weights(camera: Camera) -> PixelWeight:
    """Return the weight of a camera's pixels: their solid angle, as a share of that of the picture's largest one.

    It is 1.0 for all pixels of a camera whose picture is looked at on a flat screen. A pixel beyond the edge of a lens
    has LEAST_WEIGHT; all are 1.0 where a lens is so small that no pixel's centre lies within it. Where all columns are
    alike the result is one of them, seen as a picture, and cannot be written.
    """
    if camera.is_flat or not isinstance(camera, PanoramicCamera):
        return 1.0
    columns = 1 if camera.projection.columns_alike else camera.width
    result = np.empty((camera.height, columns), np.float32)
    step = max(BAND_PIXELS // columns, 1)
    for top in range(0, camera.height, step):
        rows = slice(top, min(top + step, camera.height))
        result[rows] = _solid_angles(camera, rows, columns)
    largest = result.max()
    if largest <= 0.0:
        return 1.0
    result /= largest
    np.maximum(result, np.float32(LEAST_WEIGHT), out=result)
    return np.broadcast_to(result, (camera.height, camera.width))


def shown_pixels(weight: PixelWeight) -> NDArray[np.bool_] | None:
    """Return the pixels (H, W) that show something, by their weights; None where all do."""
    shown = np.asarray(weight) > LEAST_WEIGHT
    return None if shown.all() else shown


def largest_solid_angle(camera: PanoramicCamera) -> float:
    """Return the solid angle, in steradians, of the largest pixel among PLACES x PLACES of a panorama; 0 where they
    show nothing."""
    across, down = (np.unique(np.linspace(0, pixels - 1, PLACES).round()) for pixels in (camera.width, camera.height))
    x, y = across, down[:, None]
    corners = [_directions(camera, x + right, y + below) for below in (0.0, 1.0) for right in (0.0, 1.0)]
    return float(_shown_areas(camera, x, y, corners).max())


def _solid_angles(camera: PanoramicCamera, rows: slice, columns: int) -> Array:
    """Return the solid angles (h, columns), in steradians, of the first pixels of these rows; 0 where they show
    nothing.
    """
    x, y = np.arange(columns + 1.0), np.arange(rows.start, rows.stop + 1.0)[:, None]
    seen = _directions(camera, x, y)
    return _shown_areas(camera, x[:-1], y[:-1], [seen[:-1, :-1], seen[:-1, 1:], seen[1:, :-1], seen[1:, 1:]])


def _directions(camera: PanoramicCamera, x: Array, y: Array) -> Array:
    """Return the unit directions (h, w, 3) of places x (w,), y (h, 1) in a picture; NaN where it shows nothing."""
    with np.errstate(invalid="ignore"):
        return np.stack(np.broadcast_arrays(*unit(camera.looking_from_px(x, y))), axis=-1)


def _shown_areas(camera: PanoramicCamera, x: Array, y: Array, corners: Sequence[Array]) -> Array:
    """Return the solid angles (h, w) of the pixels whose upper left corners are at x (w,), y (h, 1); 0 where they show
    nothing. corners are the directions (h, w, 3) of the upper left and right and of the lower left and right ones.

    It is the area of the flat quad between the directions: half the product of its diagonals.
    """
    upper_left, upper_right, lower_left, lower_right = corners
    area = 0.5 * np.linalg.norm(np.cross(lower_right - upper_left, upper_right - lower_left), axis=-1)
    within = camera.within_lens(x + 0.5, y + 0.5) >= 0.0
    return np.where(within & np.isfinite(area), area, 0.0)
