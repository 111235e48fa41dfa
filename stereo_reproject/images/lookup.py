"""Lookup of passes at the positions of a warp: interpolated for colours, the nearest pixel for what must not mix."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .bands import by_bands
from .masks import dilate


def lookup(
    image: NDArray[np.float32], x: NDArray, y: NDArray, *, interpolation: str = "linear", wraps: bool = False
) -> NDArray[np.float32]:
    """Return the values (h, w, C) of an image (H, W, C) at positions x, y (h, w) in pixels; a NaN position gives 0.

    interpolation is linear (bilinear), cubic or nearest. cubic is the Catmull-Rom spline, which keeps more of the
    sharpness and more of the noise; it overshoots, and is held within the range of the 4 x 4 pixels that it reads.
    Outside the picture its border is repeated; one that wraps goes on at its left beyond its right side.
    """
    sample: Callable[[_Texels, NDArray, NDArray], NDArray[np.float32]]
    sample = {"linear": _linear, "cubic": _cubic, "nearest": _nearest}[interpolation]
    texels = _Texels(image, wraps=wraps)

    def values_at(x: NDArray, y: NDArray) -> NDArray[np.float32]:
        result = sample(texels, x.ravel(), y.ravel()).astype(np.float32, copy=False)
        result = result.reshape(*x.shape, texels.channels)
        unanswered = np.isnan(x) | np.isnan(y)
        if unanswered.any():
            result[unanswered] = 0.0
        return result

    return by_bands(values_at, x, y)


def variance_share(x: NDArray, y: NDArray, *, interpolation: str = "linear") -> NDArray[np.float32]:
    """Return (h, w) the share of a pixel's variance, 0 to 1, that a `lookup` at positions x, y (h, w) in pixels keeps.

    It is the sum of the squared weights of the pixels that the lookup reads, since their noise is independent: 1 where
    it reads a single pixel, 0.25 for a linear lookup between four. A NaN position gives 1. Two things are left out: the
    border, which is repeated, and the range within which cubic values are held.
    """
    if interpolation == "nearest":
        return np.ones(x.shape, np.float32)
    return weight_product(x, y, interpolation, interpolation)


def weight_product(x: NDArray, y: NDArray, one: str, other: str) -> NDArray[np.float32]:
    """Return (h, w) the sum, over the pixels that two lookups at the same positions read, of the products of their
    weights.

    x, y (h, w) are the positions in pixels; one and other are the lookups' interpolations, linear or cubic. It is 1 at
    NaN. Times the variance of a pixel, it is the covariance of the two values, where noise is independent by pixel.
    """
    kernels: dict[str, Callable[[NDArray], tuple[NDArray, ...]]] = {"linear": _linear_of_four, "cubic": _catmull_rom}

    def product_at(x: NDArray, y: NDArray) -> NDArray[np.float32]:
        share = np.ones_like(x, np.float32)
        for at in (y, x):
            _, t = _split(at)
            # On pixel centres all kernels take one pixel alone, as they do down the rows of a rectified pair.
            if not np.any(t > 0.0):
                continue
            share *= sum(a * b for a, b in zip(kernels[one](t), kernels[other](t), strict=True))
        return np.where(np.isnan(share), np.float32(1.0), share)

    return by_bands(product_at, x, y)


def linear_overlap(
    x: NDArray[np.float32], y: NDArray[np.float32], other_x: NDArray[np.float32], other_y: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return (h, w) the sum, over the pixels that both read, of the products of the weights of two linear lookups at
    different positions x, y and other_x, other_y (h, w), in pixels of one picture; 0 where either is NaN.

    Times the variance of a pixel, it is the covariance of the two values, where noise is independent by pixel.
    """
    overlap = np.ones(x.shape, np.float32)
    for at, other_at in ((x, other_x), (y, other_y)):
        known = ~(np.isnan(at) | np.isnan(other_at))
        (pixel, t), (other_pixel, other_t) = (_split(np.where(known, each, 0.5)) for each in (at, other_at))
        apart = pixel - other_pixel
        both = (1.0 - t) * (1.0 - other_t) + t * other_t
        overlap *= np.select(
            [apart == 0, apart == 1, apart == -1], [both, (1.0 - t) * other_t, t * (1.0 - other_t)], 0.0
        )
        overlap *= known
    return overlap


