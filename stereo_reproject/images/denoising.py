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
from .passes import ALBEDO_PASS, COLOUR_PASS, NOISY_PASS, NORMAL_PASS, Passes
from .sides import mend_sides
from .tuning import TUNING

Denoise = Callable[[Sequence[Passes]], list[NDArray[np.float32]]]
"""A denoiser: takes pictures of one size, each with NOISY_PASS, ALBEDO_PASS and NORMAL_PASS, and returns the denoised
scene-linear colour (H, W, 3) of each."""


@dataclass(frozen=True)
class Denoising:
    """A denoiser, and how much noise it has left in the source.

    residual_noise is the mean variance of that in a pixel, after `metrics.tone` (`images/residual_noise`); None as long
    as it was not measured. wraps: True where pictures go on at their left beyond their right side: the denoiser then
    sees `ImagesTuning.denoise_sides_px` of the other side beyond each.
    """

    denoise: Denoise
    residual_noise: float | None = None
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
