"""Denoising of both views alike: warped pixels come from the denoised source, traced pixels from the denoised target.

The source is denoised and then warped, looked up between its pixels. Its noisy colours and the passes that guide the
denoiser are warped too, each as the nearest sample, so that noise stays noise. The traced pixels are put among those,
and the target is denoised as a whole; from the result only the traced pixels are taken. Around each of them, the
denoiser has then seen what it sees around any pixel of a plain render. docs/production.md has the measurements.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .contrast import box_sum
from .metrics import squared_error
from .passes import ALBEDO_PASS, COLOUR_PASS, NOISY_PASS, NORMAL_PASS, Passes
from .sides import mend_sides
from .tuning import TUNING

Denoise = Callable[[Sequence[Passes]], list[NDArray[np.float32]]]
"""A denoiser: takes pictures of one size, each with NOISY_PASS, ALBEDO_PASS and NORMAL_PASS, and returns the denoised
scene-linear colour (H, W, 3) of each."""


@dataclass(frozen=True)
class Denoising:
    """A denoiser, and how much noise it leaves.

    remaining_noise is the share of a pixel's variance, from 0 to 1, that is left after denoising; it is 1 as long as it
    was not measured, which the function `remaining_noise` does. wraps: True where pictures go on at their left beyond
    their right side: the denoiser then sees `ImagesTuning.denoise_sides_px` of the other side beyond each.
    """

    denoise: Denoise
    remaining_noise: float = 1.0
    wraps: bool = False

    def denoised_colour(self, passes: Passes) -> NDArray[np.float32]:
        """Return the denoised scene-linear colour (H, W, 4) of a picture's NOISY_PASS; alpha is not denoised."""
        colour = passes[NOISY_PASS].copy()
        inputs, beyond = denoiser_inputs(passes), 0
        if self.wraps:
            beyond = TUNING.denoise_sides_px
            inputs = {name: np.pad(i, ((0, 0), (beyond, beyond), (0, 0)), mode="wrap") for name, i in inputs.items()}
        colour[..., :3] = self.denoise([inputs])[0][:, beyond : beyond + colour.shape[1]]
        return colour


def denoiser_inputs(passes: Passes) -> Passes:
    """Return the passes that a denoiser takes: the noisy colour, and the albedo and normal that guide it."""
    return {name: passes[name] for name in (NOISY_PASS, ALBEDO_PASS, NORMAL_PASS)}


def denoise_source(source: Passes, denoising: Denoising) -> Passes:
    """Return the source's passes with COLOUR_PASS replaced by its denoised NOISY_PASS."""
    return {**source, COLOUR_PASS: denoising.denoised_colour(source)}


def denoise_target(
    target: Passes, warped: NDArray[np.bool_], denoising: Denoising, *, refined: NDArray[np.bool_] | None = None
) -> Passes:
    """Return the target's passes with COLOUR_PASS denoised, except at warped pixels (H, W), which keep their colour: it
    was warped from the denoised source already.

    Near refined pixels (H, W), which were traced because the warp was wrong, warped colours are blended with the
    target's own denoised ones. Otherwise the edge of a traced tile might show.
    """
    colour = target[COLOUR_PASS]
    if warped.all():
        return target
    own = np.where(warped, 0.0, 1.0)
    if refined is not None and refined.any():
        near = _share_around(refined)
        mend_sides([near], lambda columns: [_share_around(refined[:, columns])], wraps=denoising.wraps)
        own = np.maximum(own, np.minimum(2.0 * near, 1.0))
    blended = colour + own[..., None] * (denoising.denoised_colour(target) - colour)
    return {**target, COLOUR_PASS: blended.astype(np.float32)}


def _share_around(refined: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the share (H, W) of refined pixels (H, W) within `ImagesTuning.blend_reach_px` of each pixel."""
    reach = TUNING.blend_reach_px
    return box_sum(refined, (reach, reach)) / (2 * reach + 1) ** 2


def remaining_noise(source: Passes, denoise: Denoise) -> float:
    """Return the share, from 0 to 1, of a traced pixel's variance (after `metrics.tone`) that is left in the denoised
    source.

    source has NOISY_PASS and the denoised COLOUR_PASS. The share is measured without a second render, by the wild
    bootstrap (Wu, 1986): in a few windows of the picture the noise gets a random sign in each pixel, and the window is
    denoised; this is done twice, with different signs. Half the squared difference of the two is the variance that
    denoising leaves. The first denoised colours are no reference: denoising again also takes detail from them, which is
    not noise.
    """
    windows = _windows(source[COLOUR_PASS].shape[:2])
    needed = {COLOUR_PASS: source[COLOUR_PASS], **denoiser_inputs(source)}
    pictures = [{name: np.ascontiguousarray(image[window]) for name, image in needed.items()} for window in windows]
    coins = np.random.default_rng(0)
    tossed = [_with_random_signs(picture, coins) for picture in pictures for _ in range(2)]
    denoised = denoise(tossed)
    before, after = 0.0, 0.0
    for picture, once, again in zip(pictures, denoised[::2], denoised[1::2], strict=True):
        inner = _inner(picture[COLOUR_PASS].shape[:2])
        before += squared_error(picture[NOISY_PASS], picture[COLOUR_PASS])[inner].sum()
        after += squared_error(once, again)[inner].sum() / 2.0
    return float(np.clip(after / before, TUNING.min_remaining_noise, 1.0)) if before > 0.0 else 1.0


def _with_random_signs(picture: Passes, coins: np.random.Generator) -> Passes:
    """Return the passes that the denoiser takes of a picture, the noise of each pixel multiplied by 1 or -1 by chance.

    The noise is the difference between NOISY_PASS and the denoised COLOUR_PASS. coins draws the signs.
    """
    clean = picture[COLOUR_PASS]
    sign = coins.choice(np.array([-1.0, 1.0], np.float32), (*clean.shape[:2], 1))
    return {**denoiser_inputs(picture), NOISY_PASS: np.maximum(clean + sign * (picture[NOISY_PASS] - clean), 0.0)}


def _windows(shape: tuple[int, int]) -> list[tuple[slice, slice]]:
    """Return rows and columns of the parts of a picture of shape (H, W) in which the noise is measured.

    They are spread evenly over it. Where they do not fit, there is one, the whole picture.
    """
    spans = []
    for size, length, count in zip(shape, TUNING.denoise_window_px, TUNING.denoise_windows, strict=True):
        if size < length * count:
            return [(slice(0, shape[0]), slice(0, shape[1]))]
        gap = (size - length * count) / count
        starts = [round((k + 0.5) * gap + k * length) for k in range(count)]
        spans.append([slice(start, start + length) for start in starts])
    return [(down, across) for down in spans[0] for across in spans[1]]


def _inner(shape: tuple[int, int]) -> tuple[slice, slice]:
    """Return rows and columns of a window of shape (H, W) without its margin, where the denoiser saw too little around
    it.

    A window that is small in one direction keeps its margin there.
    """
    margin = TUNING.window_margin_px
    down, across = (margin if size > 3 * margin else 0 for size in shape)
    return slice(down, shape[0] - down), slice(across, shape[1] - across)
