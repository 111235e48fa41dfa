"""The tuned numbers of how pixels are traced."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TraceTuning:
    """Numbers by which the costs of fill methods are predicted and packed pictures are laid out."""

    packed_pixel_cost: float = 1.15
    """Cost of a packed pixel over one of the source: holes lie along edges and in corners, where paths are long."""

    card_pixel_cost: float = 0.1
    """Cost of a masked pixel behind a card over one of the source: its rays end at the card."""

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
    """Seconds of a render call in which nothing is synced or traced."""

    resync_share: float = 0.25
    """Seconds that Cycles takes to sync a scene again that it has kept, over those of the first time."""

    block_side_pixels: int = 16
    """Side of the largest block of a packed picture in pixels, a power of two. With 8, what a volume showed was still a
    little streaked when it was denoised; 32 was no better."""

    max_aspect: float = 1.5
    """Longer side of a packed picture over its shorter one, at most, where fewer pixels are wasted so."""


TUNING = TraceTuning()
"""The numbers in use."""
