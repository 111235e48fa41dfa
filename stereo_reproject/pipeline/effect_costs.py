"""Costs of each effect of a scene: pixels and seconds that it took, and the error that is left where it is seen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..estimate.evidence import TileEvidence
from ..estimate.expected_excess import CONFIDENCE_95_SIGMAS
from ..images.bands import bands
from ..images.effects import SEEN_DIFFERENTLY, WHOLE_FRAME_EFFECTS, Effect
from ..images.effects_pass import UNKNOWN_EFFECTS, flagged
from ..images.reasons import Reason

FROM_REASON = {
    Reason.VOLUME: Effect.VOLUME,
    Reason.DEFOCUS: Effect.DEPTH_OF_FIELD,
    Reason.TRANSPARENT: Effect.TRANSMISSION,
}
"""Reasons that belong to one effect; pixels with any other count for the effects that they show."""

ASKED_FOR = Reason.VOLUME | Reason.DEFOCUS | Reason.TRANSPARENT | Reason.REFINED | Reason.PROBE
"""Reasons that effects have: holes and silhouettes would be there without any, but for those of hair."""


@dataclass(frozen=True)
class EffectCost:
    """Cost of an effect, and the error that is left where it is seen.

    fraction: share of the target's pixels that were traced because of it. seconds: time that this took; a pixel that
    shows several effects is divided between them, and a probe that shows none between all. excess: squared error beyond
    noise over that of noise, as in `noise_ratio.Estimate`, of the warped pixels that show it, followed by the low and
    high end of its 95 % interval; None where no probe tells.
    """

    fraction: float
    seconds: float
    excess: tuple[float, float, float] | None


def effect_costs(
    called_for: Effect,
    shown: NDArray[np.int32],
    reasons: NDArray[np.uint16],
    traced: NDArray[np.bool_],
    seconds: Mapping[str, float],
    evidence: TileEvidence | None,
) -> dict[Effect, EffectCost]:
    """Return the cost of each effect that is called for and may make the two eyes differ, by effect.

    shown (H, W) holds the `Effect` flags of the target's pixels, UNKNOWN_EFFECTS where they are not known. reasons (H,
    W) are the `Reason` flags for which pixels were traced, and traced (H, W) the pixels that were: one without a reason
    was traced because a full render was the cheaper way. seconds are by stage; evidence is that of the probes, None
    where none tell.
    """
    wanted = called_for & SEEN_DIFFERENTLY
    per_pixel = _SecondsPerPixel.of_frame(reasons, traced, seconds)
    pixels, own = dict.fromkeys(wanted, 0), dict.fromkeys(wanted, 0.0)
    has = {effect: np.empty(shown.shape, bool) for effect in wanted}
    shared = 0.0
    for rows in bands(shown.shape):
        why, was_traced = reasons[rows], traced[rows]
        strands = _edges_of_strands(wanted, shown[rows], why)
        charged = np.where(strands, Effect.HAIR.value, _effects_to_charge(wanted, shown[rows], why))
        asked_for = strands | ((why & np.uint16(ASKED_FOR.value)) > 0) | (was_traced & (why == 0))
        cost = np.where(asked_for, per_pixel.at(why, was_traced), 0.0)
        shared += float(cost[charged == 0].sum()) / max(len(list(wanted)), 1)
        several = np.sum([(charged & effect.value) > 0 for effect in wanted], axis=0)
        for effect in wanted:
            here = has[effect][rows] = (charged & effect.value) > 0
            pixels[effect] += int((here & asked_for).sum())
            own[effect] += float((cost[here] / several[here]).sum())
    return {
        effect: EffectCost(pixels[effect] / shown.size, own[effect] + shared, _excess(evidence, has[effect]))
        for effect in wanted
    }


def _edges_of_strands(wanted: Effect, shown: NDArray[np.int32], reasons: NDArray[np.uint16]) -> NDArray[np.bool_]:
    """Return the pixels (H, W) that are traced as silhouettes because they show hair; none where hair is not
    `wanted`."""
    return flagged(shown, wanted & Effect.HAIR) & ((reasons & Reason.SILHOUETTE.bit) > 0)


def _effects_to_charge(wanted: Effect, shown: NDArray[np.int32], reasons: NDArray[np.uint16]) -> NDArray[np.int32]:
    """Return flags (H, W) of those `wanted` effects that each pixel's cost is charged to.

    They are the effects of its reasons, where it has a reason that belongs to one; else all that it shows, and those of
    the whole frame; all of `wanted` where it is not known what it shows.
    """
    result = np.where(shown == UNKNOWN_EFFECTS, int(wanted), shown | int(wanted & WHOLE_FRAME_EFFECTS))
    own = np.zeros_like(result)
    for reason, effect in FROM_REASON.items():
        own |= np.where((reasons & reason.bit) > 0, effect.value, 0)
    return np.where(own > 0, own, result) & int(wanted)


@dataclass(frozen=True)
class _SecondsPerPixel:
    """Seconds that tracing a pixel has cost, once, in the fill or a pilot, and among the refined ones."""

    filled: float
    refined: float

    @classmethod
    def of_frame(
        cls, reasons: NDArray[np.uint16], traced: NDArray[np.bool_], seconds: Mapping[str, float]
    ) -> _SecondsPerPixel:
        """Return the seconds per pixel of a frame with these reasons and traced pixels (H, W). seconds are by stage:
        those of fill and pilot are divided among their pixels, of which a probe is two, those of refine among the
        refined ones."""
        refined = int(((reasons & Reason.REFINED.bit) > 0).sum())
        filled = sum(float(_times_filled(reasons[rows], traced[rows]).sum()) for rows in bands(reasons.shape))
        fill = seconds.get("fill", 0.0) + seconds.get("pilot", 0.0)
        return cls(fill / max(filled, 1.0), seconds.get("refine", 0.0) / max(refined, 1.0))

    def at(self, reasons: NDArray[np.uint16], traced: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return the seconds (h, W) of pixels with these reasons (h, W); 0 for those that were not traced."""
        return _times_filled(reasons, traced) * self.filled + ((reasons & Reason.REFINED.bit) > 0) * self.refined


def _times_filled(reasons: NDArray[np.uint16], traced: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return how often each pixel (h, W) was traced in the fill or a pilot: a probe is traced twice."""
    refined, probes = (reasons & Reason.REFINED.bit) > 0, (reasons & Reason.PROBE.bit) > 0
    return np.where(probes, 2.0, (traced & ~refined).astype(np.float64))


def _excess(evidence: TileEvidence | None, has: NDArray[np.bool_]) -> tuple[float, float, float] | None:
    """Return the excess of the pixels (H, W) that show an effect, and the low and high end of its 95 % interval.

    It is the part that they have in the frame's, as a share of the frame's noise. None without evidence, or without
    noise.
    """
    if evidence is None or not evidence.frame_noise:
        return None
    probes = evidence.probes
    own = evidence.remaining_beyond_render[has[probes.rows, probes.columns]] / evidence.frame_noise
    excess, reach = float(own.sum()), CONFIDENCE_95_SIGMAS * float(np.sqrt(np.sum(own**2)))
    return excess, excess - reach, excess + reach
