"""Binocular parallax: how differently two eyes see a depth (paper, section 3.1, equation 1), and how far apart a point
appears on the screen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .camera import Camera, OrthographicCamera, target_px_from_source_px

ARC_MINUTE = np.pi / (180.0 * 60.0)
"""One arc minute in radians: about what a healthy eye resolves."""


def parallax_angle(depth: NDArray, interocular_distance: float) -> NDArray[np.float64]:
    """Return the angle, in radians, between both eyes' lines of sight to points at these depths; 0 for depth +inf.

    theta(z) = 2 atan(d / 2z), with d the interocular distance, in the unit of the depths (paper, equation 1).
    """
    return 2.0 * np.arctan2(0.5 * interocular_distance, np.asarray(depth, np.float64))


def parallax_difference(near: NDArray, far: NDArray, interocular_distance: float) -> NDArray[np.float64]:
    """Return by how much, in radians, the parallax angle of a nearer depth is larger than that of a farther one.

    It is parallax_angle(near) - parallax_angle(far), computed without the cancellation of a plain difference. near and
    far are depths (...), 0 < near <= far <= +inf, in the unit of interocular_distance. The addition theorem of the arc
    tangent turns the difference of two nearly equal angles into one angle whose numerator is the depth difference
    itself. NaN depths give NaN.
    """
    near = np.asarray(near, np.float64)
    far = np.asarray(far, np.float64)
    half = 0.5 * interocular_distance
    with np.errstate(divide="ignore", invalid="ignore"):
        # Over `far`, so that no product of two of them leaves what a float64 holds.
        numerator = half * ((far - near) / far)
        denominator = near + half * (half / far)
        finite = 2.0 * np.arctan2(numerator, denominator)
    both_sky = np.isinf(near) & np.isinf(far)
    only_far_sky = np.isinf(far) & ~np.isinf(near)
    return np.where(both_sky, 0.0, np.where(only_far_sky, parallax_angle(near, interocular_distance), finite))


@dataclass(frozen=True)
class ScreenParallax:
    """The horizontal shift of a point between the eyes: its place in the right picture minus that in the left.

    It is positive behind the screen and negative before it. depth, of the point, is in scene units, +inf for the sky;
    pixels and percent are the shift in pixels and in percent of the frame's width.
    """

    depth: float
    pixels: float
    percent: float

    def width_on(self, screen_width: float) -> float:
        """Return the shift on a screen of this width, in the unit of the width: positive behind the screen, negative
        before it."""
        return 0.01 * self.percent * screen_width


def parallax_at(left: Camera, right: Camera, depth: float, frame_width: int) -> ScreenParallax:
    """Return the parallax of a point at `depth` in the middle of the left picture; with toe-in it differs towards the
    sides.

    frame_width: width of the whole frame in pixels; with a render border the cameras show only a part of it.
    """
    x, y = np.array(0.5 * left.width), np.array(0.5 * left.height)
    right_x, _, _ = target_px_from_source_px(left, right, x, y, np.array(depth))
    pixels = float(right_x - x)
    return ScreenParallax(depth, pixels, 100.0 * pixels / frame_width)


def visible_parallax(
    left: Camera, right: Camera, depth: NDArray, frame_width: int
) -> tuple[ScreenParallax, ScreenParallax] | None:
    """Return the parallax of the nearest and of the farthest depth in the left eye's `depth` (H, W); None if it has
    none.

    Values that are no depth (0, negative, NaN) are passed over. frame_width is as for `parallax_at`.
    """
    # The sky of parallel rays has no place on the screen when the eyes are turned.
    seen = depth[(depth > 0.0) & (np.isfinite(depth) | (not isinstance(left, OrthographicCamera)))]
    if not seen.size:
        return None
    near, far = float(seen.min()), float(seen.max())
    return parallax_at(left, right, near, frame_width), parallax_at(left, right, far, frame_width)


def is_wider_than_eyes(parallax: ScreenParallax, screen_width: float, eye_distance: float) -> bool:
    """Return whether the point's two pictures are further apart on the screen than a viewer's eyes, which then turn
    outwards.

    screen_width and eye_distance are in one unit.
    """
    return parallax.width_on(screen_width) > eye_distance
