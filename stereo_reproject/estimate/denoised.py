"""The estimator for a denoised picture, which has a fiftieth of the probes' noise: errors show beside that.

Most of a probe's noise is that of diffuse light, which looks the same from each eye and is warped rightly; what looks
different is reflected and transmitted light, which has little noise where there is little of it. So a probe is heard in
two ways, and with W the warped colour, T a trace, and V and v what of a trace and of the warped source is reflected or
transmitted light, all after tone mapping,

    T - W,          with the noise of all light of a trace, and
    V - v,          with the noise of the reflected light alone, of the trace and of the source,

have the same mean, what W is off by, where all that differs is such light. The mean of both is taken that has the least
noise (control variates).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..images.contrast import Contrast, box_sum
from ..images.denoising import Denoising
from ..images.effects_pass import materials_of
from ..images.metrics import COLOUR_CHANNELS, channel_mean, judged_channel, tone, untone
from ..images.passes import COLOUR_PASS, NOISY_PASS
from ..images.residual_noise import residual_noise
from .bias import SourceNoise, bias_of
from .evidence import DeliveredNoise, ProbeTraces, TileEvidence, measure_tiles
from .probes import Probes
from .target import Provenance, Target
from .tuning import TUNING

MIN_NOISE = 1e-12
"""Variance that is added to a divisor, so that a picture without noise divides by something."""


@dataclass(frozen=True)
class DenoisedEstimator:
    """The `Estimator` for a denoised picture.

    contrast is that of the light in the warped picture that may look different from each eye, as far as it is known
    apart.
    """

    contrast: Contrast
    denoising: Denoising

    def measure(self, target: Target, probes: Probes, traces: ProbeTraces) -> tuple[Target, TileEvidence]:
        """Return the target with its slow errors corrected, and the evidence of its tiles, as `Estimator` says.

        The noisy colour of warped pixels is moved as the denoised one is, so that traced pixels are denoised among
        neighbours of their own brightness.
        """
        materials = materials_of(target.passes)
        target.colour[probes.mask] = traces.warped
        _, once, again = traces.toned(traces.finite)
        source = source_noise(probes, target.colour, target.passes[NOISY_PASS], target.warped)
        delivered = self._delivered(probes, once - again, target)
        heard, noise = self._heard(probes, traces, delivered, source)
        # A pilot's probes keep the warped colour too.
        warped = target.warped | target.any_of(Provenance.PROBE)
        kinds = np.zeros(warped.shape, np.intp) if materials is None else materials
        bias = bias_of(probes, heard, self.contrast.signal, kinds, noise=noise)
        before = target.colour.copy() if bias.added.any() else target.colour
        bias.correct([target.colour], before, warped, kinds)
        if bias.added.any():
            # The traced pixels are to be denoised among neighbours that are as bright as theirs.
            noisy = target.passes[NOISY_PASS]
            moved = np.where(target.warped[..., None], target.colour - before, 0.0)
            np.maximum(noisy + moved, 0.0, out=noisy)
        evidence = measure_tiles(
            probes,
            target.warped | probes.mask,
            self.contrast,
            replace(heard, warped=bias.at_probes(traces.warped, without_own=True)),
            materials=materials,
            delivered=delivered,
        )
        return target, evidence

    def _delivered(self, probes: Probes, difference: NDArray[np.float64], target: Target) -> DeliveredNoise:
        """Return the noise of the finished picture. difference (N, 3 or 4) is that of the probes' two traces, as they
        are judged: the denoiser leaves all of alpha's noise.
        """
        mean = probes.neighbourhood_mean
        light, alpha = (_variance(difference[:, of]) for of in (slice(COLOUR_CHANNELS), slice(COLOUR_CHANNELS, None)))
        known = target.warped & ~probes.mask
        residual = residual_noise({NOISY_PASS: target.passes[NOISY_PASS], COLOUR_PASS: target.colour}, known)
        side = TUNING.source_noise_reach_tiles * probes.spacing
        near = probes.rows, probes.columns
        of_light = box_sum(residual, (side, side))[near] / np.maximum(box_sum(known, (side, side))[near], 1.0)
        of_alpha = float(np.average(alpha, weights=probes.weight)) if probes.weight.size else 0.0
        assert self.denoising.residual_noise is not None
        return DeliveredNoise(of_light, mean(alpha), self.denoising.residual_noise + of_alpha, mean(light + alpha))

    def _heard(
        self, probes: Probes, traces: ProbeTraces, delivered: DeliveredNoise, source: SourceNoise
    ) -> tuple[ProbeTraces, SourceNoise]:
        """Return the traces with the noise taken out of them that both hearings together can take out, and with the
        share of their variance that the warped colours have; and the noise that they then have.

        source is the noise of all light in the source's single pixels.
        """
        known = traces.finite
        was = traces.warped if traces.uncorrected is None else traces.uncorrected
        colour = tone(np.where(known[:, None], was, 0.0)).astype(np.float64)
        _, *seen = traces.toned(known)
        mean = probes.neighbourhood_mean
        all_light = [trace[:, :COLOUR_CHANNELS] - colour - source.shift for trace in seen]
        # The denoiser leaves alpha's noise, which both the warped and the traced pixels have.
        of_alpha = delivered.alpha
        share = np.ones(colour.shape[0])
        kept = mean(delivered.light)
        heard, noise = all_light, mean(_variance(all_light[0] - all_light[1]))
        if traces.reflected is not None:
            apart = traces.reflected
            # The rest of the light, so that one bright spark weighs no more than after the tone mapping of all light.
            around = np.stack([mean(channel) for channel in apart.warped.T], axis=-1)
            rest = np.maximum(untone(colour) - around, 0.0)
            source_toned = tone(rest + apart.warped)
            reflected = [tone(rest + light).astype(np.float64) - source_toned for light in (apart.once, apart.again)]
            of_reflected = mean(_variance(reflected[0] - reflected[1]))
            others = [whole - part for whole, part in zip(all_light, reflected, strict=True)]
            of_rest = mean(_variance(others[0] - others[1]))
            of_source = apart.variance_share * of_reflected
            share = np.where(apart.tells, of_source / (of_source + of_rest + MIN_NOISE), 1.0)
            heard = [part + share[:, None] * other for part, other in zip(reflected, others, strict=True)]
            kept = share**2 * kept + (1.0 - share) ** 2 * of_source
            noise = mean(_variance(heard[0] - heard[1]))
        both = [
            np.concatenate([colour + off, trace[:, COLOUR_CHANNELS:]], axis=-1)
            for off, trace in zip(heard, seen, strict=True)
        ]
        kept = (kept + of_alpha) / (noise + of_alpha + MIN_NOISE)
        # A few probes may all have been spared what makes others bright: the source's pixels around tell of it too.
        left = SourceNoise(np.zeros_like(colour), np.maximum(noise, share**2 * source.variance), in_warp=kept)
        return replace(traces, heard=(both[0], both[1]), variance_share=kept), left


def _variance(difference: NDArray) -> NDArray[np.float64]:
    """Return the variance (N,) that one of two values has, by their difference (N, C), as a mean over the channels."""
    return channel_mean(difference**2) / 2.0


def source_noise(
    probes: Probes, colour: NDArray[np.float32], noisy: NDArray[np.float32], warped: NDArray[np.bool_]
) -> SourceNoise:
    """Return the noise of the source's single pixels around each probe, by the difference of their noisy and denoised
    colours.

    colour is denoised, noisy is not, both (H, W, C). Only the pixels of warped (H, W) that are no probes count: they
    have both colours from the source.
    """
    known = warped & ~probes.mask
    near = probes.rows, probes.columns
    side = TUNING.source_noise_reach_tiles * probes.spacing
    reach = side, side
    pixels = np.maximum(box_sum(known, reach)[near], 1.0)
    squares, shifts = np.zeros(known.shape, np.float32), []
    for channel in range(COLOUR_CHANNELS):
        change = judged_channel(noisy, channel) - judged_channel(colour, channel)
        change[~known] = 0.0
        shifts.append(box_sum(change, reach)[near] / pixels)
        squares += change**2 / COLOUR_CHANNELS
    shift = np.stack(shifts, axis=-1)
    variance = box_sum(squares, reach)[near] / pixels - np.mean(shift**2, axis=-1)
    return SourceNoise(shift, np.maximum(variance, 0.0))
