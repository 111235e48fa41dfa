"""Flicker between neighbouring views: how much a surface changes from one to the next, against plain renders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..holes.reprojection import reproject
from ..images.lookup import lookup
from ..images.metrics import squared_error
from ..images.passes import COLOUR_PASS, DEPTH_PASS
from ..settings.accuracy import SETTINGS
from ..views.view import View
from ..warp.rendered_view import RenderedView

FINEST = SETTINGS["high"]
"""Accuracy by which pixels are left out that the neighbour does not show as the view does, such as edges."""


@dataclass(frozen=True)
class Neighbours:
    """Two neighbouring views, and two pairs of pictures of them: scene-linear colours (H, W, >= 3), as bright as they
    are judged, first that of `view` and then that of `neighbour`. depth (H, W) is what the neighbour sees, in scene
    units."""

    view: View
    neighbour: View
    depth: NDArray[np.float32]
    ours: tuple[NDArray[np.float32], NDArray[np.float32]]
    plain: tuple[NDArray[np.float32], NDArray[np.float32]]


def flicker_ratio(pictures: Neighbours) -> float | None:
    """Return the root mean square of the change from the neighbour to the view, where both show the same, over that
    between the plain pictures; None where nothing tells it.

    The neighbour's pictures are looked up by one map. What a lookup between pixels blurs counts in both changes.
    """
    found = changes(pictures)
    return None if found is None or found[1] <= 0.0 else float(np.sqrt(found[0] / found[1]))


def changes(pictures: Neighbours) -> tuple[float, float] | None:
    """Return the mean squares of the changes that `flicker_ratio` compares: ours, and that between the plain pictures;
    None where the two views show nothing alike."""
    passes = {COLOUR_PASS: pictures.plain[1], DEPTH_PASS: pictures.depth[..., None]}
    seen = reproject([RenderedView(pictures.neighbour, passes)], pictures.view, FINEST)
    same = (seen.reasons == 0) & seen.warp.covered
    if not same.any():
        return None

    def change(view: NDArray[np.float32], neighbour: NDArray[np.float32]) -> float:
        moved = lookup(neighbour, seen.warp.x, seen.warp.y, interpolation="cubic")
        return float(np.mean(squared_error(view, moved)[same]))

    return change(*pictures.ours), change(*pictures.plain)
