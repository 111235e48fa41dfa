"""Places for the labels of a chart's points, so that none covers another, a point, or more of a line than it must; and
places for those of its lines, one below the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

LABEL_GAP_PIXELS = 7.0
"""Distance of a label from its point; all lengths are in the units of the points, pixels as a rule."""

LABEL_DISTANCES_IN_GAPS = (1.0, 2.2, 3.6, 5.2, 7.2, 9.6, 12.5, 16.0, 20.0, 25.0)
"""The distances that are tried, in gaps."""

LABEL_DIRECTIONS = 24
MAX_SWEEPS = 12
RANDOM_ORDERS = 8
"""Random orders in which all labels are placed: the first label has the choice."""

# Penalties of one place, in gaps of distance from the point. A leader is the line from a label to its point.
OVERLAP, OUTSIDE, CROSSING, LINE, ALIGNED = 1000.0, 1000.0, 40.0, 3.0, 0.4
LABEL_MARGIN_PIXELS = np.array((6.0, 2.0))
"""Free space beside each label, and above and below it."""

Frame = tuple[float, float, float, float]


def place_labels(
    points: NDArray, sizes: NDArray, *, obstacles: NDArray, lines: NDArray, frame: Frame
) -> NDArray[np.float64]:
    """Return the lower left corners (N, 2) of the labels of N points, so that they cover each other, the points and the
    lines as little as possible.

    points (N, 2) are the places of the points and sizes (N, 2) the widths and heights of their labels, all in pixels.
    obstacles (K, 4) are boxes (left, bottom, right, top) that no label should cover; lines (L, 4) are small boxes along
    lines, which count less. The labels stay inside the box `frame`. Each label moves to its best place given all
    others, until none moves. This is done from several random orders, and the best result is taken.
    """
    rng = np.random.default_rng(0)
    ends = []
    for _ in range(RANDOM_ORDERS):
        ends.append(_settle(points, sizes, obstacles.reshape(-1, 4), lines.reshape(-1, 4), frame, rng))
    return min(ends, key=lambda end: end[0])[1]


def _settle(
    points: NDArray, sizes: NDArray, obstacles: NDArray, lines: NDArray, frame: Frame, rng: np.random.Generator
) -> tuple[float, NDArray]:
    """Return the summed penalty and the corners (N, 2) of the labels after they were placed, in one random order from
    `rng`, and moved until none moved any more. The other arguments are as in `place_labels`."""
    corners, prices = np.full((len(points), 2), np.nan), np.zeros(len(points))
    order = rng.permutation(len(points))
    for _ in range(MAX_SWEEPS):
        before = corners.copy()
        for k in order:
            placed = ~np.isnan(corners[:, 0]) & (np.arange(len(points)) != k)
            solid = np.concatenate([obstacles, _boxes(corners[placed], sizes[placed])])
            ends = nearest(points[placed], corners[placed], sizes[placed])
            candidates, price = _candidates(points[k], sizes[k], frame)
            price += _price(points[k], sizes[k], candidates, solid, lines)
            price += _entangled(points[k], sizes[k], candidates, points[placed], ends)
            best = np.argmin(price)
            corners[k], prices[k] = candidates[best], price[best]
        if np.array_equal(before, corners, equal_nan=True):
            break
    return float(prices.sum()), corners


def nearest(points: NDArray, corners: NDArray, sizes: NDArray) -> NDArray:
    """Return the points (N, 2) of the labels that are nearest to their points (N, 2): there the line from the point
    ends. corners and sizes are (N, 2)."""
    return np.clip(points, corners, corners + sizes)


def _boxes(corners: NDArray, size: NDArray) -> NDArray:
    """Return the boxes (N, 4) of labels with a margin around them, from their lower left corners and their sizes."""
    return np.concatenate([corners - LABEL_MARGIN_PIXELS, corners + size + LABEL_MARGIN_PIXELS], axis=1)


def _candidates(point: NDArray, size: NDArray, frame: Frame) -> tuple[NDArray, NDArray]:
    """Return the corners (M, 2) of all places that are tried for a label around its point, and their penalties (M,) for
    distance and for leaving the frame."""
    angle = np.arange(LABEL_DIRECTIONS) * (2.0 * np.pi / LABEL_DIRECTIONS)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    direction /= np.abs(direction).max(axis=1, keepdims=True)
    reach = np.repeat(LABEL_DISTANCES_IN_GAPS, LABEL_DIRECTIONS)
    direction = np.tile(direction, (len(LABEL_DISTANCES_IN_GAPS), 1))
    corners = point + direction * (0.5 * size + LABEL_GAP_PIXELS * reach[:, None]) - 0.5 * size
    outside = np.maximum(np.subtract(frame[:2], corners), 0.0) + np.maximum(corners + size - frame[2:], 0.0)
    aside = np.abs(direction).min(axis=1) > 1e-6
    return corners, reach + ALIGNED * aside + OUTSIDE * size[1] * outside.sum(axis=1)


def _price(point: NDArray, size: NDArray, corners: NDArray, solid: NDArray, lines: NDArray) -> NDArray:
    """Return the penalty (M,) of each of M places of a label: for covering `solid` boxes or `lines`, and for a leader
    (the line from point to label) that runs through solid boxes. Boxes in which the point itself lies do not count for
    the leader."""
    boxes = _boxes(corners, size)
    apart = ~((point > solid[:, :2]) & (point < solid[:, 2:])).all(axis=1)
    starts = np.broadcast_to(point, corners.shape)
    met = _meets(starts, nearest(starts, corners, size), solid[apart]).sum(axis=1)
    covered = OVERLAP * _common(boxes, solid).sum(axis=1) + LINE * (_common(boxes, lines) > 0.0).sum(axis=1)
    return covered + CROSSING * met


def _entangled(point: NDArray, size: NDArray, corners: NDArray, others: NDArray, ends: NDArray) -> NDArray:
    """Return the penalty (M,) of each of M places of a label for crossing leaders: those from the points `others` to
    their `ends` may neither cross this label's leader nor run under the label."""
    starts = np.broadcast_to(point, corners.shape)
    crossed = _cross(starts, nearest(starts, corners, size), others, ends)
    covered = _meets(others, ends, _boxes(corners, size)).T
    return CROSSING * (crossed | covered).sum(axis=1)


