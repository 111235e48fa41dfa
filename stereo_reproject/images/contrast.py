"""Contrast of a picture: the error to expect where a thing that it shows has moved. Probes and tiles are chosen by it.

A reflection, a refraction or a highlight stands elsewhere for the other eye than its surface. However far it has
moved, the error is no larger than the picture's own contrast there: the inside of a highlight may move unseen, its rim
may not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from .bands import bands
from .metrics import COLOUR_CHANNELS, judged_channel, judged_channels
from .sides import mend_sides
from .tuning import TUNING


@dataclass(frozen=True)
class Contrast:
    """Variances of a picture's colour around each pixel, after `metrics.tone`, those of its alpha among them.

    signal (H, W) is the variance of the scene itself, which a render without noise would have too. noise (H, W) is the
    variance that noise gives a single pixel.
    """

    signal: NDArray[np.float32]
    noise: NDArray[np.float32]


def contrast_of(colour: NDArray, known: NDArray[np.bool_], *, wraps: bool = False) -> Contrast:
    """Return the contrast of a scene-linear colour (H, W, >= 3); only the pixels set in known (H, W) count. One that
    wraps goes on at its left beyond its right side.

    noise is measured as the variance of pixels around the mean of their 3 x 3 neighbours. signal is the variance of
    these means in a wider window, less the noise that they still have; it is 0 where a pixel is not known.
    """
    near, far = _noise_window(known), _Window(known, TUNING.contrast_reach_px)
    pixels = (2 * TUNING.noise_reach_px + 1) ** 2
    # Squares are summed over the channels before the wide window takes their mean, which is what takes the time.
    mean, around_mean, of_mean, mean_squared = (np.zeros(known.shape, np.float32) for _ in range(4))
    for channel in range(judged_channels(colour, known)):
        for rows, near_mean in near.means(partial(_judged_rows, colour, channel)):
            mean[rows] = near_mean
            around_mean[rows] += (judged_channel(colour[rows], channel) - near_mean) ** 2
            of_mean[rows] += near_mean**2
        for rows, far_mean in far.means(mean.__getitem__):
            mean_squared[rows] += far_mean**2
    signal, noise = mean_squared, mean
    both = zip(far.means(around_mean.__getitem__), far.means(of_mean.__getitem__), strict=True)
    for (rows, of_noise), (_, of_square) in both:
        noise[rows] = of_noise * np.float32(pixels / (pixels - 1.0) / COLOUR_CHANNELS)
        variance = (of_square - mean_squared[rows]) / np.float32(COLOUR_CHANNELS)
        signal[rows] = np.maximum(variance - noise[rows] / np.float32(pixels), 0.0) * known[rows]

    def of_columns(columns: NDArray[np.intp]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        strip = contrast_of(colour[:, columns], known[:, columns])
        return strip.signal, strip.noise

    mend_sides((signal, noise), of_columns, wraps=wraps)
    return Contrast(signal, noise)


def gradient_of(colour: NDArray, known: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return the change (H, W) of a colour and its alpha from a pixel to the next in its row, after `tone`, measured
    between 3 x 3 means.

    colour (H, W, >= 3) is scene-linear. The change is 0 or more, and 0 where the pixel or a neighbour in its row is not
    set in known (H, W).
    """
    near = _noise_window(known)
    squared = np.zeros((known.shape[0], max(known.shape[1] - 2, 0)), np.float32)
    for channel in range(judged_channels(colour, known)):
        for rows, mean in near.means(partial(_judged_rows, colour, channel)):
            squared[rows] += (mean[:, 2:] - mean[:, :-2]) ** 2 / COLOUR_CHANNELS
    result = np.zeros(known.shape, np.float32)
    result[:, 1:-1] = np.where(known[:, 2:] & known[:, :-2] & known[:, 1:-1], np.sqrt(squared) / 2.0, 0.0)
    return result


def _judged_rows(colour: NDArray, channel: int, rows: slice) -> NDArray[np.float32]:
    """Return `judged_channel` of these rows of a colour (H, W, >= 3)."""
    return judged_channel(colour[rows], channel)


