"""Pictures worked on some rows at a time: temporaries then stay in a processor's cache, and huge pictures in memory."""

from __future__ import annotations

from collections.abc import Iterator

PIXELS = 1 << 16
"""Of a band: some temporaries of four bytes per pixel each fit a megabyte."""


def bands(shape: tuple[int, ...]) -> Iterator[slice]:
    """The rows of an array (H, W, ...), some at a time."""
    height, width = shape[:2]
    rows = max(PIXELS // max(width, 1), 1)
    return (slice(top, min(top + rows, height)) for top in range(0, height, rows))
