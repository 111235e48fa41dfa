"""What each effect of a scene has cost, and what of the error is left on its account."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .effects import SEEN_DIFFERENTLY, Effect
from .holes import Reason
from .probes import Measured

FROM_REASON = {
    Reason.VOLUME: Effect.VOLUME,
    Reason.DEFOCUS: Effect.DEPTH_OF_FIELD,
    Reason.MOTION: Effect.MOTION_BLUR,
    Reason.TRANSPARENT: Effect.TRANSMISSION,
}
"""Reasons that are an effect's own; pixels with any other are on the account of what they show."""

ASKED_FOR = Reason.VOLUME | Reason.DEFOCUS | Reason.MOTION | Reason.TRANSPARENT | Reason.REFINED | Reason.PROBE
"""Reasons that an effect has given: holes and silhouettes there would be without any."""

EVERYWHERE = Effect.DEPTH_OF_FIELD | Effect.MOTION_BLUR | Effect.VOLUME
"""Effects that no surface tells of: any pixel may have them."""


@dataclass(frozen=True)
class Account:
    """Share of the target's pixels that was traced because of an effect, the seconds of that, and the excess error that
    is left where it is seen; None where no probe tells. A pixel that shows several effects counts in the share and the
    excess of each, and its seconds are divided between them."""

    fraction: float
    seconds: float
    excess: float | None


def accounts(
    called_for: Effect,
    shown: NDArray[np.int32],
    reasons: NDArray[np.uint16],
    seconds: Mapping[str, float],
    measured: Measured | None,
) -> dict[Effect, Account]:
    """The account of each effect that is called for and may be seen differently by each eye.

    shown (H, W) holds the `Effect` flags of the target's pixels, reasons (H, W) why they were traced, seconds those of
    the stages.
    """
    wanted = called_for & SEEN_DIFFERENTLY
    shown = np.where(shown > 0, shown, int(wanted)) | int(wanted & EVERYWHERE)
    for reason, effect in FROM_REASON.items():
        shown = np.where(reasons & reason.bit > 0, effect.value, shown)
    shown &= int(wanted)
    asked_for = (reasons & np.uint16(ASKED_FOR.value)) > 0
    several = sum(((shown & effect.value) > 0).astype(np.int32) for effect in wanted)
    cost = _seconds_per_pixel(reasons, seconds) / np.maximum(several, 1)
    result = {}
    for effect in wanted:
        has = (shown & effect.value) > 0
        result[effect] = Account(
            float(np.mean(has & asked_for)), float(cost[has & asked_for].sum()), _excess(measured, has)
        )
    return result


def _seconds_per_pixel(reasons: NDArray[np.uint16], seconds: Mapping[str, float]) -> NDArray[np.float64]:
    """(H, W): the seconds that each traced pixel has cost; a probe is traced twice."""
    refined, probes = (reasons & Reason.REFINED.bit) > 0, (reasons & Reason.PROBE.bit) > 0
    filled = np.where(probes, 2.0, ((reasons > 0) & ~refined).astype(np.float64))
    cost = filled * (seconds.get("fill", 0.0) + seconds.get("pilot", 0.0)) / max(filled.sum(), 1.0)
    return cost + refined * seconds.get("refine", 0.0) / max(refined.sum(), 1.0)


def _excess(measured: Measured | None, has: NDArray[np.bool_]) -> float | None:
    if measured is None or not measured.frame_noise:
        return None
    probes = measured.probes
    counted = has[probes.rows, probes.columns] & ~measured.refined
    return float(measured.excess[counted].sum() / measured.frame_noise)
