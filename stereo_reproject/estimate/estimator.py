"""Estimators: how good the warped part of a target is, told by probes. A noisy and a denoised picture have one each."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..holes.reprojection import WarpedHoles
from ..images.contrast import Contrast, contrast_of
from ..images.denoising import Denoising
from ..images.passes import COLOUR_PASS, NOISY_PASS
from ..settings.accuracy import Accuracy
from .denoised import DenoisedEstimator
from .evidence import ProbeTraces, TileEvidence
from .noisy import NoisyEstimator
from .probes import Probes
from .target import Target


class Estimator(Protocol):
    """Places probes in a target, and tells from their traces how wrong its warped pixels are."""

    def place(self, warped: NDArray[np.bool_], *, spacing: int, seed: int) -> Probes:
        """Return one probe for each tile of `spacing` pixels that has any pixel of `warped` (H, W), placed at such a
        pixel.

        seed is that of the random places.
        """
        ...

    def measure(self, target: Target, probes: Probes, traces: ProbeTraces) -> tuple[Target, TileEvidence]:
        """Return the target with its slow errors corrected, and the evidence of its tiles.

        The target holds the traced probes already; traces has their colours as they were warped and in both traces.
        """
        ...


def estimator_of(
    reprojection: WarpedHoles, accuracy: Accuracy, denoising: Denoising | None, *, probed: bool
) -> Estimator | None:
    """Return the estimator for a warped view, or None where nothing is to be measured.

    Nothing is where the accuracy promises nothing, where every pixel is a hole, and where nothing that is seen can
    break the promise (`probed` is False). denoising is None for a picture that stays noisy.
    """
    holes = reprojection.reasons > 0
    if accuracy.promise is None or not probed or holes.all():
        return None
    contrast: Contrast = contrast_of(reprojection.passes[COLOUR_PASS], ~holes)
    if denoising is None:
        return NoisyEstimator(contrast, reprojection.sampled)
    return DenoisedEstimator(contrast, reprojection.passes[NOISY_PASS].copy(), denoising)
