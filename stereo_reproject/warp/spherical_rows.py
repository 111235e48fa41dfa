"""The shift along rows of an equirectangular pair with spherical stereo.

Both eyes stand equally far to either side, and so see each point at the same altitude and at the same distance: in a
row it moves by an angle that depends on its distance alone. With o the offset of an eye, which a pole merge makes
smaller, c the convergence distance, L = sqrt(c^2 + o^2) and a the altitude of the row, a ray of the source that begins
at o times the side vector meets, at the distance 1 / n, a point that lies to the right of the ray's own azimuth by

    atan(o (L n - 1) / (c cos a)),    and of that of parallel rays by    atan(o n / cos a).

The other eye has -o: the point moves by twice this angle. Source: Cycles, `spherical_stereo_transform`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..views.camera import SAME_PERIOD_PIXELS, Camera, goes_round
from ..views.panorama import PanoramicCamera
from ..views.projections import Equirectangular

SAME_PLACE = 1e-12
"""Difference between two poses up to which they are the same: rounding of double precision."""


@dataclass(frozen=True)
class SphericalRowDisparity:
    """The shift of an equirectangular pair, in pixels: a point in row i moves per_radian * 2 atan(slope[i] * nearness +
    start[i]) to the right in the target.

    slope, start (H,) are of the rows' own centres. wraps: True where the picture's right side goes on at its left.
    """

    per_radian: float
    slope: NDArray[np.float64]
    start: NDArray[np.float64]
    wraps: bool

    @property
    def grows(self) -> bool:
        """True where what is nearer moves farther to the right."""
        return self.per_radian * float(self.slope.sum()) > 0.0

    @property
    def pixels_per_tangent(self) -> float:
        """Pixels per radian of a row's arc tangent, as `RowLaw.pixels_per_tangent` says."""
        return 2.0 * self.per_radian

    def lines(self, height: int) -> NDArray[np.float64]:
        """Return (H, 2) slope and start, as `RowLaw.lines` says; the picture's height is known."""
        assert height == len(self.slope)
        return np.stack([self.slope, self.start], axis=1)

    def moved(self, near: NDArray[np.float32], rows: NDArray[np.intp]) -> NDArray[np.float32]:
        """Return the disparity (h, K), in pixels, of points with this nearness (h, K) in these rows (h,)."""
        slope, start = (values[rows].astype(np.float32)[:, None] for values in (self.slope, self.start))
        with np.errstate(over="ignore"):
            angle = np.arctan(near * slope + start)
        angle *= np.float32(self.pixels_per_tangent)
        return angle


def spherical_rows_of(source: Camera, target: Camera) -> SphericalRowDisparity | None:
    """Return the shift of points between two eyes of spherical stereo in equirectangular pictures; None for any other
    pair, and where a part of a turn beyond the picture's own could be seen again."""
    if not isinstance(source, PanoramicCamera) or not isinstance(target, PanoramicCamera):
        return None
    projection, one, other = source.projection, source.stereo, target.stereo
    if not isinstance(projection, Equirectangular) or one is None or other is None or source.around_world:
        return None
    opposite = replace(source, world_from_camera=target.world_from_camera, stereo=replace(one, offset=-one.offset))
    same_pose = np.allclose(source.world_from_camera, target.world_from_camera, rtol=0.0, atol=SAME_PLACE)
    same_size = (source.width, source.height) == (target.width, target.height)
    if not same_pose or not same_size or target.lens != opposite.lens:
        return None
    wraps = goes_round(source)
    if not wraps and source.period_px < 2.0 * source.width - SAME_PERIOD_PIXELS:
        return None
    (west, east), window = projection.longitudes, source.window
    per_radian = source.width / ((window.right - window.left) * (east - west))
    altitude = _altitudes(source, projection)
    share = np.ones_like(altitude) if one.poles is None else one.poles.share(np.abs(altitude))
    offset, cosine = (one.offset * share).astype(np.float64), np.cos(altitude)
    if np.any(cosine <= 0.0):
        return None
    if np.isinf(one.convergence):
        return SphericalRowDisparity(per_radian, offset / cosine, np.zeros_like(offset), wraps)
    across = offset / (one.convergence * cosine)
    return SphericalRowDisparity(per_radian, across * np.hypot(one.convergence, offset), -across, wraps)


def _altitudes(camera: PanoramicCamera, projection: Equirectangular) -> NDArray[np.float64]:
    """Return the altitudes (H,), in radians, of the centres of an equirectangular picture's rows."""
    window, (south, north) = camera.window, projection.latitudes
    down = (np.arange(camera.height) + 0.5) / camera.height
    return south + (window.top - (window.top - window.bottom) * down) * (north - south)
