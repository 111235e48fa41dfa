"""Which way the holes are traced: chosen per frame from what the source cost, and always with a reason."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..errors import BadInputError

PACKED_PER_PIXEL = 1.15
"""Cost of a packed pixel over one of the source: holes lie along edges and in corners, where paths are long."""

CARD_PER_PIXEL = 0.1
"""Cost of a masked pixel behind a card over one of the source."""

CARD_SPACING = 3
"""How many times further apart probes are behind a card: each opens it for its whole filter."""

OPENED = 25
"""Pixels that a probe opens a card for, with a filter of the usual width."""

CLEARLY_LOWER = 0.9
"""Tracing holes is taken when it is predicted to cost less than this share of a full render."""


@dataclass(frozen=True)
class SourceCost:
    """Measured on the source render: the whole call, and what Cycles spent in it on syncing the scene, in seconds.

    denoise_seconds are what denoising it took afterwards."""

    seconds: float
    sync_seconds: float
    denoise_seconds: float = 0.0

    @property
    def per_frame(self) -> float:
        return max(self.seconds - self.sync_seconds, 0.0)

    @property
    def fixed(self) -> float:
        """Predicted cost of one more render call: Cycles keeps the synced scene, of which a part is synced again."""
        return 0.3 + 0.25 * self.sync_seconds


@dataclass(frozen=True)
class FillChoice:
    """method 'packed', 'card' or 'full'; reason in words; predicted seconds of the fill, 0 where nothing is traced."""

    method: str
    reason: str
    predicted_seconds: float


def check_fill(asked: str, blockers: Mapping[str, str | None]) -> None:
    """Raises BadInputError when the method that was asked for cannot be used here; blockers as for `choose_fill`."""
    if blockers.get(asked):
        raise BadInputError(f"--fill {asked} is not possible: {blockers[asked]}; use --fill auto")


def choose_fill(
    asked: str,
    fraction: float,
    cost: SourceCost,
    blockers: Mapping[str, str | None],
    *,
    spacing: int | None = None,
    expected: float = 0.0,
) -> FillChoice:
    """The fill for a frame of which `fraction` is to be traced, and one probe in each tile of `spacing` pixels, if any.

    blockers names the methods with why they cannot be used here, or None. expected is the share of the frame that will
    then have to be traced as well: if that makes a full render the cheaper way, it is taken at once.
    """
    if expected and asked == "auto":
        whole = choose_fill(asked, fraction + expected, cost, blockers, spacing=spacing)
        if whole.method == "full":
            note = f"{100 * expected:.0f} % of the frame is expected to be refined"
            return FillChoice("full", f"{whole.reason}; {note}", whole.predicted_seconds)
    probes = 2.0 / spacing**2 if spacing else 0.0
    opened = OPENED / (CARD_SPACING * spacing) ** 2 if spacing else 0.0
    predicted = {
        "packed": cost.fixed + PACKED_PER_PIXEL * (fraction + probes) * cost.per_frame,
        # A card's probes are traced again in a render of their own.
        "card": cost.fixed
        + min(CARD_PER_PIXEL + PACKED_PER_PIXEL * (fraction + opened), 1.1) * cost.per_frame
        + (cost.fixed + (CARD_PER_PIXEL + PACKED_PER_PIXEL * opened) * cost.per_frame if spacing else 0.0),
        "full": cost.fixed + cost.per_frame,
    }
    if asked != "auto":
        return FillChoice(asked, "asked for", predicted[asked])
    if fraction == 0.0 and not spacing:
        possible = (method for method in ("packed", "card") if not blockers.get(method))
        return FillChoice(next(possible, "full"), "no hole to fill", 0.0)
    possible = [method for method in ("packed", "card") if not blockers.get(method)]
    notes = [f"no {method}: {blockers[method]}" for method in ("packed", "card") if blockers.get(method)]
    best = min(possible, key=lambda method: predicted[method], default="full")
    if best != "full" and predicted[best] > CLEARLY_LOWER * predicted["full"]:
        notes.append(f"{best} is predicted to take {predicted[best]:.1f} s")
        best = "full"
    against = f" against {predicted['full']:.1f} s full" if best != "full" else ""
    return FillChoice(best, "; ".join([f"predicted {predicted[best]:.1f} s{against}", *notes]), predicted[best])
