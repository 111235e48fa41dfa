"""Transmission parallax: things seen through a surface are warped with that surface, and are off if they lie behind.

Their depth is not known; it is nowhere greater than that of the farthest surface in sight, or of the sky.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..images.contrast import Contrast
from .tuning import TUNING


def transmission_parallax(
    glass: NDArray[np.bool_],
    behind: NDArray,
    gradient: NDArray[np.float32],
    contrast: Contrast,
    *,
    limit: float,
    unseen: float,
) -> NDArray[np.bool_]:
    """Return (H, W) pixels of transmissive surfaces whose noise ratio, if they were warped, is surely above `limit`.

    glass (H, W): pixels of such surfaces. behind (H, W), in pixels: the disparity between a surface and the farthest
    thing in sight; NaN where it is not known. gradient (H, W): the change of colour from a pixel to the next. A thing
    behind the surface moves against it by up to `behind`. The colour is off by up to the gradient for each such pixel,
    and by no more than two points of the picture around differ, which contrast tells. Noise, as a standard deviation,
    counts as `unseen` at least.
    """
    known = np.isfinite(behind)
    moved = np.where(known, behind, 0.0)
    error = np.minimum((moved * gradient) ** 2, 2.0 * contrast.signal)
    return (
        glass & known & (error > TUNING.error_margin * (limit**2 - 1.0) * 2.0 * np.maximum(contrast.noise, unseen**2))
    )
