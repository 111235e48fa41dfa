"""Things seen through a gap that only looks open: they lie behind what the source hides there.

Where depth jumps between two neighbouring pixels of the source, the target sees a gap between them, and nobody knows
what is in it. What lands in such a gap from a distant part of the source, and is farther away than the farther
neighbour by more than the jump itself, is hidden as far as anyone knows: the farther surface goes on behind the nearer
one. What lands there from nearby, as sky between leaves does, is seen.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..views.camera import Camera, disparity_per_nearness, target_px_from_source_px
from ..warp.discontinuities import DepthDiscontinuities
from ..warp.forward import Warp
from ..warp.scanline import row_disparity_of
from .tuning import TUNING


def behind_tears(
    depth: NDArray[np.float32], steps: DepthDiscontinuities, source: Camera, target: Camera, warp: Warp
) -> NDArray[np.bool_]:
    """Return (H, W) target pixels that show something behind a tear between two neighbours in a row of the source.

    depth (H, W) and steps are the source's. No pixel is set unless both cameras show each point in the same row.
    """
    result = np.zeros(warp.nearness.shape, bool)
    if row_disparity_of(source, target) is None:
        return result
    torn, _ = steps.torn()
    rows, columns = np.nonzero(torn)
    ends = [_landed(depth, rows, columns + k, source, target) for k in (0, 1)]
    x, nearness = (np.stack([end[part] for end in ends]) for part in (0, 1))
    start, stop = _centres_between(x, result.shape[1])
    far, near = nearness.min(axis=0), nearness.max(axis=0)
    per_nearness = max(abs(disparity_per_nearness(target, source)), float(np.finfo(np.float32).tiny))
    # Farther than the farther end by as much as that is farther than the nearer one, and from so far away at least.
    bound = far - np.maximum(near - far, TUNING.min_distant_width_share * source.width / per_nearness)
    count = stop - start
    before = np.cumsum(count) - count
    row, column = np.repeat(rows, count), np.arange(count.sum()) - np.repeat(before - start, count)
    hidden = warp.covered[row, column] & (warp.nearness[row, column] < np.repeat(bound, count))
    result[row[hidden], column[hidden]] = True
    return result


def _landed(
    depth: NDArray[np.float32], rows: NDArray[np.intp], columns: NDArray[np.intp], source: Camera, target: Camera
) -> tuple[NDArray, NDArray]:
    """Return where pixels of the source land in the target: their x, in pixels, and their nearness to its camera, (N,)
    each; NaN for those that do not."""
    x, _, away = target_px_from_source_px(source, target, columns + 0.5, rows + 0.5, depth[rows, columns])
    with np.errstate(divide="ignore", invalid="ignore"):
        return x, target.nearness_from_depth(away)


def _centres_between(x: NDArray, width: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first column and the one after the last, (N,) each, of the pixel centres between two places x (2, N)
    in pixels; none where a place is NaN."""
    place = np.clip(np.nan_to_num(x, nan=-1.0), 0.0, width)
    start = np.ceil(place.min(axis=0) - 0.5).astype(np.intp)
    stop = np.floor(place.max(axis=0) - 0.5).astype(np.intp) + 1
    return start, np.where(np.isnan(x).any(axis=0), start, np.maximum(stop, start))
