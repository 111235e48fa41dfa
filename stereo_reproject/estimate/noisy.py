"""The estimator for a picture that stays noisy: probes at random places, read one by one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..images.contrast import Contrast
from ..images.effects_pass import materials_of
from ..images.passes import is_light
from .bias import SourceNoise, bias_of
from .evidence import ProbeTraces, TileEvidence, measure_tiles
from .probes import Probes
from .target import Target


@dataclass(frozen=True)
class NoisyEstimator:
    """The `Estimator` for a picture that is not denoised.

    contrast is that of the warped picture. single_samples takes rows and columns (N,) of target pixels, and gives for
    each the colour (N, C) of the single source pixel nearest to what it shows.
    """

    contrast: Contrast
    single_samples: Callable[[tuple[NDArray[np.intp], NDArray[np.intp]]], NDArray[np.float32]]

    def measure(self, target: Target, probes: Probes, traces: ProbeTraces) -> tuple[Target, TileEvidence]:
        """Return the target with its slow errors corrected, and the evidence of its tiles, as `Estimator` says."""
        materials = materials_of(target.passes)
        expected = self._correct(target, probes, traces, materials)
        evidence = measure_tiles(
            probes,
            target.warped | probes.mask,
            self.contrast,
            replace(traces, warped=expected),
            materials=materials,
        )
        return target, evidence

    def _correct(
        self, target: Target, probes: Probes, traces: ProbeTraces, shown: NDArray[np.integer] | None
    ) -> NDArray[np.float32]:
        """Take slow errors away from the target's warped pixels, in place, in all parts of their light alike.

        Return the colours (N, 3) that the probes' pixels would then have, corrected by what other tiles' probes tell.
        shown (H, W) is a number for the materials of each pixel, None if they are not known.
        """
        warped = target.warped
        materials = np.zeros(warped.shape, np.intp) if shown is None else shown
        noise = SourceNoise.of_noisy(probes.neighbourhood_mean(probes.tile_mean(self.contrast.noise, warped)))
        place = probes.rows, probes.columns
        # The warped colours hold a pilot's correction already.
        was = traces.warped if traces.uncorrected is None else traces.uncorrected
        once_more = np.divide(traces.warped, was, out=np.ones_like(traces.warped), where=was > 0.0)
        sampled = self.single_samples(place) * once_more
        # The one is half a pixel aside, the other brighter because it is less noisy.
        by_sample, by_mean = (
            bias_of(probes, replace(traces, warped=w), self.contrast.signal, materials, noise=noise)
            for w in (sampled, traces.warped)
        )
        bias = by_sample.agreed(by_mean)
        light = [image for name, image in target.passes.items() if is_light(name)]
        bias.correct(light, target.colour, warped, materials)
        return bias.at_probes(traces.warped, without_own=True)
