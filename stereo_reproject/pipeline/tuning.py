"""Tuned numbers of this room, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PipelineTuning:
    """Tuned numbers of this room: how pixels are traced where the source is of another engine, and how the shares of
    many views that are traced follow from each other."""

    matched_pilot_share: float = 0.1
    """Share of the pixels to be traced that go ahead, to tell what the others will cost. By hand."""
    min_matched_pilot_pixels: int = 1024
    """Pixels of that pilot, at least: with fewer, a render call costs what it costs to begin. Measured on living-room
    and classroom."""
    calibration_seconds: float = 2.0
    """Seconds of tracing, besides those of a render call, by which an animation's first frame measures what tracing
    costs: long against a call, and short against the frames of an animation. By hand."""
    min_seconds_to_hand_over: float = 1.0
    """Seconds of a render of one eye below which another one is taken unasked: to copy a scene to the tracer, which is
    all that can be gained, takes as long."""
    halved_gap_share: float = 0.7
    """Share of a view that must be traced, over that share where the two views that it is made from are twice as far
    apart. Measured on a large interior, by two views 2 to 32 steps of a display apart: 6.2, 12, 14, 20 and 26 %."""
    max_traced_of_key: float = 0.5
    """Share of the pixels of a frame's first eye that may be traced for the frame to be made from its key frame: beyond
    it, the eye is rendered whole, and the other is made from it with fewer holes. By hand."""
    batch_pixels: int = 4_000_000
    """Pixels of the views whose holes are traced in one render: each takes about 150 bytes until it is finished, and a
    render call costs its seconds once. By hand."""


TUNING = PipelineTuning()
"""The numbers that are in use."""