def lookup_without(
    image: NDArray[np.float32], x: NDArray, y: NDArray, excluded: NDArray[np.bool_], *, wraps: bool = False
) -> NDArray[np.float32]:
    """Return the values (N, C) of an image (H, W, C) at positions x, y (N,), in pixels, interpolated between those of
    the four pixels around each that are not set in `excluded` (H, W).

    The weights are bilinear, divided by the sum of those that are left; the values are held within the range of the
    pixels that they come from. They are 0 where no pixel is left. wraps is as for `lookup`.
    """
    texels, out = _Texels(image, wraps=wraps), _Texels(excluded[..., None], wraps=wraps)
    row, down = _split(y)
    column, across = _split(x)
    corners = [(row + i, column + j) for i in (0, 1) for j in (0, 1)]
    bilinear = np.stack([vertical * level for vertical in (1.0 - down, down) for level in (1.0 - across, across)])
    weights = bilinear[..., None] * ~np.stack([out.take(*at) for at in corners])
    used = weights > 0.0
    # What is left out may be no number.
    values = np.where(used, np.stack([texels.take(*at) for at in corners]), np.float32(0.0))
    with np.errstate(over="ignore"):
        mean = (values * (weights / np.maximum(weights.sum(axis=0), np.finfo(np.float32).tiny))).sum(axis=0)
    low, high = values.min(axis=0, where=used, initial=np.inf), values.max(axis=0, where=used, initial=-np.inf)
    return np.where(used.any(axis=0), np.clip(mean, low, high), np.float32(0.0))


def touches(mask: NDArray[np.bool_], x: NDArray, y: NDArray, *, share: float, wraps: bool = False) -> NDArray[np.bool_]:
    """Return (h, w) the positions at which a bilinear lookup would take more than `share` of its weight from set
    pixels.

    x, y (h, w) are the positions, in pixels of `mask` (H, W), whose set pixels are meant. A NaN position touches
    nothing. wraps is as for `lookup`.
    """
    if not mask.any():
        return np.zeros(x.shape, bool)
    # A lookup reaches no further than the pixels around the one that it lies in.
    around, texels = (_Texels(pixels[..., None], wraps=wraps) for pixels in (dilate(mask, 1, wraps=wraps), mask))

    def touching_at(x: NDArray, y: NDArray) -> NDArray[np.bool_]:
        at_x, at_y = x.ravel(), y.ravel()
        near = _nearest(around, at_x, at_y)[:, 0] & ~np.isnan(at_x) & ~np.isnan(at_y)
        chosen = np.flatnonzero(near)
        if chosen.size:
            near[chosen] = _linear(texels, at_x[chosen], at_y[chosen])[:, 0] > share
        return near.reshape(x.shape)

    return by_bands(touching_at, x, y)


