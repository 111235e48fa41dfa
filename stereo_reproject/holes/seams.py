"""Edges between surfaces that two sources show: neither source has both sides of the edge."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..images.masks import dilate
from ..images.passes import COLOUR_PASS
from ..settings.accuracy import Accuracy
from ..views.camera import Camera, disparity_per_nearness
from ..warp.discontinuities import disparity_of_nearness, disparity_steps
from ..warp.warped_view import WarpedView
from .silhouettes import differing, edge_band


def seams(warped: WarpedView, sources: Sequence[Camera], target: Camera, accuracy: Accuracy) -> NDArray[np.bool_]:
    """Return (H, W) target pixels at a depth discontinuity where its two sides come from different sources.

    A plain render filters colours over such an edge as over any other; the silhouette rule of each source sees only its
    own side. Disparity is that of the source that is farthest from the target.
    """
    index, radius = warped.warp.source, accuracy.silhouette_radius
    border = np.zeros(index.shape, bool)
    for here, there in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
        differs = index[here] != index[there]
        border[here] |= differs
        border[there] |= differs
    farthest = max(sources, key=lambda camera: disparity_per_nearness(target, camera))
    disparity = disparity_of_nearness(warped.warp.nearness, target, farthest)
    covered = warped.warp.covered
    np.copyto(disparity, np.nan, where=~covered)
    band = edge_band(disparity_steps(disparity), threshold=accuracy.silhouette_step, radius=radius)
    band &= dilate(border, radius)
    colour = warped.passes[COLOUR_PASS]
    return differing(band, disparity, colour, tolerance=accuracy.colour_tolerance, unknown=~covered)
