"""The charts of a price list as files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..report.chart_canvas import DOTS_PER_INCH, chart_style, draw_whole
from .chart import draw_tradeoff
from .stages_chart import draw_stages


def draw_charts(prices: Mapping[str, Any], folder: Path) -> None:
    """Draw both charts of a price list into tradeoff.svg, tradeoff.png, stages.svg and stages.png in a folder. prices
    is the content of tradeoff.json. Raises OSError."""
    with chart_style():
        for name, draw in (("tradeoff", draw_tradeoff), ("stages", draw_stages)):
            figure = draw(prices)
            # Without the date, the same figures make the same file.
            figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
            figure.savefig(folder / f"{name}.png", dpi=DOTS_PER_INCH)


def draw_stages_chart(prices: Mapping[str, Any], path: Path) -> None:
    """Draw the chart of the seconds by stage into path.svg and path.png. prices has the form of tradeoff.json. Raises
    OSError."""
    draw_whole(draw_stages, prices, path)
