"""Contrast of a picture: the error to expect where a thing that it shows has moved. Probes and tiles are chosen by it.

A reflection, a refraction or a highlight stands elsewhere for the other eye than its surface. However far it has
moved, the error is no larger than the picture's own contrast there: the inside of a highlight may move unseen, its rim
may not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .bands import by_bands, over_bands
from .metrics import COLOUR_CHANNELS, judged, judged_channels
from .tuning import TUNING


@dataclass(frozen=True)
class Contrast:
    """Variances of a picture's colour around each pixel, after `metrics.tone`, those of its alpha among them.

    signal (H, W) is the variance of the scene itself, which a render without noise would have too. noise (H, W) is the
    variance that noise gives a single pixel.
    """

    signal: NDArray[np.float32]
    noise: NDArray[np.float32]


def contrast_of(colour: NDArray, known: NDArray[np.bool_]) -> Contrast:
    """Return the contrast of a scene-linear colour (H, W, >= 3); only the pixels set in known (H, W) count.

    noise is measured as the variance of pixels around the mean of their 3 x 3 neighbours. signal is the variance of
    these means in a wider window, less the noise that they still have; it is 0 where a pixel is not known.
    """
    channels = judged_channels(colour, known)
    near, far = _noise_window(known), _Window(known, TUNING.contrast_reach_px)
    pixels = (2 * TUNING.noise_reach_px + 1) ** 2
    # Squares are summed over the channels before the wide window takes their mean, which is what takes the time.
    around_mean, of_mean, mean_squared = (np.zeros(known.shape, np.float32) for _ in range(3))
    for plane in _judged_planes(colour, channels):
        mean = near.mean(plane)
        _add_square(around_mean, plane, mean)
        _add_square(of_mean, mean)
        _add_square(mean_squared, far.mean(mean))
    noise = far.mean(around_mean) * np.float32(pixels / (pixels - 1.0) / COLOUR_CHANNELS)
    variance = (far.mean(of_mean) - mean_squared) / np.float32(COLOUR_CHANNELS)
    return Contrast(np.maximum(variance - noise / np.float32(pixels), 0.0) * known, noise)


def gradient_of(colour: NDArray, known: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return the change (H, W) of a colour and its alpha from a pixel to the next in its row, after `tone`, measured
    between 3 x 3 means.

    colour (H, W, >= 3) is scene-linear. The change is 0 or more, and 0 where the pixel or a neighbour in its row is not
    set in known (H, W).
    """
    channels = judged_channels(colour, known)
    near = _noise_window(known)
    squared = np.zeros((known.shape[0], max(known.shape[1] - 2, 0)), np.float32)
    for plane in _judged_planes(colour, channels):
        mean = near.mean(plane)
        squared += (mean[:, 2:] - mean[:, :-2]) ** 2 / COLOUR_CHANNELS
    result = np.zeros(known.shape, np.float32)
    result[:, 1:-1] = np.where(known[:, 2:] & known[:, :-2] & known[:, 1:-1], np.sqrt(squared) / 2.0, 0.0)
    return result


def _add_square(total: NDArray[np.float32], image: NDArray[np.float32], less: NDArray | float = 0.0) -> None:
    """Add the square of an image (H, W), less another one, to a total (H, W)."""

    def add(rows: slice) -> None:
        difference = image[rows] - less[rows] if isinstance(less, np.ndarray) else image[rows]
        total[rows] += difference**2

    over_bands(total.shape, add)


def _judged_planes(colour: NDArray, channels: int) -> NDArray[np.float32]:
    """Return (channels, H, W) the first channels of a scene-linear colour (H, W, >= 3) as `metrics.judged` has them."""
    planes = np.empty((channels, *colour.shape[:2]), np.float32)

    def judge(rows: slice) -> None:
        planes[:, rows] = np.moveaxis(judged(colour[rows])[..., :channels], -1, 0)

    over_bands(colour.shape, judge)
    return planes


def window_reach() -> int:
    """Return how many pixels away from a pixel the picture has a say in its contrast and its gradient, at most."""
    return TUNING.noise_reach_px + max(TUNING.contrast_reach_px)


class _Window:
    """A moving window that takes means around each pixel of a picture, over the pixels that are set in known (H, W).

    reach: pixels that it reaches each way, down and across.
    """

    def __init__(self, known: NDArray[np.bool_], reach: tuple[int, int]) -> None:
        self._weight, self._reach = known.astype(np.float32), reach
        self._count = np.maximum(box_sum(self._weight, reach), 1e-6)

    def mean(self, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the mean (H, W) of an image (H, W) over the window around each pixel; 0 where no pixel in it is
        known."""
        total = box_sum(image * self._weight, self._reach)
        return by_bands(lambda total, count: (total / count).astype(np.float32), total, self._count)


def _noise_window(known: NDArray[np.bool_]) -> _Window:
    """Return the window of 3 x 3 pixels over which noise is averaged; pixels not set in known (H, W) do not count."""
    return _Window(known, (TUNING.noise_reach_px, TUNING.noise_reach_px))


def box_sum(image: NDArray, reach: tuple[int, int]) -> NDArray[np.float64]:
    """Return for each pixel the sum (H, W) of an image (H, W) over a rectangle around it, which reaches `reach` pixels
    each way, down and across. Pixels beyond the border count as 0."""
    height, width = image.shape
    down, across = min(reach[0], height), min(reach[1], width)
    total, result = _running_sums_down(image), np.empty((height, width))

    def sum_rows(rows: slice) -> None:
        place = np.arange(rows.start, rows.stop)
        high, low = np.minimum(place + down + 1, height), np.maximum(place - down, 0)
        sums = np.zeros((place.size, width + 1))
        np.cumsum(total.take(high, 0) - total.take(low, 0), axis=1, out=sums[:, 1:])
        # Column j has the running sum up to column j + across, held at the last, less that of before j - across.
        here = result[rows]
        here[:, : width - across] = sums[:, across + 1 :]
        here[:, width - across :] = sums[:, -1:]
        here[:, across + 1 :] -= sums[:, 1 : width - across]

    over_bands(result.shape, sum_rows)
    return result


def _running_sums_down(image: NDArray) -> NDArray[np.float64]:
    """Return the running sums (H + 1, W) down the columns of an image (H, W): row i is the sum of the rows above row i.

    They are added row by row: NumPy's cumsum, which goes down the columns, takes eight times as long.
    """
    total = np.zeros((image.shape[0] + 1, image.shape[1]))
    for row in range(image.shape[0]):
        np.add(total[row], image[row], out=total[row + 1])
    return total
