"""Pixels that show things which have moved since the source was rendered, or lie right beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..images.bands import bands
from ..views.camera import Camera
from ..warp.forward import Warp
from .tuning import TUNING

Box = tuple[NDArray[np.floating], NDArray[np.floating]]
"""Lowest and uppermost corner (3,) of a box in the world."""


@dataclass(frozen=True)
class Movers:
    """Things that have moved, changed shape, come or gone since the sources of a target were rendered.

    in_target (H, W) are the target's pixels in which they are now. boxes are around each of them, where it was and
    where it is.
    """

    in_target: NDArray[np.bool_]
    boxes: Sequence[Box]

    def pixels(self, warp: Warp, target: Camera) -> NDArray[np.bool_]:
        """Return (H, W) the target's pixels that cannot be warped: those of movers, and those of what lies so near
        beside them that its light may be another."""
        return self.in_target | self._beside(warp, target)

    def _beside(self, warp: Warp, target: Camera) -> NDArray[np.bool_]:
        """Return (H, W) the target's pixels whose surface is near one of the boxes, by the box's size."""
        result = np.zeros(warp.nearness.shape, bool)
        pose = target.world_from_camera
        for rows in bands(result.shape):
            row, column = np.mgrid[rows.start + 0.5 : rows.stop, 0.5 : result.shape[1]]
            covered = warp.covered[rows] & (warp.nearness[rows] > 0.0)
            depth = target.depth_from_nearness(np.where(covered, warp.nearness[rows], 1.0).astype(np.float64))
            origin, direction = target.ray_from_px(column, row)
            local = np.stack(np.broadcast_arrays(*(o + depth * d for o, d in zip(origin, direction, strict=True))), -1)
            point = local @ pose[:3, :3].T + pose[:3, 3]
            for low, high in self.boxes:
                away = np.linalg.norm(np.maximum(np.maximum(low - point, point - high), 0.0), axis=-1)
                reach = TUNING.mover_reach_share * float(np.linalg.norm(high - low))
                result[rows] |= covered & (away <= reach)
        return result
