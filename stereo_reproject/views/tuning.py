"""The tuned numbers of the views."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ViewTuning:
    """Tuned numbers of this room, chosen by judgement; each says why."""

    max_toe_in_factor: float = 2.0
    """Factor by which a point may move further between cameras that are toed in than between parallel ones, at most:
    at the middle of a picture far to the side of the other's, a first-order estimate tells nothing."""
    frame_margin_pixels: float = 4.0
    """Pixels that count as seen beyond the frame's edge: the reach of any usual pixel filter, and rounding."""


TUNING = ViewTuning()
