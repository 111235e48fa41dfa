"""Binocular parallax: how differently two eyes see a depth (paper, section 3.1, equation 1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

ARC_MINUTE = np.pi / (180.0 * 60.0)
"""One arc minute in radians: about what a healthy eye resolves."""


def parallax_angle(depth: NDArray, interocular_distance: float) -> NDArray[np.float64]:
    """theta(z) = 2 atan(ipd / 2z), in radians; 0 for depth +inf."""
    return 2.0 * np.arctan2(0.5 * interocular_distance, np.asarray(depth, np.float64))


def parallax_difference(near: NDArray, far: NDArray, interocular_distance: float) -> NDArray[np.float64]:
    """theta(near) - theta(far), in radians, without the cancellation that the plain difference suffers.

    near and far are depths (...), 0 < near <= far <= +inf. The addition theorem of the arc tangent turns the
    difference of two nearly equal angles into one angle whose numerator is the depth difference itself. NaN depths
    give NaN.
    """
    near = np.asarray(near, np.float64)
    far = np.asarray(far, np.float64)
    half = 0.5 * interocular_distance
    with np.errstate(invalid="ignore"):
        numerator = half * (far - near)
        denominator = near * far + half * half
        finite = 2.0 * np.arctan2(numerator, denominator)
    both_sky = np.isinf(near) & np.isinf(far)
    only_far_sky = np.isinf(far) & ~np.isinf(near)
    return np.where(both_sky, 0.0, np.where(only_far_sky, parallax_angle(near, interocular_distance), finite))
