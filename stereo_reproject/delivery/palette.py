"""A palette for pictures of few colours, and the pictures in it: median cut, with an ordered dither.

Paul Heckbert, "Color image quantization for frame buffer display", SIGGRAPH 1982, section 4.2; of the boxes the one
with the largest squared error is cut, as in Xiaolin Wu's variant of it (Graphics Gems II, 1991).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

HISTOGRAM_BITS = 5
"""Bits of each channel by which colours are counted: 32768 bins, Heckbert's own choice."""

LOOKUP_BITS = 6
"""Bits of each channel by which a pixel finds its palette entry: steps of 4, half of the dither's range."""

LOOKUP_CHUNK_COLOURS = 1 << 14
"""Colours that are compared with all of the palette at once: some 16 MiB of distances."""

DITHER_LEVELS = 8.0
"""Range of the dither in steps of 8 bits: about the distance of neighbours in a palette of 256 made for a picture. In a
render of a bathroom, 20 shows as a pattern and 0 as bands."""

EXACT_LEVELS = 2
"""Steps of 8 bits by which a channel may be off its palette entry and is not dithered: the half of a step of
`LOOKUP_BITS`."""


def palette_of(pictures: NDArray[np.uint8], colours: int) -> NDArray[np.uint8]:
    """Return a palette (at most `colours`, 3) for all of the pictures (..., 3) together; channels are bytes."""
    bins, weights = _histogram(pictures)
    boxes = [np.arange(len(bins))]
    errors = [_error(bins, weights)]
    while len(boxes) < colours and max(errors) > 0.0:
        worst = int(np.argmax(errors))
        errors.pop(worst)
        for half in _cut(boxes.pop(worst), bins, weights):
            boxes.append(half)
            errors.append(_error(bins[half], weights[half]))
    means = [np.average(bins[box], axis=0, weights=weights[box]) for box in boxes]
    return np.round(means).astype(np.uint8)


def in_palette(picture: NDArray[np.uint8], palette: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return for each pixel of a picture (H, W, 3) its entry of the palette (at most 256, 3), as (H, W) bytes. A dither
    that has the same pattern in each picture hides the steps between entries; colours that the palette has are left.
    """
    height, width = picture.shape[:2]
    offsets = np.tile(_bayer(), (height // 8 + 1, width // 8 + 1))[:height, :width, None]
    dithered = np.clip(np.round(picture + DITHER_LEVELS * offsets), 0, 255).astype(np.uint8)
    plain = _nearest_of(picture, palette)
    is_exact = np.abs(palette[plain].astype(np.int16) - picture).max(axis=-1) <= EXACT_LEVELS
    return np.where(is_exact, plain, _nearest_of(dithered, palette))


def _nearest_of(picture: NDArray[np.uint8], palette: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the nearest palette entry of each pixel of a picture (H, W, 3), as (H, W) bytes."""
    used, places = np.unique(_bin_numbers(picture, LOOKUP_BITS), return_inverse=True)
    return _nearest(used, palette)[places].reshape(picture.shape[:2])


def _histogram(pictures: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean colours (N, 3) of the bins that have pixels, and how many pixels each has (N)."""
    pixels = pictures.reshape(-1, 3)
    numbers = _bin_numbers(pixels, HISTOGRAM_BITS)
    counts = np.bincount(numbers)
    sums = np.stack([np.bincount(numbers, weights=pixels[:, channel]) for channel in range(3)], axis=-1)
    used = counts > 0
    return sums[used] / counts[used, None], counts[used].astype(np.float64)


def _bin_numbers(colours: NDArray[np.uint8], bits: int) -> NDArray[np.int32]:
    """Return the number of each colour (..., 3) among all that have this many bits per channel."""
    high = (colours >> (8 - bits)).astype(np.int32)
    return (high[..., 0] << 2 * bits) | (high[..., 1] << bits) | high[..., 2]


def _error(colours: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    """Return the weighted sum of squared distances of colours (N, 3) from their mean."""
    mean = np.average(colours, axis=0, weights=weights)
    return float((weights[:, None] * (colours - mean) ** 2).sum())


def _cut(
    box: NDArray[np.intp], colours: NDArray[np.float64], weights: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the two halves of a box (numbers of colours): cut at the mean of the channel that varies most in it."""
    inside = colours[box]
    mean = np.average(inside, axis=0, weights=weights[box])
    varies = np.average((inside - mean) ** 2, axis=0, weights=weights[box])
    channel = int(np.argmax(varies))
    above = inside[:, channel] > mean[channel]
    return box[~above], box[above]


def _bayer() -> NDArray[np.float64]:
    """Return Bayer's matrix (8, 8) of thresholds, from -0.5 to 0.5 with a mean of 0."""
    matrix = np.zeros((1, 1))
    for _ in range(3):
        matrix = np.block([[4 * matrix, 4 * matrix + 2], [4 * matrix + 3, 4 * matrix + 1]])
    return (matrix + 0.5) / matrix.size - 0.5


def _nearest(numbers: NDArray[np.int32], palette: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the nearest palette entry of colours (N), given by their numbers among those of `LOOKUP_BITS` bits."""
    step, mask = 1 << (8 - LOOKUP_BITS), (1 << LOOKUP_BITS) - 1
    channels = [(numbers >> (bits * LOOKUP_BITS)) & mask for bits in (2, 1, 0)]
    colours = ((np.stack(channels, axis=-1) + 0.5) * step - 0.5).astype(np.float32)
    entries = palette.astype(np.float32)
    squares = (entries**2).sum(axis=1)
    found = np.empty(len(colours), np.uint8)
    for start in range(0, len(colours), LOOKUP_CHUNK_COLOURS):
        part = slice(start, start + LOOKUP_CHUNK_COLOURS)
        # The squared distance but for the colour's own square, which is the same for all entries.
        found[part] = np.argmin(squares - 2.0 * colours[part] @ entries.T, axis=1)
    return found
