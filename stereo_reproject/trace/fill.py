"""The choice of a fill method: by frame, from what the source has cost, and with the reason in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..errors import BadInputError
from ..words import Words
from .costs import TraceCosts
from .tuning import TUNING


@dataclass(frozen=True)
class SourceCost:
    """Seconds measured on the source render.

    seconds: the whole render call. sync_seconds: the part of it in which Cycles synced the scene. denoise_seconds:
    denoising the picture afterwards, which is not in seconds.
    """

    seconds: float
    sync_seconds: float
    denoise_seconds: float = 0.0

    @property
    def per_frame(self) -> float:
        """Seconds that it takes to trace all pixels of a frame, without the sync."""
        return max(self.seconds - self.sync_seconds, 0.0)

    def fixed(self, costs: TraceCosts) -> float:
        """Return the predicted seconds of one more render call before any pixel is traced.

        Cycles keeps the synced scene, of which a part is synced again.
        """
        return costs.render_call_seconds + costs.resync_share * self.sync_seconds


@dataclass(frozen=True)
class FillChoice:
    """A fill method, the reason for it in words, and the seconds that it is predicted to take, 0 where nothing is
    traced.

    The method is 'packed' (a small picture of the holes alone), 'card' (the frame behind a card that is open at the
    holes) or 'full' (the whole view).
    """

    method: str
    reason: str
    predicted_seconds: float


def check_fill(asked: str, blockers: Mapping[str, str | None]) -> None:
    """Raise BadInputError when the fill method that was asked for cannot be used here; 'auto' always can.

    blockers are as for `choose_fill`.
    """
    if blockers.get(asked):
        raise BadInputError(
            Words("--fill {asked} is not possible: {reason}; use --fill auto", asked=asked, reason=blockers[asked])
        )


def choose_fill(
    asked: str,
    fraction: float,
    cost: SourceCost,
    blockers: Mapping[str, str | None],
    *,
    costs: TraceCosts | None = None,
    spacing: int | None = None,
    expected: float = 0.0,
) -> FillChoice:
    """Return the cheapest fill method for a share `fraction`, 0 to 1, of a frame that is to be traced, or the one asked
    for.

    asked is a method, or 'auto' for the cheapest one. cost is that of the source render. blockers has, by method, the
    reason why it cannot be used here, or None. costs are those of tracing, by default the assumed ones. With spacing,
    one pixel in each tile so many pixels wide is a probe, traced twice. expected is the share of the frame that will
    have to be traced afterwards as well: if that makes a full render the cheaper way, it is chosen at once.
    """
    costs = costs or TraceCosts()
    if expected and asked == "auto":
        whole = choose_fill(asked, fraction + expected, cost, blockers, costs=costs, spacing=spacing)
        if whole.method == "full":
            note = f"{100 * expected:.0f} % of the frame is expected to be refined"
            return FillChoice("full", f"{whole.reason}; {note}", whole.predicted_seconds)
    predicted = _predicted_seconds(fraction, cost, costs, spacing)
    if asked != "auto":
        return FillChoice(asked, "asked for", predicted[asked])
    possible = [method for method in ("packed", "card") if not blockers.get(method)]
    if fraction == 0.0 and not spacing:
        return FillChoice(next(iter(possible), "full"), "no hole to fill", 0.0)
    notes = [f"no {method}: {blockers[method]}" for method in ("packed", "card") if blockers.get(method)]
    best = min(possible, key=lambda method: predicted[method], default="full")
    if best != "full" and predicted[best] > TUNING.max_share_of_full_cost * predicted["full"]:
        notes.append(f"{best} is predicted to take {predicted[best]:.1f} s")
        best = "full"
    foreseen = f"predicted to take {predicted[best]:.1f} s"
    if best != "full":
        foreseen += f", the whole eye {predicted['full']:.1f} s"
    return FillChoice(best, "; ".join([foreseen, *notes]), predicted[best])


def _predicted_seconds(fraction: float, cost: SourceCost, costs: TraceCosts, spacing: int | None) -> dict[str, float]:
    """Return the predicted seconds by fill method, where a share `fraction` of the frame is traced.

    spacing: side in pixels of the tiles that have a probe each, None without probes. cost is that of the source render,
    costs are those of tracing.
    """
    pixel, masked, fixed = costs.packed_pixel_cost, costs.card_pixel_cost, cost.fixed(costs)
    apart = TUNING.card_probe_spacing_factor
    probes = 2.0 / spacing**2 if spacing else 0.0
    opened = TUNING.card_pixels_per_probe / (apart * spacing) ** 2 if spacing else 0.0
    return {
        "packed": fixed + pixel * (fraction + probes) * cost.per_frame,
        # A card's probes are traced again in a render of their own.
        "card": fixed
        + min(masked + pixel * (fraction + opened), TUNING.max_card_frame_cost) * cost.per_frame
        + (fixed + (masked + pixel * opened) * cost.per_frame if spacing else 0.0),
        "full": fixed + cost.per_frame,
    }
