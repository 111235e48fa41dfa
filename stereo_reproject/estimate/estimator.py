"""Estimators: how good the warped part of a target is, told by probes. A noisy and a denoised picture have one each."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..holes.reprojection import WarpedHoles
from ..images.bands import bands
from ..images.contrast import Contrast, contrast_of
from ..images.denoising import Denoising
from ..images.effects_pass import differ_in_reflected_light, effects_of
from ..images.metrics import COLOUR_CHANNELS, tone, untone
from ..images.passes import COLOUR_PASS, VIEW_DEPENDENT_PASS, Passes
from ..images.reflected_light import MAX_TONE
from .denoised import DenoisedEstimator
from .evidence import ProbeTraces, TileEvidence
from .noisy import NoisyEstimator
from .probes import Probes
from .target import Target


class Estimator(Protocol):
    """Tells from the traces of a target's probes how wrong its warped pixels are."""

    @property
    def contrast(self) -> Contrast:
        """Contrast of the warped light in which an error would show: probes are rather placed where there is much."""
        ...

    def measure(self, target: Target, probes: Probes, traces: ProbeTraces) -> tuple[Target, TileEvidence]:
        """Return the target with its slow errors corrected, and the evidence of its tiles.

        The target holds the traced probes already; traces has their colours as they were warped and in both traces.
        """
        ...


def estimator_of(
    reprojection: WarpedHoles, warped: NDArray[np.bool_], denoising: Denoising | None, *, wraps: bool = False
) -> Estimator | None:
    """Return the estimator for a warped view, by its pixels that are warped (H, W); None where none is. denoising is
    None for a picture that stays noisy. wraps: True where the picture goes on at its left beyond its right side."""
    if not warped.any():
        return None
    passes = reprojection.passes
    if denoising is None:
        return NoisyEstimator(contrast_of(passes[COLOUR_PASS], warped, wraps=wraps), reprojection.sampled)
    return DenoisedEstimator(contrast_of(light_that_differs(passes), warped, wraps=wraps), denoising)


def light_that_differs(passes: Passes) -> NDArray[np.float32]:
    """Return the scene-linear colour (H, W, 3 or 4) of all that may look different from each eye in a denoised picture,
    as bright after tone mapping as its part of the whole colour: that of VIEW_DEPENDENT_PASS, or the whole colour
    without that pass and where more than that may differ."""
    colour = passes[COLOUR_PASS]
    if VIEW_DEPENDENT_PASS not in passes:
        return colour
    effects = effects_of(passes)
    result = np.empty((*colour.shape[:2], COLOUR_CHANNELS), np.float32)
    for rows in bands(colour.shape[:2]):
        toned = tone(colour[rows])
        part = np.clip((1.0 - toned) ** 2 * passes[VIEW_DEPENDENT_PASS][rows], 0.0, MAX_TONE)
        result[rows] = untone(np.where(differ_in_reflected_light(effects[rows])[..., None], part, toned))
    return result
