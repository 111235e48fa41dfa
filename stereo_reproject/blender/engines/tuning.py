"""The tuned numbers of how Blender's engines are driven."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PortalTuning:
    """Numbers of the packed camera by a Ray Portal: where its sheet stands, how rays are told apart, what differs too
    much to be traced so."""

    sheet_depth_near_clips: float = 1.0 / 64.0
    """Depth of the sheet over that of the view's near clip. Chosen small: the closer the sheet is to the camera, the
    less can stand in front of it."""

    min_sheet_depth_roundings: int = 12
    """Least depth of the sheet, over what single precision rounds the coordinates of the camera's place by. Chosen so
    that the sheet, the packed camera's near clip at half of that depth, and the camera stay apart when they are
    rounded."""

    min_lens_radius_roundings: int = 4096
    """Least radius of the packed camera's aperture, over the same rounding: so many places on it can be told apart each
    way. Chosen: bokeh has no visible steps."""

    jitter_pixels: float = 0.9
    """Part of a packed pixel, along its side, in which rays are shot: rounding cannot bring them into the next pixel. A
    box filter has no width that can be set, and fills the pixel. Chosen."""

    sensor_mm: float = 8.0
    """Width of the packed camera's sensor, unless so many pixels are traced that its lens would be shorter than the
    1 mm that Blender takes. Chosen."""

    focus_lens_radii: float = 1e7
    """Depth in focus of the packed perspective camera over the radius of its aperture. Chosen as good as endless: over
    it the aperture moves a ray's direction by the last bit of single precision."""

    max_bump_spread_ratio: float = 1.6
    """Spread of the rays in the middle of a view over that in its corners, up to which bumps look alike. Measured on a
    floor that was all bumps: with 35 mm (1.2) the error was 1.01 times that between two seeds, with 18 mm (1.8) 1.07
    times."""

    min_pass_alpha_threshold: float = 1e-6
    """Smallest alpha threshold of passes: at 0 they would show the sheet. Chosen next to 0. Where the user has 0, what
    is wholly transparent is in a plain render's passes, and not in those of traced pixels."""

    sheet_reach_depths: float = 8.0
    """Distance from the camera within which all of the sheet lies that is seen, over the sum of its depth and the
    aperture's radius. Chosen for lenses that see up to 80 degrees to each side."""

    panorama_half_angle_radians: float = 1.0
    """Angle from the middle of a panorama's packed picture to its sides, at most. Chosen so that the sheet is a few
    times as wide as it is far away: rays of more than this, of large pixels and of nearly all of a picture, are told
    apart by less than the view's own."""

    max_panorama_sheet_near_clips: float = 1.0 / 20.0
    """Depth of a panorama's sheet over the near clip, at most. Chosen: its corners are up to eight times as far away,
    and no ray of an eye begins nearer than half of the near clip."""

    panorama_lens_depths: float = 0.25
    """Radius of a panorama's packed aperture over the depth of the sheet. Chosen: it is across each ray, so that its
    edge comes nearer to the sheet."""

    min_panorama_lens_roundings: int = 128
    """Least radius of a panorama's packed aperture, over the same rounding. Chosen: steps of it are seen in a blur of
    hundreds of pixels alone, and there is less room than before a plane."""

    motion_newton_steps: int = 8
    """Steps by which directions are found again from their motion in pixels. Three were enough for any but fast
    turns."""


TUNING = PortalTuning()
"""The numbers in use."""
