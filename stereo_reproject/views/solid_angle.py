"""Solid angles of pixels: how much of what is seen each pixel of a panorama shows."""

from __future__ import annotations

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


def _solid_angles(camera: PanoramicCamera, rows: slice, columns: int) -> Array:
    """Return the solid angles (h, columns), in steradians, of the first pixels of these rows; 0 where they show
    nothing.

    It is the area of the flat quad between the directions of a pixel's corners: half the product of its diagonals.
    """
    x, y = np.arange(columns + 1.0), np.arange(rows.start, rows.stop + 1.0)[:, None]
    with np.errstate(invalid="ignore"):
        corners = np.stack(np.broadcast_arrays(*unit(camera.looking_from_px(x, y))), axis=-1)
    falling, rising = corners[1:, 1:] - corners[:-1, :-1], corners[:-1, 1:] - corners[1:, :-1]
    area = 0.5 * np.linalg.norm(np.cross(falling, rising), axis=-1)
    within = camera.within_lens(x[:-1] + 0.5, y[:-1] + 0.5) >= 0.0
    return np.where(within & np.isfinite(area), area, 0.0)
