"""Colours of made-up pictures."""

from numpy.typing import NDArray


def opaque(colour: NDArray) -> NDArray:
    """Return the same colours (..., 4), in place, with an alpha of 1: noise that was added to all channels is light's."""
    colour[..., 3] = 1.0
    return colour
