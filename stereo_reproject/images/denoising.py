"""Both eyes denoised alike: the source's own denoised pixels where it was warped, the target's own where it was traced.

The source is denoised and then warped, between pixels. Beside it go its noisy pixels and what guides the denoiser, each
the nearest sample, so that noise stays noise. The traced pixels are put among those, and the target is denoised as a
whole: of that, the traced pixels are taken. The denoiser has then seen around each of them what it sees around any
pixel of a plain render. docs/production.md has the measurements behind this.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .contrast import box_sum
from .metrics import squared_error
from .passes import ALBEDO_PASS, COLOUR_PASS, NOISY_PASS, NORMAL_PASS, Passes

Denoise = Callable[[Sequence[Passes]], list[NDArray[np.float32]]]
"""Pictures of one size, with NOISY_PASS, ALBEDO_PASS and NORMAL_PASS, to their denoised colours (H, W, 3)."""

CHANGE_OVER = 6
"""Pixels each way over which the warped colours change over to what was refined beside them."""

WINDOW = (96, 120)
"""Height and width of the parts of the source that are denoised a second time."""

WINDOWS = (2, 4)
"""How many of them there are, down and across."""

MARGIN = 24
"""Pixels along a window's border that the denoiser judges by less than it does in the picture."""

LEAST_LEFT = 1e-4
"""Share of the variance that denoising is taken to leave at least."""


@dataclass(frozen=True)
class Denoising:
    """How pictures are denoised, and what share of a pixel's variance that leaves."""

    denoise: Denoise
    noise_left: float = 1.0

    def of(self, passes: Passes) -> NDArray[np.float32]:
        """The denoised colour (H, W, 4) of a picture; its alpha is left alone."""
        colour = passes[NOISY_PASS].copy()
        colour[..., :3] = self.denoise([guided(passes)])[0]
        return colour


def guided(passes: Passes) -> Passes:
    """What a denoiser looks at."""
    return {name: passes[name] for name in (NOISY_PASS, ALBEDO_PASS, NORMAL_PASS)}


def denoise_source(source: Passes, denoising: Denoising) -> Passes:
    """The source eye with its colour denoised."""
    return {**source, COLOUR_PASS: denoising.of(source)}


def denoise_target(
    target: Passes, kept: NDArray[np.bool_], denoising: Denoising, *, refined: NDArray[np.bool_] | None = None
) -> Passes:
    """The target eye, of which the pixels that are kept (H, W) were warped from the denoised source.

    Beside those that were refined (H, W) they change over to the target's own: the warp was wrong there, and may still
    be so by little, and where that ends would show as the edge of a tile.
    """
    colour = target[COLOUR_PASS]
    if kept.all():
        return target
    own = np.where(kept, 0.0, 1.0)
    if refined is not None and refined.any():
        near = box_sum(refined, (CHANGE_OVER, CHANGE_OVER)) / (2 * CHANGE_OVER + 1) ** 2
        own = np.maximum(own, np.minimum(2.0 * near, 1.0))
    blended = colour + own[..., None] * (denoising.of(target) - colour)
    return {**target, COLOUR_PASS: blended.astype(np.float32)}


def noise_left(source: Passes, denoise: Denoise) -> float:
    """Share of the variance of a traced pixel that is left in the denoised source, after `metrics.tone`.

    Found without a second render, by the wild bootstrap (Wu, 1986): in a few windows the noise is turned over where a
    coin falls so, and denoised once more. How far that is from the first time is what is left of such noise.
    """
    windows = _windows(source[COLOUR_PASS].shape[:2])
    looked_at = {COLOUR_PASS: source[COLOUR_PASS], **guided(source)}
    pictures = [{name: np.ascontiguousarray(image[window]) for name, image in looked_at.items()} for window in windows]
    coins = np.random.default_rng(0)
    before, after = 0.0, 0.0
    for picture, again in zip(pictures, denoise([_tossed(picture, coins) for picture in pictures]), strict=True):
        clean = picture[COLOUR_PASS]
        inner = _inner(clean.shape[:2])
        before += squared_error(picture[NOISY_PASS], clean)[inner].sum()
        after += squared_error(again, clean)[inner].sum()
    return float(np.clip(after / before, LEAST_LEFT, 1.0)) if before > 0.0 else 1.0


def _tossed(picture: Passes, coins: np.random.Generator) -> Passes:
    """The picture with the sign of its noise left to chance, pixel by pixel."""
    clean = picture[COLOUR_PASS]
    sign = coins.choice(np.array([-1.0, 1.0], np.float32), (*clean.shape[:2], 1))
    return {**guided(picture), NOISY_PASS: np.maximum(clean + sign * (picture[NOISY_PASS] - clean), 0.0)}


def _windows(shape: tuple[int, int]) -> list[tuple[slice, slice]]:
    """Spread evenly over the picture, which is taken as a whole where it has no room for them."""
    spans = []
    for size, length, count in zip(shape, WINDOW, WINDOWS, strict=True):
        if size < length * count:
            return [(slice(0, shape[0]), slice(0, shape[1]))]
        gap = (size - length * count) / count
        starts = [round((k + 0.5) * gap + k * length) for k in range(count)]
        spans.append([slice(start, start + length) for start in starts])
    return [(down, across) for down in spans[0] for across in spans[1]]


def _inner(shape: tuple[int, int]) -> tuple[slice, slice]:
    down, across = (MARGIN if size > 3 * MARGIN else 0 for size in shape)
    return slice(down, shape[0] - down), slice(across, shape[1] - across)
