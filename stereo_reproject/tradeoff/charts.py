"""Charts as files: those of a price list, and any other that is drawn here.

Only the charts use matplotlib, which is no part of the Blender extension. Drawn on canvases of their own, without
pyplot: nothing that a caller does with matplotlib changes them, nor they it.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import BadInputError
from ..files import whole_file
from .chart import draw_tradeoff
from .chart_canvas import BLACK, DPI, GREY, PALE
from .stages_chart import draw_stages

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def check_charts() -> None:
    """Raises BadInputError where matplotlib is missing: better known before an hour of rendering than after."""
    try:
        import matplotlib.figure  # noqa: F401 - whether it can be imported is all that is asked
    except ImportError as error:
        raise BadInputError(f"the charts need matplotlib ({error}); run `pip install matplotlib`") from error


def draw_charts(prices: Mapping[str, Any], folder: Path) -> None:
    """Write tradeoff.svg, tradeoff.png, stages.svg and stages.png of what tradeoff.json holds. Raises OSError."""
    with _style():
        for name, draw in (("tradeoff", draw_tradeoff), ("stages", draw_stages)):
            figure = draw(prices)
            # Without the date, the same figures make the same file.
            figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
            figure.savefig(folder / f"{name}.png", dpi=DPI)


@contextlib.contextmanager
def _style() -> Iterator[None]:
    """matplotlib's own defaults, whatever the user's are, and texts that stay texts in an SVG."""
    import matplotlib.style

    ours = {
        "svg.fonttype": "none",
        "svg.hashsalt": "stereo_reproject",
        "font.size": 9.0,
        "axes.edgecolor": PALE,
        "axes.labelcolor": GREY,
        "xtick.color": GREY,
        "ytick.color": GREY,
        "text.color": BLACK,
    }
    with matplotlib.style.context(["default", ours]):
        yield


def draw_stages_chart(prices: Mapping[str, Any], path: Path) -> None:
    """Write path.svg and path.png of where the time goes in what tradeoff.json holds. Raises OSError."""
    draw_whole(draw_stages, prices, path)


def draw_whole(
    draw: Callable[[Mapping[str, Any]], Figure], data: Mapping[str, Any], path: Path, until_whole: Path | None = None
) -> None:
    """Write path.svg and path.png of the figure that `draw` makes of `data`; until_whole is as `whole_file` has it.

    Raises OSError.
    """
    with _style():
        figure = draw(data)
        # Several runs on the same frames may end at once.
        with whole_file(path.with_name(f"{path.name}.svg"), until_whole=until_whole) as beside:
            figure.savefig(beside, format="svg", metadata={"Date": None})
        with whole_file(path.with_name(f"{path.name}.png"), until_whole=until_whole) as beside:
            figure.savefig(beside, format="png", dpi=DPI)
