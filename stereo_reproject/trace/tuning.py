"""The tuned numbers of how pixels are traced."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TraceTuning:
    """Numbers by which the costs of fill methods are predicted and packed pictures are laid out."""

    packed_pixel_cost: float = 1.15
    """Cost of a packed pixel over one of the source, assumed until it is measured: holes lie along edges and in
    corners, where paths are long. Measured on two CPU cores."""

    packed_pixel_cost_limits: tuple[float, float] = (0.25, 4.0)
    """Least and greatest measured cost of a packed pixel that is believed. Chosen wide, about four times less and more
    than the assumed cost: it is there for broken clocks and machines that were busy otherwise."""

    card_pixel_cost: float = 0.1
    """Cost of a masked pixel behind a card over one of the source, assumed until it is measured: its rays end at the
    card. Measured on two CPU cores."""

    card_pixel_cost_limits: tuple[float, float] = (0.01, 1.0)
    """Least and greatest measured cost of a masked pixel that is believed, chosen wide: it costs something,
    and not more than a pixel of the source."""

    max_card_frame_cost: float = 1.1
    """Cost of the pixels of a frame behind a card over those of the source, at most: all are traced, and the card."""

    card_probe_spacing_factor: int = 3
    """Probes are so many times further apart behind a card than packed: each opens the card for its whole filter."""

    card_pixels_per_probe: int = 25
    """Pixels that a probe opens a card for, with a filter of the usual width: 5 x 5."""

    max_share_of_full_cost: float = 0.9
    """Tracing holes is taken when it is predicted to cost less than this share of a full render: predictions are not
    exact, and a full render is sure to be right."""

    render_call_seconds: float = 0.3
    """Seconds of a render call in which nothing is synced or traced, assumed until they are measured. Measured on two
    CPU cores."""

    render_call_seconds_limits: tuple[float, float] = (0.01, 10.0)
    """Least and greatest measured seconds of a render call that are believed, chosen wide."""

    resync_share: float = 0.25
    """Seconds that Cycles takes to sync a scene again that it has kept, over those of the first time, assumed until
    they are measured. Measured on two CPU cores."""

    resync_share_limits: tuple[float, float] = (0.01, 1.5)
    """Least and greatest measured share of the sync that is believed, chosen wide: above 1 where a packed
    camera's shader is compiled in it."""

    min_told_sync_seconds: float = 0.5
    """Seconds of a scene's first sync from which a second one tells its share: a shorter one is a matter of what every
    call syncs."""

    measured_weight: float = 0.5
    """Weight of what a frame measures against what was known before it, so that one odd frame does not swing the choice
    and a handful of frames settle it."""

    block_side_pixels: int = 16
    """Side of the largest block of a packed picture in pixels, a power of two. With 8, what a volume showed was still a
    little streaked when it was denoised; 32 was no better."""

    max_aspect: float = 1.5
    """Longer side of a packed picture over its shorter one, at most, where fewer pixels are wasted so."""


TUNING = TraceTuning()
"""The numbers in use."""
