"""Cut-outs of a panorama: the perspective pictures in which a headset shows it, each in one direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .camera import Array, Camera, Vector
from .panorama import PanoramicCamera
from .solid_angle import largest_solid_angle

HALF_VIEW = 1.0
"""Half the side of a cut-out's view plane at unit distance: the tangent of half of its 90°."""

MIN_SHOWN_SHARE = 0.75
"""Share of a cut-out that the panorama must show for it to be one: of less, too much of the picture is black."""

LATTICE = 32
"""Places across and down by which it is judged how much of a cut-out the panorama shows."""

ROUNDING_PX = 1e-6
"""Pixels by which a place may lie outside of the picture by rounding alone."""

ALL_ROWS = slice(None)


@dataclass(frozen=True)
class Cutout:
    """A perspective picture out of a panorama, 90° wide and high.

    left_degrees and up_degrees say where its middle is, counted from the middle of the panorama, to the left and then
    upwards. name is that of its side, such as "left"; title tells it from the same side by another angle.
    """

    name: str
    left_degrees: float
    up_degrees: float

    @property
    def title(self) -> str:
        """Name and angle in words, such as "left 45°"."""
        degrees = abs(self.left_degrees or self.up_degrees)
        return f"{self.name} {degrees:g}°" if degrees else self.name


CANDIDATES = (
    (Cutout("front", 0.0, 0.0),),
    (Cutout("left", 90.0, 0.0), Cutout("left", 45.0, 0.0)),
    (Cutout("right", -90.0, 0.0), Cutout("right", -45.0, 0.0)),
    (Cutout("up", 0.0, 90.0), Cutout("up", 0.0, 45.0)),
    (Cutout("down", 0.0, -90.0), Cutout("down", 0.0, -45.0)),
    (Cutout("back", 180.0, 0.0),),
)
"""Directions of each side, the preferred one first. At 90° cut-outs are the faces of a cube. Half of the face on the
left of a VR180 picture lies behind its edge; turned by 45°, a cut-out ends at that edge."""


def cutouts_of(camera: Camera | None) -> tuple[Cutout, ...]:
    """Return the cut-outs of a camera's picture: for each side the direction of which the picture shows most, and of
    equal ones the preferred one. There are none of a camera that is no panorama."""
    if not isinstance(camera, PanoramicCamera) or camera.around_world:
        return ()
    chosen = []
    for side in CANDIDATES:
        shares = [float(np.mean(np.isfinite(px_in_cutout(camera, cutout, LATTICE)[0]))) for cutout in side]
        best = int(np.argmax(shares))
        if shares[best] >= MIN_SHOWN_SHARE:
            chosen.append(side[best])
    return tuple(chosen)


def px_in_cutout(camera: PanoramicCamera, cutout: Cutout, size: int, rows: slice = ALL_ROWS) -> tuple[Array, Array]:
    """Return the pixel positions x, y (h, size) in a panorama that a cut-out of size x size pixels shows in these of
    its rows, all by default; NaN where the panorama shows nothing.

    It is the directions in which the picture is seen that count, as in a headset: where the rays of spherical stereo
    begin does not.
    """
    across = HALF_VIEW * ((np.arange(size) + 0.5) * (2.0 / size) - 1.0)
    return _px_from_plane(camera, cutout, across[None, :], -across[rows, None])


def natural_size(camera: PanoramicCamera) -> int:
    """Return the width in pixels at which the pixels in the middle of a cut-out are as large as the panorama's largest:
    those at a pole, many of which show nearly the same, do not count."""
    largest = largest_solid_angle(camera)
    return max(round(2.0 * HALF_VIEW / np.sqrt(largest)), 1) if largest > 0.0 else 1


def _px_from_plane(camera: PanoramicCamera, cutout: Cutout, across: Array, up: Array) -> tuple[Array, Array]:
    """Return the pixel positions of places on a cut-out's view plane, to the right and upwards at unit distance; NaN
    where the panorama shows nothing."""
    x, y = camera.px_from_looking(_looking(cutout, _middle_azimuth(camera), across, up))
    slack = ROUNDING_PX
    with np.errstate(invalid="ignore"):
        shown = (x >= -slack) & (x <= camera.width + slack) & (y >= -slack) & (y <= camera.height + slack)
        if camera.has_lens_edge:
            shown &= camera.within_lens(x, y) >= 0.0
    return np.where(shown, x, np.nan), np.where(shown, y, np.nan)


def _looking(cutout: Cutout, middle: float, across: Array, up: Array) -> Vector:
    """Return the directions, in the panorama's frame, of places on a cut-out's view plane; middle is the azimuth of the
    panorama's middle, in radians to the left."""
    pitch, turn = np.radians(cutout.up_degrees), middle + np.radians(cutout.left_degrees)
    ahead = np.cos(pitch) - np.sin(pitch) * up
    height = np.sin(pitch) + np.cos(pitch) * up + 0.0 * across
    return (
        np.cos(turn) * ahead + np.sin(turn) * across,
        np.sin(turn) * ahead - np.cos(turn) * across,
        height,
    )


def _middle_azimuth(camera: PanoramicCamera) -> float:
    """Return the azimuth, in radians to the left of the camera's axis, at which a panorama's middle column looks: what
    a headset shows first."""
    ahead, aside, _ = camera.looking_from_px(np.array(0.5 * camera.width), np.array(0.5 * camera.height))
    azimuth = float(np.arctan2(aside, ahead))
    return azimuth if np.isfinite(azimuth) else 0.0
