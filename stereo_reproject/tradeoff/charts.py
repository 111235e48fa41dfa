"""The charts of a price list as files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..report.chart_canvas import DOTS_PER_INCH, chart_style, draw_whole
from .chart import draw_tradeoff
from .stages_chart import draw_stages


def draw_charts(prices: Mapping[str, Any], folder: Path) -> None:
    """Write tradeoff.svg, tradeoff.png, stages.svg and stages.png of what tradeoff.json holds. Raises OSError."""
    with chart_style():
        for name, draw in (("tradeoff", draw_tradeoff), ("stages", draw_stages)):
            figure = draw(prices)
            # Without the date, the same figures make the same file.
            figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
            figure.savefig(folder / f"{name}.png", dpi=DOTS_PER_INCH)


def draw_stages_chart(prices: Mapping[str, Any], path: Path) -> None:
    """Write path.svg and path.png of where the time goes in what tradeoff.json holds. Raises OSError."""
    draw_whole(draw_stages, prices, path)