class _Texels:
    """Pixels of an image (H, W, C), to be read by row and column. Outside the image its border is repeated; right and
    left of one that wraps it goes on at its other side."""

    def __init__(self, image: NDArray, *, wraps: bool) -> None:
        self._wraps = wraps
        self.height, self.width, self.channels = image.shape
        self._pixels = np.ascontiguousarray(image).reshape(self.height * self.width, self.channels)

    def take(self, row: NDArray[np.int32], column: NDArray[np.int32]) -> NDArray:
        """Return the values (N, C) of the pixels at these rows and columns (N,)."""
        start = np.clip(row, 0, self.height - 1).astype(np.int64) * self.width
        within = column % self.width if self._wraps else np.clip(column, 0, self.width - 1)
        return self._pixels.take(start + within, axis=0)

    def spread(self, weight: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return a weight (N,) repeated for each channel of the image, (N, C).

        NumPy multiplies arrays of equal shape much faster than it broadcasts over so few channels.
        """
        return weight.repeat(self.channels).reshape(-1, self.channels)


def _nearest(texels: _Texels, x: NDArray, y: NDArray) -> NDArray:
    """Return the values (N, C) of the pixels in which the positions x, y (N,) lie."""
    return texels.take(_whole(np.floor(y)), _whole(np.floor(x)))


def _linear(texels: _Texels, x: NDArray, y: NDArray) -> NDArray:
    """Return the values (N, C) at positions x, y (N,), in pixels, interpolated between the four pixels around each."""
    row, down = _split(y)
    column, across = _split(x)
    weight = texels.spread(across)

    def along(row: NDArray[np.int32]) -> NDArray:
        """Return the values (N, C) between the pixels of these rows (N,)."""
        return texels.take(row, column) * (1.0 - weight) + texels.take(row, column + 1) * weight

    if not np.any(down > 0.0):
        return along(row)
    weight_down = texels.spread(down)
    return along(row) * (1.0 - weight_down) + along(row + 1) * weight_down


def _cubic(texels: _Texels, x: NDArray, y: NDArray) -> NDArray[np.float32]:
    """Return the values (N, C) at positions x, y (N,), in pixels, by the Catmull-Rom spline over 4 x 4 pixels.

    They are held within the range of the pixels that they come from.
    """
    row, down = _split(y)
    column, across = _split(x)
    total = np.zeros((x.size, texels.channels), np.float32)
    low, high = np.full_like(total, np.inf), np.full_like(total, -np.inf)
    for i, weight_down in enumerate(_catmull_rom(down)):
        # NaN is no weight either. Where positions lie on rows, three of the four rows have weight 0.
        if not np.any(np.abs(weight_down) > 0.0):
            continue
        for j, weight_across in enumerate(_catmull_rom(across)):
            weight = weight_down * weight_across
            taken = texels.take(row + (i - 1), column + (j - 1))
            # NumPy is slower with a mask.
            weighted = True if weight.all() else (weight != 0.0)[:, None]
            np.minimum(low, taken, out=low, where=weighted)
            np.maximum(high, taken, out=high, where=weighted)
            # Beside the largest float32s the overshoot is infinite, until it is held within their range.
            with np.errstate(over="ignore"):
                total += taken * texels.spread(weight)
    return np.clip(total, low, high, out=total)


def _linear_of_four(t: NDArray) -> tuple[NDArray, ...]:
    """Return the weights of four neighbouring pixels by linear interpolation, at `t`, 0 to 1, on the way from the
    second of them to the third; those of the first and the last are 0."""
    return np.zeros_like(t), 1.0 - t, t, np.zeros_like(t)


def _catmull_rom(t: NDArray) -> tuple[NDArray, ...]:
    """Return the weights (N,) of four neighbouring pixels by the Catmull-Rom spline, at `t` (N,), 0 to 1, on the way
    from the second of them to the third."""
    t2, t3 = t * t, t * t * t
    return -0.5 * t3 + t2 - 0.5 * t, 1.5 * t3 - 2.5 * t2 + 1.0, -1.5 * t3 + 2.0 * t2 + 0.5 * t, 0.5 * t3 - 0.5 * t2


def _split(position: NDArray) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Return positions (N,) along one axis, in pixels, as a pixel's index and the distance from that pixel's centre.

    The pixel is the one whose centre is at or before the position; the distance is in pixels, 0 to 1.
    """
    shifted = position - np.float32(0.5)
    floor = np.floor(shifted)
    return _whole(floor), (shifted - floor).astype(np.float32, copy=False)


def _whole(number: NDArray) -> NDArray[np.int32]:
    """Return whole numbers, given as floats, as int32; NaN becomes any integer, without a warning."""
    with np.errstate(invalid="ignore"):
        return number.astype(np.int32)
