"""What is seen through a surface: it is warped with that surface, and so it is off where it lies far behind.

How far behind is not known; it is nowhere farther than the farthest surface in sight, or the sky.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..images.contrast import Contrast
from .tuning import TUNING


def transmission_parallax(
    glass: NDArray[np.bool_],
    disparity: NDArray,
    gradient: NDArray[np.float32],
    contrast: Contrast,
    *,
    limit: float,
    unseen: float,
) -> NDArray[np.bool_]:
    """(H, W): pixels of transmissive surfaces whose noise ratio is surely above `limit` when they are warped.

    glass (H, W) is where they are, disparity (H, W) that of the surfaces in pixels, gradient (H, W) the change of
    colour from a pixel to the next. What is seen is off by up to the gradient for each pixel that it moves against its
    surface, and by no more than two points of the picture around differ. Noise less than `unseen` is taken for that.
    """
    known = np.isfinite(disparity)
    if not (glass & known).any():
        return np.zeros_like(glass)
    farthest = np.min(disparity, where=known, initial=np.inf)
    moved = np.where(known, disparity - farthest, 0.0)
    error = np.minimum((moved * gradient) ** 2, 2.0 * contrast.signal)
    return (
        glass & known & (error > TUNING.error_margin * (limit**2 - 1.0) * 2.0 * np.maximum(contrast.noise, unseen**2))
    )
