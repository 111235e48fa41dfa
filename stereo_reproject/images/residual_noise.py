"""Noise that a denoiser has left in a picture, by the picture itself.

A denoiser cannot tell noise from detail. Where a pixel differs from those around it by much more than its noise, it
keeps nearly all of that noise, and among equal pixels hardly any. The best linear filter (Wiener, 1949) has a mean
square error of N S / (N + S) there, with N the variance of the noise and S that of the detail. The variance that
Cycles' denoiser leaves is in proportion to that, in all scenes and within each picture; docs/production.md has the
measurements.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .bands import bands
from .contrast import box_sum
from .metrics import COLOUR_CHANNELS, judged_channel
from .passes import COLOUR_PASS, NOISY_PASS, Passes
from .tuning import TUNING


def residual_noise(passes: Passes, known: NDArray[np.bool_] | None = None) -> NDArray[np.float32]:
    """Return the variance (H, W), after `metrics.tone`, of the noise that denoising has left in each pixel.

    passes has NOISY_PASS and the denoised COLOUR_PASS. Only the pixels of known (H, W), None for all, count; it is 0
    elsewhere.
    """
    noisy, colour = passes[NOISY_PASS], passes[COLOUR_PASS]
    result = np.zeros(colour.shape[:2], np.float32)
    reach = max(TUNING.residual_noise_reach_px[0], TUNING.residual_noise_detail_reach_px[0])
    for rows in bands(result.shape):
        around = slice(max(rows.start - reach, 0), rows.stop + reach)
        of_band = np.ones(result[around].shape, bool) if known is None else known[around]
        part = _residual_in(noisy[around], colour[around], of_band)
        result[rows] = part[rows.start - around.start :][: rows.stop - rows.start]
    return result


def _residual_in(
    noisy: NDArray[np.float32], colour: NDArray[np.float32], known: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return `residual_noise` of some rows of a picture, whose scene-linear colours (h, W, >= 3) these are."""
    noise, detail = np.zeros(known.shape), np.zeros(known.shape)
    detail_reach = TUNING.residual_noise_detail_reach_px
    near = np.maximum(box_sum(known, detail_reach), 1.0)
    # What is not known may be no number.
    noisy, colour = (np.where(known[..., None], image, np.float32(0.0)) for image in (noisy, colour))
    for channel in range(COLOUR_CHANNELS):
        clean = judged_channel(colour, channel)
        noise += (judged_channel(noisy, channel) - clean) ** 2 / COLOUR_CHANNELS
        detail += (clean - box_sum(clean, detail_reach) / near) ** 2 * known / COLOUR_CHANNELS
    reach = TUNING.residual_noise_reach_px
    noise = np.maximum(box_sum(noise, reach), 0.0) / np.maximum(box_sum(known, reach), 1.0)
    both = noise + detail
    return TUNING.residual_noise_share * noise * detail / np.where(both > 0.0, both, 1.0)
