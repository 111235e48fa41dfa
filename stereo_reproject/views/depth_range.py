"""Depths that a camera sees at a few places of its picture: their range, and what the frame's edges cut in front of the
screen."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .camera import Camera

LEFT_OUT_SHARE = 0.01
"""Share of the picture that is left out at either end of the range: a twig before the lens, or a gap between boards,
is not to decide how deep a scene is shown."""

CUT_SHARE = 0.1
"""Share of an edge's height from which a thing in front of the screen counts as cut by it. Of less, such as a corner of
the floor, viewers take no notice."""

MIN_CUT_PERCENT = 0.2
"""Parallax in front of the screen, in percent of the width, from which a cut is noticed: 4 pixels of 1920."""

SAME_DEPTH_SHARE = 0.02
"""Difference of two depths, as a share of them, up to which they are taken for those of the same thing."""

FAR_EYE = {"left": "right", "right": "left"}
"""The eye that loses more of a thing in front of the screen at each edge of the frame: that of the other side."""


@dataclass(frozen=True)
class EdgeHit:
    """A thing that is seen at the frame's edge: the side, "left" or "right", the thing's name, "" where only its depth
    is known, and its depth.
    """

    side: str
    name: str
    depth: float


@dataclass(frozen=True)
class FramePixels:
    """The whole frame in the pixel positions of a camera that shows a part of it: left and top, 0 or less, and size."""

    left: float
    top: float
    width: float
    height: float


def grid_positions(frame: FramePixels, columns: int, rows: int) -> tuple[NDArray, NDArray]:
    """Return pixel positions x and y, (rows * columns,) each: the centres of as many equal cells of the frame."""
    x = frame.left + frame.width * (np.arange(columns) + 0.5) / columns
    y = frame.top + frame.height * (np.arange(rows) + 0.5) / rows
    across, down = np.meshgrid(x, y)
    return across.ravel(), down.ravel()


def edge_positions(frame: FramePixels, side: str, rows: int) -> tuple[NDArray, NDArray]:
    """Return pixel positions x and y, (rows,) each, on the frame's edge on this side, "left" or "right"."""
    x = frame.left + (frame.width if side == "right" else 0.0)
    return np.full(rows, x), frame.top + frame.height * (np.arange(rows) + 0.5) / rows


def hits_of_pair(depths: Mapping[str, NDArray], rows: int) -> tuple[EdgeHit, ...]:
    """Return what a rendered pair shows at the frame's edges, without names: at as many places of each edge as there
    are `rows`. depths are the depths (H, W) of both eyes over the whole frame, by "left" and "right".
    """
    found = []
    for side, eye in FAR_EYE.items():
        column = depths[eye][:, -1 if side == "right" else 0]
        places = ((np.arange(rows) + 0.5) * column.size / rows).astype(int)
        found += [EdgeHit(side, "", float(depth)) for depth in column[places] if depth > 0.0 and np.isfinite(depth)]
    return tuple(found)


def named(hits: Iterable[EdgeHit], seen: Iterable[EdgeHit]) -> tuple[EdgeHit, ...]:
    """Return the hits with names: for each the name of the thing in `seen` at the same edge whose depth is nearest to
    its own, within SAME_DEPTH_SHARE; "" where there is none.
    """
    seen = tuple(seen)

    def name_of(hit: EdgeHit) -> str:
        there = [other for other in seen if other.side == hit.side]
        nearest = min(there, key=lambda other: abs(other.depth - hit.depth), default=hit)
        return nearest.name if abs(nearest.depth - hit.depth) <= SAME_DEPTH_SHARE * hit.depth else ""

    return tuple(replace(hit, name=name_of(hit)) for hit in hits)


def typical_range(depth: NDArray) -> tuple[float, float] | None:
    """Return the nearest and the farthest of the depths (N,) that were seen at places spread over the picture, with
    LEFT_OUT_SHARE of them left out at either end; None where nothing but the sky, +inf, was seen.
    """
    if not np.isfinite(depth).any():
        return None
    near, far = np.quantile(depth, (LEFT_OUT_SHARE, 1.0 - LEFT_OUT_SHARE), method="closest_observation")
    # A small thing before the sky is all that there is to see.
    return (float(near) if np.isfinite(near) else float(depth.min())), float(far)


def cut_in_front(hits: Iterable[EdgeHit], depth: float, rows: int) -> list[tuple[str, str]]:
    """Return names and sides of what is nearer than `depth` on at least CUT_SHARE of an edge, the largest first. rows
    is the number of places at which each edge was looked at. What has no name counts as a part of the largest thing at
    its edge that has one.
    """
    seen = Counter((hit.name, hit.side) for hit in hits if hit.depth < depth)
    for side in FAR_EYE:
        with_name = [key for key in seen if key[0] and key[1] == side]
        if with_name:
            seen[max(with_name, key=lambda key: seen[key])] += seen.pop(("", side), 0)
    return [key for key, count in seen.most_common() if count >= CUT_SHARE * rows]


def frame_corners(camera: Camera, frame: FramePixels, depth: float) -> NDArray[np.float64]:
    """Return the places in the world (4, 3) of the frame's corners at this depth: lower left, lower right, upper right,
    upper left.
    """
    right, bottom = frame.left + frame.width, frame.top + frame.height
    x = np.array([frame.left, right, right, frame.left])
    y = np.array([bottom, bottom, frame.top, frame.top])
    origin, direction = camera.ray_from_px(x, y)
    local = np.stack([np.broadcast_to(o + depth * d, x.shape) for o, d in zip(origin, direction, strict=True)], axis=1)
    return local @ camera.world_from_camera[:3, :3].T + camera.world_from_camera[:3, 3]
