"""Bands: a picture is worked on a few rows at a time, so that temporaries fit a processor's cache."""

from __future__ import annotations

from collections.abc import Iterator

BAND_PIXELS = 1 << 16
"""Pixels of a band, at most, if it has more than one row: a few temporaries of four bytes per pixel fit a megabyte."""


def bands(shape: tuple[int, ...]) -> Iterator[slice]:
    """Return slices of rows that cover an array of shape (H, W, ...) from top to bottom, so that it is worked on in
    parts.

    A slice has at most `BAND_PIXELS` pixels, or a single row where a row has more.
    """
    height, width = shape[:2]
    rows = max(BAND_PIXELS // max(width, 1), 1)
    return (slice(top, min(top + rows, height)) for top in range(0, height, rows))
