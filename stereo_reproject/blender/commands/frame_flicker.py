"""Flicker between the compared frames of an animation: how much surfaces change from one frame to the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...estimate.flicker import Neighbours, changes
from ...images.passes import DEPTH_PASS
from ...images.seen_light import scaled_colour
from ...pipeline.stereo_frame import colour
from ...pipeline.stereo_pair import StereoPair
from ...views.view import View
from .compare import MultiviewReference


@dataclass(frozen=True)
class _Shown:
    """One eye in one frame: its view, the depth (H, W) that it sees, and the scene-linear colours (H, W, 4) of ours and
    of multiview's."""

    view: View
    depth: NDArray[np.float32]
    ours: NDArray[np.float32]
    plain: NDArray[np.float32]


class FrameFlicker:
    """Measures the flicker of both eyes from one compared frame to the next, and holds the last one for it."""

    def __init__(self) -> None:
        self._last: dict[str, _Shown] = {}
        self._frame: int | None = None

    def since_last(self, frame: int, pair: StereoPair, multiview: MultiviewReference) -> dict[str, list[float]]:
        """Return by eye the mean squares of the change since the frame before: ours, and that of plain renders. It is
        empty where that frame was not compared. multiview has both eyes."""
        shown: dict[str, _Shown] = {}
        for plain in filter(None, (multiview, multiview.first)):
            if plain.view is None:
                continue
            passes = pair.main_frame.eyes[plain.view.name]
            pictures = [scaled_colour(each, multiview.light_scale) for each in (colour(passes), plain.reference)]
            shown[plain.view.name] = _Shown(plain.view, passes[DEPTH_PASS][..., 0], *pictures)
        found: dict[str, list[float]] = {}
        if self._frame == frame - 1:
            for name, now in shown.items():
                then = self._last[name]
                change = changes(
                    Neighbours(now.view, then.view, then.depth, (now.ours, then.ours), (now.plain, then.plain))
                )
                if change is not None:
                    found[name] = list(change)
        self._last, self._frame = shown, frame
        return found
