"""The corners of the grid's quads, projected into the target's picture in double precision."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..images.bands import bands
from ..views.camera import Camera, goes_round, is_planar, target_px_from_source_px
from .grid import CELL_QUADS, Grid, lattice_depth

CORNER_ROUNDING = 2.0**-18
"""Pixels to which corners in a panorama are rounded, and all corners on a GPU: far above double precision, and far
below what shows."""

Corners = tuple[NDArray, NDArray, NDArray]
"""Target x and y, in pixels, and nearness to the target's camera, of the corners of quads."""


def project_corners(source: Camera, target: Camera, x: NDArray, y: NDArray, depth: NDArray) -> Corners:
    """Return target x, target y and nearness, of one shape, of the points that the source sees at positions x, y and
    depth.

    x, y and depth broadcast. The result is NaN where a point lies behind the target's camera.
    """
    if is_planar(source):
        target_x, target_y, target_depth = target_px_from_source_px(source, target, x, y, depth)
    else:
        target_x, target_y, target_depth = _past_poles(source, target, x, y, depth)
    if not is_planar(target):
        # An arc tangent's last digit depends on its place in an array; two cells must agree on the corners they share.
        target_x, target_y = (np.round(a / CORNER_ROUNDING) * CORNER_ROUNDING for a in (target_x, target_y))
    nearness = target.nearness_from_depth(target_depth)
    shape = np.broadcast_shapes(depth.shape, np.shape(target_x))
    whole_x, whole_y, whole_nearness = (
        np.ascontiguousarray(np.broadcast_to(a, shape)) for a in (target_x, target_y, nearness)
    )
    return whole_x, whole_y, whole_nearness


def lattice_corners(depth: NDArray, source: Camera, target: Camera, grid: Grid) -> NDArray[np.float32]:
    """Return (H + 2, W + 2, 4) how far all corners of the quads that the grid draws move to the right and down on their
    way into the target, in pixels, their nearness to the target's camera, and 1.

    depth (H, W) is the source's; of the result, corner (i, j) stands at pixel position (j - 0.5, i - 0.5). It is 0 for
    corners that no quad has, and for those that the target's camera does not see. Where the target shows a direction
    more than once, a corner moves to the nearest place.
    """
    drawn, lattice = _drawn_corners(grid), lattice_depth(depth, wraps=goes_round(source))
    result = np.zeros((*drawn.shape, 4), np.float32)
    for rows in bands(drawn.shape):
        i, j = np.nonzero(drawn[rows])
        i += rows.start
        x, y, nearness = project_corners(source, target, j - 0.5, i - 0.5, lattice[i, j])
        right, down = x - (j - 0.5), y - (i - 0.5)
        if np.isfinite(target.period_px):
            right -= target.period_px * np.round(right / target.period_px)
        moved = np.stack([right, down, nearness], axis=-1)
        seen = np.isfinite(moved).all(axis=-1)
        result[i[seen], j[seen], :3] = moved[seen]
        result[i[seen], j[seen], 3] = 1.0
    return result


def _drawn_corners(grid: Grid) -> NDArray[np.bool_]:
    """Return (H + 2, W + 2) the vertices of the grid that are corners of the quads that are drawn: all of a subdivided
    cell, and the four of a coarse one."""
    height, width = grid.height + 1, grid.width + 1
    fine = grid.subdivided.repeat(CELL_QUADS, axis=0).repeat(CELL_QUADS, axis=1)[:height, :width]
    corners = np.zeros((height + 1, width + 1), bool)
    for down in (0, 1):
        for right in (0, 1):
            corners[down : height + down, right : width + right] |= fine
    ends = (np.append(np.arange(0, length, CELL_QUADS), length) for length in (height, width))
    corners[np.ix_(*ends)] = True
    return corners


def _past_poles(
    source: Camera, target: Camera, x: NDArray, y: NDArray, depth: NDArray
) -> tuple[NDArray, NDArray, NDArray]:
    """Return what `target_px_from_source_px` does for a panoramic source, with the places of corners above and below
    the picture continued from those within: beyond a pole there are rays that belong to the other side of the picture.
    """
    within = np.clip(y, 0.5, source.height - 0.5)
    beyond = y - within
    here = target_px_from_source_px(source, target, x, within, depth)
    if not beyond.any():
        return here
    back = target_px_from_source_px(source, target, x, within - np.sign(beyond), depth)
    across, down = here[0] - back[0], here[1] - back[1]
    if np.isfinite(target.period_px):
        across = across - target.period_px * np.round(across / target.period_px)
    beyond = np.abs(beyond)
    return here[0] + beyond * across, here[1] + beyond * down, here[2]
