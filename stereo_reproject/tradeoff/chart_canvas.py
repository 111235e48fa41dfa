"""What the charts share: their canvas, colours, titles and notes."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .cases import HEURISTIC

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 9.0
"""Inches."""
NOTE_LINE = 0.15
"""Inches from one line of the notes to the next."""
NOTE_LENGTH = 145
"""Characters in a line of the notes."""
DPI = 160

# The palette of M. Okabe and K. Ito, "Color universal design", 2008, which the colour-blind tell apart too.
BLUE, SKY, GREEN, ORANGE, VERMILLION = "#0072b2", "#56b4e9", "#009e73", "#e69f00", "#d55e00"
PURPLE, YELLOW, BLACK = "#cc79a7", "#f0e442", "#1a1a1a"
GREY, PALE = "#5c6670", "#aab2ba"


def new_figure(height: float) -> Figure:
    """A white figure of `height` inches, without pyplot."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height), dpi=DPI, facecolor="white")
    # Labels are measured before they are placed, and only a canvas measures.
    FigureCanvasAgg(figure)
    return figure


def add_axes_between(figure: Figure, notes: str, *, left: float, right: float) -> Axes:
    """Axes from `left` to `right` in shares of the width, with room for the titles above and the notes below."""
    height = figure.get_figheight()
    above, below = 1.0, 0.65 + NOTE_LINE * len(notes.splitlines())
    axes = figure.add_axes((left, below / height, right - left, 1.0 - (above + below) / height))
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return axes


def write_titles(figure: Figure, prices: Mapping[str, Any], what: str, notes: str) -> None:
    """What a chart of a price list is of, what was rendered, and the notes."""
    width, rows = prices["size"]
    frame = f", frame {prices['frame']}" if "frame" in prices else ""
    details = f"{width} × {rows} pixels, {prices['samples']} samples{frame}, Blender {prices['blender']}"
    write_texts(figure, f"{prices['scene']}: {what}", details, notes)


def write_texts(figure: Figure, title: str, details: str, notes: str) -> None:
    """The title and the details above the axes, the notes below, each at its distance from the edge."""
    height = figure.get_figheight()
    # A file's name may hold dollar signs, which are no formula.
    plain: dict[str, Any] = {"parse_math": False}
    figure.text(0.02, 1.0 - 0.17 / height, title, size=13, weight="bold", va="top", **plain)
    figure.text(0.02, 1.0 - 0.44 / height, details, size=9, color=GREY, va="top", **plain)
    figure.text(0.02, 0.10 / height, notes, size=7.5, color=GREY, va="bottom", linespacing=1.35, **plain)


def wrapped(notes: Sequence[str]) -> str:
    """The notes one below the other, in lines that fit."""
    return "\n".join(line for note in notes for line in textwrap.wrap(note, NOTE_LENGTH))


def source_note(prices: Mapping[str, Any]) -> str:
    """What is counted of the source: what the prices say of it themselves, or how a price list has it."""
    if "note" in prices:
        return str(prices["note"])
    seconds = prices["source"]["seconds"]
    shared = f"The source eye was rendered once; its {seconds:.2f} s, with the sync of the scene, count in every run"
    own = any(row["kind"] == HEURISTIC for row in prices["rows"])
    return f"{shared}{', but the heuristic mask has a source with more passes of its own' if own else ''}."


def percent(share: float) -> str:
    """A share with two digits that matter."""
    return f"{100.0 * share:.1f} %" if share < 0.0995 else f"{100.0 * share:.0f} %"


def reported_name(reported: Mapping[str, Any]) -> str:
    """What the marks of others' own figures are called: "name" with the ends of their "speedup"."""
    least, most = reported["speedup"]
    return f"{reported['name']}, {least:g} to {most:g} ×"


def reported_note(reported: Mapping[str, Any]) -> str:
    """What those marks are: "told" says of what they are, and "traced" is a share on average."""
    traced = percent(reported["traced"])
    return (
        f"Yellow: {reported['name']}'s own figures ({reported['told']}): the seconds that its speed-ups would come to "
        f"over this multiview, and {traced} traced on average."
    )
