"""Where the labels of a chart's points go, so that none covers another, a point, or more of a line than it must."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

GAP = 7.0
"""Distance of a label from its point; all lengths are in the units of the points, pixels as a rule."""

REACH = (1.0, 2.2, 3.6, 5.2, 7.2, 9.6, 12.5, 16.0, 20.0, 25.0)
"""Further distances that are tried, in gaps."""

DIRECTIONS = 16
SWEEPS = 12
STEPS = 40
"""Places along a leader, the line from a label to its point, that are looked at."""

# Prices of one place, in gaps of distance from the point.
OVERLAP, CROSSING, LINE, ALIGNED = 1000.0, 40.0, 3.0, 0.4
MARGIN = 2.0
"""Left free around each label."""

Frame = tuple[float, float, float, float]


def place_labels(
    points: NDArray, sizes: NDArray, *, obstacles: NDArray, lines: NDArray, frame: Frame
) -> NDArray[np.float64]:
    """Lower left corners (N, 2) of labels of `sizes` (N, 2) for `points` (N, 2).

    obstacles (K, 4) are boxes (left, bottom, right, top) that no label may cover, lines (L, 4) small boxes that it
    should not; the labels stay inside `frame`. Each label takes its best place given all others, until none moves.
    """
    corners = np.full((len(points), 2), np.nan)
    crowded = np.argsort([-np.sum(np.exp(-np.hypot(*(points - point).T) / 60.0)) for point in points], kind="stable")
    for _ in range(SWEEPS):
        before = corners.copy()
        for k in crowded:
            placed = ~np.isnan(corners[:, 0]) & (np.arange(len(points)) != k)
            boxes = _boxes(corners[placed], sizes[placed])
            solid = np.concatenate([obstacles.reshape(-1, 4), boxes])
            leaders = _along(leader(points[placed], corners[placed], sizes[placed]))
            corners[k] = _best(points[k], sizes[k], solid, leaders, lines.reshape(-1, 4), frame)
        if np.array_equal(before, corners, equal_nan=True):
            break
    return corners


def leader(points: NDArray, corners: NDArray, sizes: NDArray) -> NDArray[np.float64]:
    """(N, STEPS, 2): places from each point to the nearest of its label."""
    nearest = np.clip(points, corners, corners + sizes)
    along = np.linspace(0.0, 1.0, STEPS)[:, None]
    return points[:, None] + along * (nearest - points)[:, None]


def _boxes(corners: NDArray, sizes: NDArray) -> NDArray:
    return np.concatenate([corners - MARGIN, corners + sizes + MARGIN], axis=1)


def _along(leaders: NDArray) -> NDArray:
    places = leaders.reshape(-1, 2)
    return np.concatenate([places - MARGIN, places + MARGIN], axis=1)


def _best(point: NDArray, size: NDArray, solid: NDArray, leaders: NDArray, lines: NDArray, frame: Frame) -> NDArray:
    """The cheapest corner of one label."""
    corners, reach, aligned = _candidates(point, size)
    boxes = _boxes(corners, np.broadcast_to(size, corners.shape))
    own = leader(np.broadcast_to(point, corners.shape), corners, np.broadcast_to(size, corners.shape))
    price = reach + ALIGNED * ~aligned
    price += OVERLAP * _covered(boxes, solid).sum(axis=1)
    price += LINE * (_covered(boxes, lines) > 0.0).sum(axis=1)
    price += CROSSING * (_covered(boxes, leaders) > 0.0).any(axis=1)
    price += CROSSING * (_met(point, own, solid) + (_met(point, own, leaders) > 0))
    low, high = np.array(frame[:2]), np.array(frame[2:])
    outside = np.maximum(low - boxes[:, :2], 0.0) + np.maximum(boxes[:, 2:] - high, 0.0)
    price += OVERLAP * size[1] * outside.sum(axis=1)
    return corners[np.argmin(price)]


def _candidates(point: NDArray, size: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Corners (M, 2) of the places around a point, how far off they are, and whether straight to a side of it."""
    angle = np.arange(DIRECTIONS) * (2.0 * np.pi / DIRECTIONS)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    direction /= np.abs(direction).max(axis=1, keepdims=True)
    reach = np.repeat(REACH, DIRECTIONS)
    direction = np.tile(direction, (len(REACH), 1))
    centre = point + direction * (0.5 * size + GAP * reach[:, None])
    return centre - 0.5 * size, reach, np.abs(direction).min(axis=1) < 1e-6


def _covered(boxes: NDArray, others: NDArray) -> NDArray:
    """(M, K): the area that each pair has in common."""
    low = np.maximum(boxes[:, None, :2], others[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], others[None, :, 2:])
    return np.maximum(high - low, 0.0).prod(axis=2)


def _met(point: NDArray, leaders: NDArray, boxes: NDArray) -> NDArray:
    """(M,): how many of the boxes each leader runs through; those around the point itself are left out."""
    apart = ~((point > boxes[:, :2]) & (point < boxes[:, 2:])).all(axis=1)
    inside = (leaders[:, :, None] > boxes[apart, :2]) & (leaders[:, :, None] < boxes[apart, 2:])
    return inside.all(axis=3).any(axis=1).sum(axis=1)
