"""Pictures made smaller by the mean of the area that each new pixel covers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def made_smaller(picture: NDArray[np.float32], width: int, height: int) -> NDArray[np.float32]:
    """Return a picture (H, W, C) with this width and height, neither larger than its own. Each pixel is the mean of the
    area that it covers, pixels that lie in it partly counting by their part.
    """
    rows, columns = _shares(picture.shape[0], height), _shares(picture.shape[1], width)
    return np.einsum("jx,ixc->ijc", columns, np.tensordot(rows, picture, axes=1), optimize=True)


def _shares(pixels: int, new_pixels: int) -> NDArray[np.float32]:
    """Return how much of each new pixel's length each old pixel has, (new_pixels, pixels); each row's sum is 1."""
    ends = np.arange(new_pixels + 1) * (pixels / new_pixels)
    low, high = ends[:-1, None], ends[1:, None]
    start = np.arange(pixels)[None, :]
    covered = np.clip(np.minimum(high, start + 1) - np.maximum(low, start), 0.0, None)
    return (covered / (high - low)).astype(np.float32)
