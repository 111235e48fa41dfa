"""Pixels of cut-outs: pictures of a panorama seen in perspective, by its nearest pixels or interpolated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..views.camera import Array, goes_round
from ..views.cutouts import ALL_ROWS, Cutout, px_in_cutout
from ..views.panorama import PanoramicCamera


@dataclass(frozen=True)
class CutoutPixels:
    """The places that the pixels of a cut-out, or of some of its rows, have in a panorama of width x height pixels: x
    and y (h, S), NaN where it shows nothing. wraps: True where the panorama's last column is followed by its first."""

    x: Array
    y: Array
    width: int
    height: int
    wraps: bool

    @property
    def shown(self) -> NDArray[np.bool_]:
        """Pixels (h, S) at which the panorama shows something."""
        return np.isfinite(self.x)

    def nearest(self, image: NDArray) -> NDArray:
        """Return the values (h, S, ...) of the panorama's pixels (H, W, ...) in which the cut-out's lie; 0 where it
        shows nothing. Each is a pixel's own, so noise stays as independent between pixels as it is."""
        result = image[self._row(np.floor(self._known(self.y))), self._column(np.floor(self._known(self.x)))]
        result[~self.shown] = 0
        return result

    def linear(self, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the values (h, S, C) of an image (H, W, C), interpolated between the four pixels around each place; 0
        where it shows nothing."""
        left, top = self._known(self.x) - 0.5, self._known(self.y) - 0.5
        column, row = np.floor(left), np.floor(top)
        across, down = (left - column)[..., None].astype(np.float32), (top - row)[..., None].astype(np.float32)
        result = np.zeros((*self.x.shape, image.shape[-1]), np.float32)
        for below, share_down in ((0, 1.0 - down), (1, down)):
            for beside, share_across in ((0, 1.0 - across), (1, across)):
                pixel = image[self._row(row + below), self._column(column + beside)]
                result += pixel * (share_down * share_across)
        result[~self.shown] = 0.0
        return result

    def _known(self, place: Array) -> Array:
        """Return places (h, S) with 0 for those that are not known."""
        return np.where(self.shown, place, 0.0)

    def _row(self, row: Array) -> NDArray[np.intp]:
        """Return whole numbers as rows of the panorama, whose first and last are repeated beyond it."""
        return np.clip(row.astype(np.intp), 0, self.height - 1)

    def _column(self, column: Array) -> NDArray[np.intp]:
        """Return whole numbers as columns of the panorama."""
        whole = column.astype(np.intp)
        return whole % self.width if self.wraps else np.clip(whole, 0, self.width - 1)


def cutout_pixels(
    camera: PanoramicCamera, cutout: Cutout, size: int, rows: slice = ALL_ROWS, *, coarser: int = 1
) -> CutoutPixels:
    """Return the places in a panorama of the pixels of these rows of a cut-out of size x size pixels. The places are
    those in the panorama's picture after a `block_mean` of coarser times."""
    x, y = px_in_cutout(camera, cutout, size, rows)
    width, height = -(-camera.width // coarser), -(-camera.height // coarser)
    return CutoutPixels(x / coarser, y / coarser, width, height, wraps=goes_round(camera))


def block_mean(image: NDArray, times: int) -> NDArray[np.float32]:
    """Return a picture (H, W, C) made smaller: the mean of each times x times pixels, fewer at the right and lower edge
    where times does not divide the size."""
    height, width, channels = image.shape
    total = np.zeros((-(-height // times), -(-width // times), channels), np.float32)
    for first_row in range(times):
        for first_column in range(times):
            part = image[first_row::times, first_column::times]
            total[: part.shape[0], : part.shape[1]] += part
    rows, columns = (np.full(-(-pixels // times), times, np.float32) for pixels in (height, width))
    rows[-1], columns[-1] = height - times * (rows.size - 1), width - times * (columns.size - 1)
    total /= (rows[:, None] * columns)[..., None]
    return total
