"""The order in which views of cameras placed by hand are made: along a way on which each camera is near the one before.

Cameras on a line come one after the other along it. Those of any other rig come along some short way through them, so
that what lies between two rendered views is always seen from near those two.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .camera import PerspectiveCamera

MAX_OFF_LINE_SHARE = 0.02
"""Distance of a camera from a line, as a share of the distance between the outermost ones, up to which it stands on
the line."""

MAX_TURN_RADIANS = np.radians(10.0)
"""Angle between the directions of two neighbouring cameras up to which they show the scene as a display needs it."""


def order_of(cameras: Sequence[PerspectiveCamera]) -> list[int]:
    """Return the numbers of cameras, at least one, in the order in which their views are made: from one of the two that
    are farthest apart, of which the more left one, each time to the nearest that has no place yet."""
    apart = _apart(cameras)
    ends = np.unravel_index(np.argmax(apart), apart.shape)
    across = _places(cameras) @ _rightwards(cameras)
    order = [int(min(ends, key=lambda number: across[number]))]
    waiting = set(range(len(cameras))) - set(order)
    while waiting:
        nearest = min(sorted(waiting), key=lambda number: apart[order[-1], number])
        order.append(nearest)
        waiting.remove(nearest)
    return order


def line_order(cameras: Sequence[PerspectiveCamera]) -> list[int] | None:
    """Return the numbers of cameras that stand on a line across their viewing direction, from the leftmost to the
    rightmost; None where they do not, or neighbours look in other directions."""
    places = _places(cameras)
    centred = places - places.mean(axis=0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    along = axes[0] * (1.0 if axes[0] @ _rightwards(cameras) >= 0.0 else -1.0)
    order = [int(number) for number in np.argsort(places @ along)]
    length = float(np.ptp(places @ along))
    off = np.linalg.norm(centred - np.outer(centred @ along, along), axis=1)
    ahead = _directions(cameras)[order]
    cosines = np.sum(ahead[1:] * ahead[:-1], axis=1)
    is_line = off.max() <= MAX_OFF_LINE_SHARE * length and cosines.min() >= np.cos(MAX_TURN_RADIANS)
    crosses = abs(float(along @ ahead.mean(axis=0))) < np.sqrt(0.5)
    return order if length > 0.0 and is_line and crosses else None


def _apart(cameras: Sequence[PerspectiveCamera]) -> NDArray[np.float64]:
    """Return how far cameras are from each other (N, N): their distance, as a share of the largest one, and the angle
    between their directions in radians, added up."""
    places, ahead = _places(cameras), _directions(cameras)
    distance = np.linalg.norm(places[:, None] - places, axis=-1)
    angle = np.arccos(np.clip(ahead @ ahead.T, -1.0, 1.0))
    return distance / max(float(distance.max()), np.finfo(np.float64).tiny) + angle


def _places(cameras: Sequence[PerspectiveCamera]) -> NDArray[np.float64]:
    """Return the places of cameras in the world (N, 3)."""
    return np.stack([camera.world_from_camera[:3, 3] for camera in cameras]).astype(np.float64)


def _directions(cameras: Sequence[PerspectiveCamera]) -> NDArray[np.float64]:
    """Return the directions (N, 3), of length 1, in which cameras look: through the middle of their pictures."""
    found = []
    for camera in cameras:
        plane = camera.plane
        middle = np.array([0.5 * (plane.left + plane.right), 0.5 * (plane.bottom + plane.top), -1.0])
        ahead = camera.world_from_camera[:3, :3] @ middle
        found.append(ahead / np.linalg.norm(ahead))
    return np.array(found, np.float64)


def _rightwards(cameras: Sequence[PerspectiveCamera]) -> NDArray[np.float64]:
    """Return the mean direction in the world that is to the right in the cameras' pictures (3,)."""
    return np.array([camera.world_from_camera[:3, 0] for camera in cameras], np.float64).mean(axis=0)