def _common(boxes: NDArray, others: NDArray) -> NDArray:
    """Return the area (M, K) that each of M boxes has in common with each of K others."""
    low = np.maximum(boxes[:, None, :2], others[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], others[None, :, 2:])
    return np.maximum(high - low, 0.0).prod(axis=2)


def _meets(starts: NDArray, ends: NDArray, boxes: NDArray) -> NDArray[np.bool_]:
    """Return (M, K): True where the line from a start (M, 2) to its end (M, 2) runs through a box of K; by the method
    of slabs."""
    start, step = starts[:, None], (ends - starts)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = (boxes[:, :2] - start) / step, (boxes[:, 2:] - start) / step
    between = (start > boxes[:, :2]) & (start < boxes[:, 2:])
    still = np.broadcast_to(step == 0.0, low.shape)
    enter = np.where(still, np.where(between, -np.inf, np.inf), np.minimum(low, high)).max(axis=2)
    leave = np.where(still, np.where(between, np.inf, -np.inf), np.maximum(low, high)).min(axis=2)
    return (np.maximum(enter, 0.0) < np.minimum(leave, 1.0)) & (leave > enter)


def _cross(a: NDArray, b: NDArray, c: NDArray, d: NDArray) -> NDArray[np.bool_]:
    """Return (M, K): True where a line from a to b (M, 2) crosses a line from c to d (K, 2)."""

    def side(start: NDArray, end: NDArray, place: NDArray) -> NDArray:
        along, there = end - start, place - start
        return along[..., 0] * there[..., 1] - along[..., 1] * there[..., 0] > 0.0

    a, b, c, d = a[:, None], b[:, None], c[None], d[None]
    return (side(a, b, c) != side(a, b, d)) & (side(c, d, a) != side(c, d, b))


def spread(places: Sequence[float], distance: float, height: float) -> NDArray[np.float64]:
    """Return places for labels in a column, in the order of `places`, with at least `distance` between neighbours, and
    between 0 and `height`, moved as little as possible.

    The order from low to high is kept; of equal places the first stays lowest. If there is not enough room, they go on
    above `height`. Solved as a monotone regression, by its min-max formula.
    """
    if not places:
        return np.zeros(0)
    order = np.argsort(places, kind="stable")
    steps = distance * np.arange(len(places))
    free = np.asarray(places)[order] - steps
    count = range(len(places))
    moved = [max(min(free[j : k + 1].mean() for k in count[i:]) for j in count[: i + 1]) for i in count]
    found = np.empty(len(places))
    found[order] = np.clip(moved, 0.0, max(height - steps[-1], 0.0)) + steps
    return found
