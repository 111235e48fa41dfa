"""Views side by side, as light-field displays want them: cameras on a line, all of which show the focus plane alike.

Each camera stands beside the first one, looks the same way, and has its view plane shifted so that points at the focus
distance are at the same pixel in all views (off-axis). The cone is the angle between the two outermost cameras as seen
from the focus plane.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..settings.views import ViewsSettings
from .camera import PerspectiveCamera, ViewPlane


def cone_baseline(cone_degrees: float, focus_distance: float) -> float:
    """Return the distance between the outermost cameras of a cone, in the units of the focus distance."""
    return 2.0 * focus_distance * math.tan(math.radians(0.5 * cone_degrees))


def baseline_of(views: ViewsSettings, focus_distance: float) -> float:
    """Return the distance between the outermost cameras of the views that are asked for, in scene units."""
    if views.baseline is not None:
        return views.baseline
    assert views.cone_degrees is not None
    return cone_baseline(views.cone_degrees, focus_distance)


def cone_degrees(baseline: float, focus_distance: float) -> float:
    """Return the cone, in degrees, of outermost cameras so far apart: the inverse of `cone_baseline`."""
    return math.degrees(2.0 * math.atan(0.5 * baseline / focus_distance))


def offsets_of(count: int, baseline: float) -> list[float]:
    """Return the places of so many cameras, at least 2, beside the one in the middle: from the leftmost (negative) to
    the rightmost, evenly spaced over the baseline."""
    return [baseline * (number / (count - 1) - 0.5) for number in range(count)]


def beside(camera: PerspectiveCamera, offset: float, focus_distance: float) -> PerspectiveCamera:
    """Return the camera moved to its right by an offset, in scene units, that shows points at the focus distance at the
    same pixels."""
    move = np.eye(4)
    move[0, 3] = offset
    shift = offset / focus_distance
    plane = camera.plane
    moved = ViewPlane(plane.left - shift, plane.right - shift, plane.bottom, plane.top)
    return replace(camera, world_from_camera=camera.world_from_camera @ move, plane=moved)