def window_reach() -> int:
    """Return how many pixels away from a pixel the picture has a say in its contrast and its gradient, at most."""
    return TUNING.noise_reach_px + max(TUNING.contrast_reach_px)


class _Window:
    """A moving window that takes means around each pixel of a picture, over the pixels that are set in known (H, W).

    reach: pixels that it reaches each way, down and across.
    """

    def __init__(self, known: NDArray[np.bool_], reach: tuple[int, int]) -> None:
        self._known, self._reach = known, reach
        # A byte holds the counts of the windows that are in use.
        self._count = np.empty(known.shape, np.min_scalar_type((2 * reach[0] + 1) * (2 * reach[1] + 1)))
        for rows, count in box_sums(known.__getitem__, known.shape, reach):
            self._count[rows] = count

    def means(self, image_rows: Callable[[slice], NDArray]) -> Iterator[tuple[slice, NDArray[np.float32]]]:
        """Yield, for bands of rows from top to bottom, their slice and the means (h, W) of an image over the window
        around each pixel; 0 where no pixel in it is known.

        image_rows gives the image (h, W) of a slice of rows, as for `box_sums`.
        """

        def known_rows(rows: slice) -> NDArray:
            return image_rows(rows) * self._known[rows]

        for rows, total in box_sums(known_rows, self._known.shape, self._reach):
            yield rows, (total / np.maximum(self._count[rows], 1e-6)).astype(np.float32)


def _noise_window(known: NDArray[np.bool_]) -> _Window:
    """Return the window of 3 x 3 pixels over which noise is averaged; pixels not set in known (H, W) do not count."""
    return _Window(known, (TUNING.noise_reach_px, TUNING.noise_reach_px))


def box_sum(image: NDArray, reach: tuple[int, int]) -> NDArray[np.float64]:
    """Return for each pixel the sum (H, W) of an image (H, W) over a rectangle around it, which reaches `reach` pixels
    each way, down and across. Pixels beyond the border count as 0."""
    result = np.empty(image.shape)
    for rows, total in box_sums(image.__getitem__, image.shape, reach):
        result[rows] = total
    return result


def box_sums(
    image_rows: Callable[[slice], NDArray], shape: tuple[int, ...], reach: tuple[int, int]
) -> Iterator[tuple[slice, NDArray[np.float64]]]:
    """Yield `box_sum` of an image of this shape (H, W) band by band: the slice of a band's rows, and their sums (h, W).

    image_rows gives the image (h, W) of a slice of rows. It is asked for each row once, from top to bottom, and for
    those that a band's windows reach before the band is yielded.
    """
    height, (down, across) = shape[0], reach
    # Running sums down the columns: the first row of `total` is the sum of the image's rows above row `top`.
    total, top = np.zeros((1, shape[1])), 0
    for rows in bands(shape):
        low, high = max(rows.start - down, 0), min(rows.stop + down, height)
        total, new = total[low - top :], slice(top + len(total) - 1, high)
        top = low
        total = np.concatenate([total, np.empty((new.stop - new.start, shape[1]))])
        # Row by row: NumPy's cumsum, which goes down the columns, takes eight times as long.
        for row, values in enumerate(image_rows(new), start=new.start - top):
            np.add(total[row], values, out=total[row + 1])
        place = np.arange(rows.start, rows.stop) - top
        after, before = np.minimum(place + down + 1, height - top), np.maximum(place - down, 0)
        yield rows, _sums_across(total.take(after, 0) - total.take(before, 0), across)


def _sums_across(image: NDArray[np.float64], reach: int) -> NDArray[np.float64]:
    """Return for each pixel the sum (h, W) of an image (h, W) over the pixels of its row, `reach` each way."""
    width = image.shape[1]
    total, place = np.zeros((image.shape[0], width + 1)), np.arange(width)
    np.cumsum(image, axis=1, out=total[:, 1:])
    return total.take(np.minimum(place + reach + 1, width), 1) - total.take(np.maximum(place - reach, 0), 1)
