"""The plan of a frame's traces: which fill method for which share of the picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from .costs import TraceCosts
from .fill import FillChoice, SourceCost, choose_fill
from .tuning import TUNING


@dataclass(frozen=True)
class FillPlanner:
    """Chooses fill methods for the traces of one frame.

    asked is the method that was asked for, or 'auto'; cost is that of the source render; blockers have by method the
    reason why it cannot be used, or None (as for `choose_fill`). costs are those of tracing, by default the
    assumed ones.
    """

    asked: str
    cost: SourceCost
    blockers: Mapping[str, str | None]
    costs: TraceCosts = field(default_factory=TraceCosts)

    def plan(self, fraction: float, *, spacing: int | None = None, expected: float = 0.0) -> FillChoice:
        """Return the fill method for tracing a share `fraction`, 0 to 1, of the picture, with its predicted seconds.

        spacing and expected are as for `choose_fill`.
        """
        asked, cost, blockers, costs = self.asked, self.cost, self.blockers, self.costs
        return choose_fill(asked, fraction, cost, blockers, costs=costs, spacing=spacing, expected=expected)

    @staticmethod
    def spacing(method: str, spacing: int) -> int:
        """Return the side, in pixels, of the tiles that have a probe each, when holes are traced by this method.

        `spacing` is the side that the accuracy asks for; behind a card probes are further apart.
        """
        return spacing * (TUNING.card_probe_spacing_factor if method == "card" else 1)
