"""Target pixels on which nothing landed, and why: the source's frame ends, or something stood before them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..images.bands import bands
from ..images.lookup import touches
from ..images.reasons import Reason
from ..views.camera import Camera, target_px_from_source_px
from ..views.panorama import has_lens_edge, is_beyond_lens
from .forward import Warp
from .tuning import TUNING


def empty_reasons(warp: Warp, source: Camera, target: Camera) -> NDArray[np.uint16]:
    """Return (H, W) the `Reason` flag of each target pixel on which nothing landed, OUTSIDE or DISOCCLUDED; 0
    elsewhere.

    A pixel is OUTSIDE where the source's frame does not hold what it shows, and DISOCCLUDED where something hides that
    from the source. The surface is unknown, but it lies behind its surroundings: of the next pixels with an answer to
    its left and right, the depth of the farther one stands in for its own. A row without any answer is OUTSIDE, and so
    is a place that landed, but within the half pixel by which the grid reaches beyond the source's frame.
    """
    flags = np.empty(warp.nearness.shape, np.uint16)
    edge = _lens_edges(source, target)
    for rows in bands(flags.shape):
        x, y, nearness = warp.x[rows], warp.y[rows], warp.nearness[rows]
        beyond = (x < 0) | (x > source.width) | (y < 0) | (y > source.height)
        if edge is not None:
            beyond |= edge.target[rows] | touches(edge.source, x, y, share=0.0)
        np.multiply(beyond, Reason.OUTSIDE.bit, out=flags[rows])
        row, column, behind = _behind_empty(nearness)
        if row.size:
            seen = _is_within(source, target, row + rows.start, column, behind)
            flags[rows][row, column] = np.where(seen, Reason.DISOCCLUDED.bit, Reason.OUTSIDE.bit)
    return flags


@dataclass(frozen=True)
class _LensEdges:
    """Pixels (H, W) at the edge of fisheye lenses, which mix with the black beyond it: in source and target."""

    source: NDArray[np.bool_]
    target: NDArray[np.bool_]


def _lens_edges(source: Camera, target: Camera) -> _LensEdges | None:
    """Return the pixels at the edge of the cameras' lenses; None where nothing of them is seen."""
    if not has_lens_edge(source) and not has_lens_edge(target):
        return None
    edges = _LensEdges(*(_at_lens_edge(camera) for camera in (source, target)))
    return edges if edges.source.any() or edges.target.any() else None


def _at_lens_edge(camera: Camera) -> NDArray[np.bool_]:
    """Return (H, W) the pixels of a camera whose filter reaches beyond the edge of the lens on one side alone."""
    edge = np.zeros((camera.height, camera.width), bool)
    if not has_lens_edge(camera):
        return edge
    x, reach = np.arange(camera.width) + 0.5, TUNING.lens_edge_pixels
    for rows in bands(edge.shape):
        y = np.arange(rows.start, rows.stop)[:, None] + 0.5
        beyond = [is_beyond_lens(camera, x + right, y + down) for right in (-reach, reach) for down in (-reach, reach)]
        edge[rows] = np.any(beyond, axis=0) & ~np.all(beyond, axis=0)
    return edge


def _is_within(source: Camera, target: Camera, rows: NDArray, columns: NDArray, nearness: NDArray) -> NDArray[np.bool_]:
    """Return (N,) whether the source's frame holds the points that these target pixels show at this nearness (N,).

    rows, columns (N,) are the pixels; the nearness is the target's. False where it is not finite.
    """
    known = np.isfinite(nearness)
    sky = target.nearness_from_depth(np.array(np.inf))
    depth = target.depth_from_nearness(np.where(known, nearness, sky).astype(np.float64))
    x, y, _ = target_px_from_source_px(target, source, columns + 0.5, rows + 0.5, depth)
    return known & (x > 0) & (x < source.width) & (y > 0) & (y < source.height)


def _behind_empty(nearness: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Return row and column (N,) of the empty pixels of a nearness (h, W), and the nearness (N,) that is assumed behind
    each.

    Empty is -inf. The nearness is the smaller one of the last answer to the left and the first to the right in the row;
    it is NaN in a row without any.
    """
    height, width = nearness.shape
    # With a column that is never empty between them, all rows are one.
    empty = np.zeros((height, width + 1), bool)
    np.equal(nearness, -np.inf, out=empty[:, :width])
    flat = empty.ravel()
    starts = np.flatnonzero(np.diff(flat, prepend=False) & flat)
    stops = np.flatnonzero(np.diff(flat, prepend=False) & ~flat)
    row, first = np.divmod(starts, width + 1)
    after = stops - row * (width + 1)
    from_left = np.where(first > 0, nearness[row, np.maximum(first - 1, 0)], np.nan)
    from_right = np.where(after < width, nearness[row, np.minimum(after, width - 1)], np.nan)
    length = after - first
    column = np.arange(length.sum()) - np.repeat(np.cumsum(length) - length - first, length)
    return np.repeat(row, length), column, np.repeat(np.fmin(from_left, from_right), length)
