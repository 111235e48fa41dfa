"""The titles and the notes of a price list's charts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ..report.chart_canvas import write_texts
from .cases import HEURISTIC

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_titles(figure: Figure, prices: Mapping[str, Any], what: str, notes: str) -> None:
    """Write the texts of a price list's chart: the title, which is the scene's name and `what` is shown, the details of
    the picture, and the notes."""
    width, rows = prices["size"]
    frame = f", frame {prices['frame']}" if "frame" in prices else ""
    details = f"{width} × {rows} pixels, {prices['samples']} samples{frame}, Blender {prices['blender']}"
    write_texts(figure, f"{prices['scene']}: {what}", details, notes)


def source_note(prices: Mapping[str, Any]) -> str:
    """Return the note that says how the source's seconds are counted: the "note" of prices if it has one, else the
    sentence for a price list."""
    if "note" in prices:
        return str(prices["note"])
    seconds = prices["source"]["seconds"]
    shared = f"The source eye was rendered once; its {seconds:.2f} s, with the sync of the scene, count in every run"
    own = any(row["kind"] == HEURISTIC for row in prices["rows"])
    return f"{shared}{', but the heuristic mask has a source with more passes of its own' if own else ''}."
