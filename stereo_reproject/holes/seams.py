"""Edges between surfaces that two sources show: neither source has both sides of the edge."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..images.masks import dilate
from ..images.passes import COLOUR_PASS
from ..settings.accuracy import Accuracy
from ..views.camera import Camera, PerspectiveCamera, disparity_per_nearness, target_from_source
from ..warp.discontinuities import disparity_steps
from ..warp.scanline import LARGEST_NEARNESS
from ..warp.warped_view import WarpedView
from .silhouettes import differing, edge_band


def seams(warped: WarpedView, sources: Sequence[Camera], target: Camera, accuracy: Accuracy) -> NDArray[np.bool_]:
    """Return (H, W) target pixels at a depth discontinuity whose two sides come from different sources and differ in
    colour.

    A plain render filters colours over such an edge as over any other; the silhouette rule of each source sees only its
    own side. A step in depth counts by what it may move at most in any of the sources.
    """
    index, radius = warped.warp.source, accuracy.silhouette_radius
    border = np.zeros(index.shape, bool)
    for here, there in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
        differs = index[here] != index[there]
        border[here] |= differs
        border[there] |= differs
    covered = warped.warp.covered
    largest = np.float32(max(_largest_disparity_per_nearness(target, source) for source in sources))
    with np.errstate(over="ignore"):
        disparity = np.where(covered, warped.warp.nearness, np.float32(np.nan)) * largest
    disparity = np.clip(disparity, -LARGEST_NEARNESS, LARGEST_NEARNESS)
    band = edge_band(disparity_steps(disparity), threshold=accuracy.silhouette_step, radius=radius)
    band &= dilate(border, radius)
    colour = warped.passes[COLOUR_PASS]
    return differing(band, disparity, colour, tolerance=accuracy.colour_tolerance, unknown=~covered)


def _largest_disparity_per_nearness(target: Camera, source: Camera) -> float:
    """Return the largest number of pixels that a point may move for one unit of nearness, anywhere in the picture.

    For perspective cameras it is computed as if the source stood beside the target, at the same distance. A source that
    stands ahead moves nothing in the middle of the picture, but does elsewhere.
    """
    if not isinstance(target, PerspectiveCamera) or not isinstance(source, PerspectiveCamera):
        return disparity_per_nearness(target, source)
    baseline = float(np.linalg.norm(target_from_source(target, source)[:3, 3]))
    return baseline * source.width / (source.plane.right - source.plane.left)
