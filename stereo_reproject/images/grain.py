"""Grain of a lookup: single pixels of the source where noise rules, so that noise looks as it does in a render.

Between two pixels a linear lookup takes their mean, whose noise is weaker and as wide as two pixels: short dashes,
where a render has dots. One of the two, chosen at random with the weights of the linear lookup as probabilities, has
all of the noise of a render's pixel, and the linear lookup is its mean over all choices. What the choice adds is
g² t (1 - t), with g the difference of the two without noise and t the place between them: it is made only where noise
is far above g.

Neighbouring pixels of a row share their random number over a short stretch. Each by itself would often take the same
pixel of the source as the one beside it, which is a dash again.
"""

from __future__ import annotations

from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from .contrast import box_sums
from .lookup import variance_share
from .metrics import COLOUR_CHANNELS, judged_channel, squared_error
from .tuning import TUNING

Choice = tuple[NDArray[np.float32], NDArray[np.float32]]
"""Random numbers (h, w), 0 to 1, by which pixels of the source are chosen: across, and down."""


def choice_of(name: str, shape: tuple[int, int]) -> Choice:
    """Return the choice for the pixels of a target view of this name and of shape (h, w): the same one has the same
    choice, and another one another."""
    generator = np.random.default_rng(crc32(name.encode()))
    return _stretches(shape, generator), np.ascontiguousarray(_stretches(shape[::-1], generator).T)


def chosen_pixels(
    x: NDArray[np.float32], y: NDArray[np.float32], choice: Choice
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the positions x, y (h, w), in pixels, of the centres of source pixels, each chosen among the four around a
    position x, y (h, w) with the weights of a linear lookup as probabilities; NaN at NaN."""
    half = np.float32(0.5)

    def chosen(at: NDArray[np.float32], number: NDArray[np.float32]) -> NDArray[np.float32]:
        first = np.floor(at - half)
        # The number is not added to the position, where rounding would make a whole pixel of its last digits.
        return first + (number >= np.float32(1.0) - (at - half - first)) + half

    across, down = choice
    return chosen(x, across), chosen(y, down)


def _stretches(shape: tuple[int, ...], generator: np.random.Generator) -> NDArray[np.float32]:
    """Return random numbers (h, w), 0 to 1, equal over stretches of each row; in each row these begin elsewhere."""
    height, width = shape
    length = TUNING.grain_stretch_px
    numbers = generator.random((height, width // length + 2), np.float32)
    start = generator.integers(length, size=(height, 1))
    return np.take_along_axis(numbers, (np.arange(width)[None] + start) // length, axis=1)


def ruled_by_noise(
    linear: NDArray[np.float32],
    chosen: NDArray[np.float32],
    x: NDArray[np.float32],
    y: NDArray[np.float32],
    noise: NDArray[np.float32],
) -> NDArray[np.bool_]:
    """Return (h, w) the pixels at which a single pixel of the source is to be taken in place of a linear lookup.

    linear and chosen (h, w, >= 3) are the scene-linear colours of both, at the positions x, y (h, w) in pixels. noise
    (h, w) is the variance of a single pixel of the source there, after `metrics.tone`. Two things must be small beside
    it, in the mean over a window: the difference of the two beyond what noise explains, and the slope of the picture
    along its rows, which the noise of single pixels hides less.
    """
    known = ~(np.isnan(x) | np.isnan(y))
    explained = noise * (np.float32(1.0) - variance_share(x, y))
    beyond = np.where(known, squared_error(chosen, linear) - explained, 0.0)
    count = np.maximum(_windows(known.astype(np.float32)), 1.0)
    return (
        known
        & (_windows(beyond) / count < TUNING.grain_detail_share * noise)
        & (_squared_slope(linear, known, count) < TUNING.grain_slope_share * noise)
    )


def _squared_slope(linear: NDArray[np.float32], known: NDArray[np.bool_], count: NDArray) -> NDArray[np.float64]:
    """Return (h, w) the square of the change per pixel along the rows of a picture (h, w, >= 3) that is averaged over
    windows, after `metrics.tone`, as the mean over its channels. count (h, w) is the number of known (h, w) pixels of
    each window."""
    reach = TUNING.sharpness_reach_px[1]
    squared = np.zeros(known.shape)
    for channel in range(COLOUR_CHANNELS):
        mean = _windows(np.where(known, judged_channel(linear, channel), np.float32(0.0))) / count
        padded = np.pad(mean, ((0, 0), (reach, reach)), mode="edge")
        squared += ((padded[:, 2 * reach :] - padded[:, : -2 * reach]) / (2 * reach)) ** 2
    return squared / COLOUR_CHANNELS


def _windows(values: NDArray) -> NDArray[np.float64]:
    """Return (h, w) the sums of values (h, w) over the window around each pixel."""
    result = np.empty(values.shape)
    for rows, total in box_sums(values.__getitem__, values.shape, TUNING.sharpness_reach_px):
        result[rows] = total
    return result
