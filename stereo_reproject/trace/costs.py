"""The costs of tracing by which fill methods are chosen: assumed at first, then measured on the machine that traces."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from .tuning import TUNING

ASSUMED, MEASURED, AGREED = "assumed", "measured here", "agreed"
"""Sources of costs: nothing was measured yet; measured by this user on this device; common to an animation's frames."""


@dataclass(frozen=True)
class TraceCosts:
    """Costs of tracing, from which the seconds of each fill method are predicted; without arguments, those assumed.

    packed_pixel_cost is that of a packed pixel over one of the source, card_pixel_cost that of a masked pixel behind a
    card over one of the source. render_call_seconds are those of a render call before any pixel is traced, apart from
    the sync. resync_share is the sync of such a call over the first sync of the scene. source is one of `ASSUMED`,
    `MEASURED` and `AGREED`.
    """

    packed_pixel_cost: float = field(default_factory=lambda: TUNING.packed_pixel_cost)
    card_pixel_cost: float = field(default_factory=lambda: TUNING.card_pixel_cost)
    render_call_seconds: float = field(default_factory=lambda: TUNING.render_call_seconds)
    resync_share: float = field(default_factory=lambda: TUNING.resync_share)
    source: str = ASSUMED

    @property
    def numbers(self) -> dict[str, float]:
        """All costs by name."""
        return {name: getattr(self, name) for name in COST_NAMES}

    def within_limits(self) -> TraceCosts:
        """Return these costs with each one held within its limits."""
        held = {name: min(max(getattr(self, name), low), high) for name, (low, high) in cost_limits().items()}
        return replace(self, **held)


COST_NAMES = tuple(one.name for one in fields(TraceCosts) if one.name != "source")
"""Names of the costs."""


def cost_limits() -> dict[str, tuple[float, float]]:
    """Return the least and the greatest value of each cost by name, beyond which no measurement is believed."""
    return {
        "packed_pixel_cost": TUNING.packed_pixel_cost_limits,
        "card_pixel_cost": TUNING.card_pixel_cost_limits,
        "render_call_seconds": TUNING.render_call_seconds_limits,
        "resync_share": TUNING.resync_share_limits,
    }


def costs_of(numbers: Any, source: str) -> TraceCosts | None:
    """Return the costs that `numbers`, a dict as in `TraceCosts.numbers`, holds, within their limits; source says where
    they come from.

    None for anything else: what is read from a file may be of any kind.
    """
    if not isinstance(numbers, Mapping) or not all(_is_number(numbers.get(name)) for name in COST_NAMES):
        return None
    return TraceCosts(**{name: float(numbers[name]) for name in COST_NAMES}, source=source).within_limits()


def _is_number(value: Any) -> bool:
    """Return whether a value is a number that a float can hold, which true and false are not."""
    return type(value) in (int, float) and abs(value) <= sys.float_info.max
