"""The canvas, colours, texts and files that all charts share.

Only charts use matplotlib, which is no part of the Blender extension. They are drawn on canvases of their own, without
pyplot: nothing that a caller does with matplotlib changes them, and they change nothing of the caller's.
"""

from __future__ import annotations

import contextlib
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import BadInputError
from ..files import whole_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_INCHES = 9.0
"""Width of every figure."""
NOTE_LINE_INCHES = 0.15
"""Inches from one line of the notes to the next."""
NOTE_LINE_CHARACTERS = 145
"""Characters in a line of the notes."""
DOTS_PER_INCH = 160

# The palette of M. Okabe and K. Ito, "Color universal design", 2008, which the colour-blind tell apart too.
BLUE, SKY, GREEN, ORANGE, VERMILLION = "#0072b2", "#56b4e9", "#009e73", "#e69f00", "#d55e00"
PURPLE, YELLOW, BLACK = "#cc79a7", "#f0e442", "#1a1a1a"
GREY, PALE = "#5c6670", "#aab2ba"


def new_figure(height: float) -> Figure:
    """Return an empty white figure, WIDTH_INCHES wide and `height` inches high, made without pyplot."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH_INCHES, height), dpi=DOTS_PER_INCH, facecolor="white")
    # Labels are measured before they are placed, and only a canvas measures.
    FigureCanvasAgg(figure)
    return figure


def add_axes_between(figure: Figure, notes: str, *, left: float, right: float) -> Axes:
    """Add axes to a figure and return them. `left` and `right` are their sides in shares of the figure's width; above
    them there is room for the titles, and below for the lines of `notes`."""
    height = figure.get_figheight()
    above, below = 1.0, 0.65 + NOTE_LINE_INCHES * len(notes.splitlines())
    axes = figure.add_axes((left, below / height, right - left, 1.0 - (above + below) / height))
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return axes


def write_texts(figure: Figure, title: str, details: str, notes: str) -> None:
    """Write a chart's texts: title and details at the top, and the notes (already in lines, see `wrapped`) at the
    bottom."""
    height = figure.get_figheight()
    # A file's name may hold dollar signs, which are no formula.
    plain: dict[str, Any] = {"parse_math": False}
    figure.text(0.02, 1.0 - 0.17 / height, title, size=13, weight="bold", va="top", **plain)
    figure.text(0.02, 1.0 - 0.44 / height, details, size=9, color=GREY, va="top", **plain)
    figure.text(0.02, 0.10 / height, notes, size=7.5, color=GREY, va="bottom", linespacing=1.35, **plain)


def wrapped(notes: Sequence[str]) -> str:
    """Return the notes as one text, each beginning on a new line, broken into lines of at most NOTE_LINE_CHARACTERS, so
    that they fit into the width of the figure."""
    return "\n".join(line for note in notes for line in textwrap.wrap(note, NOTE_LINE_CHARACTERS))


def percent(share: float) -> str:
    """Return a share, such as 0.05, as a text in percent: with one decimal below 10 %, else with none."""
    return f"{100.0 * share:.1f} %" if share < 0.0995 else f"{100.0 * share:.0f} %"


def reported_name(reported: Mapping[str, Any]) -> str:
    """Return the name, for a chart, of figures that others have published: `reported`'s "name", and the least and the
    greatest of its "speedup" (a pair of numbers)."""
    least, most = reported["speedup"]
    return f"{reported['name']}, {least:g} to {most:g} ×"


def reported_note(reported: Mapping[str, Any]) -> str:
    """Return the note on figures that others have published: `reported` has their "name", "told" (in words, of which
    pictures they are) and "traced" (the mean share of traced pixels)."""
    traced = percent(reported["traced"])
    return (
        f"Yellow: {reported['name']}'s own figures ({reported['told']}): the seconds that its speed-ups would come to "
        f"over this multiview, and {traced} traced on average."
    )


def check_charts() -> None:
    """Raise BadInputError if matplotlib cannot be imported. To be called before a long render whose result is a
    chart."""
    try:
        import matplotlib.figure  # noqa: F401 - whether it can be imported is all that is asked
    except ImportError as error:
        raise BadInputError(f"the charts need matplotlib ({error}); run `pip install matplotlib`") from error


@contextlib.contextmanager
def chart_style() -> Iterator[None]:
    """Apply matplotlib's defaults with our own changes, for the time of a `with` block, whatever the user has
    configured; the user's style is restored afterwards, also after an error. Texts in an SVG remain texts."""
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


def draw_whole(
    draw: Callable[[Mapping[str, Any]], Figure], data: Mapping[str, Any], path: Path, until_whole: Path | None = None
) -> None:
    """Draw a figure by `draw(data)` and write it to path.svg and path.png, each of which appears whole or not at all.
    until_whole is the folder for unfinished files, see `whole_file`. Raises OSError."""
    with chart_style():
        figure = draw(data)
        # Several runs on the same frames may end at once.
        with whole_file(path.with_name(f"{path.name}.svg"), until_whole=until_whole) as beside:
            figure.savefig(beside, format="svg", metadata={"Date": None})
        with whole_file(path.with_name(f"{path.name}.png"), until_whole=until_whole) as beside:
            figure.savefig(beside, format="png", dpi=DOTS_PER_INCH)
