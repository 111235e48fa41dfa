"""How tables write what they hold: each figure with its unit, and a dash for what is not known."""

from __future__ import annotations

from collections.abc import Sequence

NONE = "–"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "\n".join(map(line, [head, ["---"] * len(head), *rows]))


def line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def cell(text: str) -> str:
    """A text that does not end the cell that it is in."""
    return " ".join(text.split()).replace("|", "\\|")


def size_text(size: Sequence[int]) -> str:
    return "x".join(map(str, size))


def seconds(value: float | None) -> str:
    return NONE if value is None else f"{value:.3f} s" if value < 1.0 else f"{value:.2f} s"


def milliseconds(value: float) -> str:
    """Of seconds."""
    return f"{1000.0 * value:.{2 if value < 0.1 else 0}f} ms"


def times(value: float | None) -> str:
    return NONE if value is None else f"{value:.2f} ×"


def times_between(ends: Sequence[float] | None) -> str:
    return NONE if ends is None else f"{min(ends):.2f} to {max(ends):.2f} ×"


def share(value: float | None) -> str:
    return NONE if value is None else f"{value:.1%}"


def megabytes(value: float | None) -> str:
    return NONE if value is None else f"{value:.0f} MB"
