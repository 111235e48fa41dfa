"""The chart of where the time goes: a bar for each case, made of its stages, as in the paper's figure 9."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..pipeline.stages import Stage, in_order
from ..report.chart_canvas import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PALE,
    PURPLE,
    SKY,
    YELLOW,
    add_axes_between,
    new_figure,
    percent,
    reported_name,
    reported_note,
    wrapped,
)
from .notes import source_note, write_titles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STAGE_COLOURS: Mapping[str, str] = {
    Stage.PLAN: BLACK,
    Stage.SOURCE: PALE,
    Stage.WARP: ORANGE,
    Stage.PILOT: YELLOW,
    Stage.FILL: BLUE,
    Stage.PROBES: SKY,
    Stage.REFINE: GREEN,
    Stage.COMPOSITE: PURPLE,
}
MULTIVIEW_LABEL = "both eyes"
"""Name of multiview's bar: its time has no stages."""


def draw_stages(prices: Mapping[str, Any]) -> Figure:
    """Return the chart of where the time goes: a bar for each case, made of its stages, and one for multiview, as in
    the paper's figure 9.

    prices has the form of tradeoff.json. It may also have "reported", figures that others have published, which are
    drawn beside: see `reported_note`.
    """
    rows, multiview, reported = prices["rows"], prices["peer"], prices.get("reported")
    notes = _stage_notes(rows, source_note(prices), reported)
    figure = new_figure(1.95 + 0.36 * (len(rows) + (2 if reported else 1)))
    axes = add_axes_between(figure, notes, left=0.16, right=0.81)
    write_titles(figure, prices, "where the time goes", notes)
    used = [name for name in in_order(name for row in rows for name in row["seconds"]) if name != "total"]
    for name in used:
        colour = STAGE_COLOURS.get(name, GREY)
        seconds = [row["seconds"].get(name, 0.0) for row in rows]
        starts = [_before(row, name, used) for row in rows]
        axes.barh(range(len(rows)), seconds, left=starts, height=0.68, color=colour, label=name)
    axes.barh([len(rows)], [multiview["seconds"]], height=0.68, color=GREY, label=MULTIVIEW_LABEL)
    axes.axvline(multiview["seconds"], color=BLACK, linewidth=0.9, linestyle=(0, (1, 2)), zorder=0.5)
    _name_bars(axes, rows, multiview)
    _write_seconds(axes, rows, used)
    if reported:
        _draw_reported(axes, reported, multiview["seconds"], below=len(rows) + 1)
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(-0.005, 1.0),
        ncols=len(used) + 1,
        frameon=False,
        fontsize=8.5,
        handlelength=1.1,
        handletextpad=0.4,
        columnspacing=1.3,
        borderaxespad=0.2,
    )
    return figure


def _draw_reported(axes: Axes, reported: Mapping[str, Any], multiview_seconds: float, *, below: int) -> None:
    """Mark the range of seconds that would follow from others' published speed-ups over this multiview. Their name
    stands below the bars, in row `below`."""
    ends = sorted(multiview_seconds / speedup for speedup in reported["speedup"])
    axes.axvspan(*ends, color=YELLOW, alpha=0.45, linewidth=0.0, zorder=0.4)
    axes.set_ylim(below + 0.55, -0.55)
    axes.text(0.5 * sum(ends), below, reported_name(reported), ha="center", va="center", size=8)


def _stage_notes(rows: Sequence[Mapping[str, Any]], source: str, reported: Mapping[str, Any] | None) -> str:
    """Return the notes below the chart. source is the note on the source's seconds, reported are others' figures or
    None."""
    columns = "Speed-up: over Blender's multiview. Traced: the share of the target eye's pixels."
    probed = any(Stage.PROBES in row["seconds"] for row in rows)
    split = " Holes and probes are traced in one render, whose time is divided by their pixels." if probed else ""
    return wrapped([columns, source + split, *([reported_note(reported)] if reported else [])])


def _before(row: Mapping[str, Any], stage: str, used: Sequence[str]) -> float:
    """Return the seconds of a row in all stages before `stage`, where its part of the bar begins; `used` are the stages
    in order."""
    return sum(row["seconds"].get(name, 0.0) for name in used[: used.index(stage)])


def _name_bars(axes: Axes, rows: Sequence[Mapping[str, Any]], multiview: Mapping[str, Any]) -> None:
    """Write the names left of the bars, the total seconds at their ends, and the columns of speed-up and traced share
    right of them. Also sets the ranges of the axes."""
    axes.set_yticks(range(len(rows) + 1), [*(row["name"] for row in rows), "Blender's multiview"], color=BLACK)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(rows) + 0.55, -0.55)
    totals = [row["seconds"]["total"] for row in rows] + [multiview["seconds"]]
    axes.set_xlim(0.0, max(totals) * 1.13)
    axes.set_xlabel("seconds")
    axes.xaxis.grid(color=PALE, alpha=0.3, linewidth=0.6)
    axes.set_axisbelow(True)
    for k, total in enumerate(totals):
        text = axes.annotate(f"{total:.2f} s", (total, k), xytext=(4, 0), textcoords="offset points", va="center")
        text.set_bbox({"facecolor": "white", "edgecolor": "none", "boxstyle": "square,pad=0.1"})
    _column(axes, 1.1, "speed-up", [*(f"{row['speedup']:.2f} ×" for row in rows), "1.00 ×"])
    _column(axes, 1.24, "traced", [*(percent(row["traced"]) for row in rows), ""])


def _column(axes: Axes, x: float, heading: str, entries: Sequence[str]) -> None:
    """Write a column of texts with a heading, one for each bar, right-aligned at x (a share of the axes' width)."""
    place = axes.get_yaxis_transform()
    for k, entry in enumerate(entries):
        axes.text(x, k, entry, transform=place, ha="right", va="center")
    axes.annotate(
        heading, (x, 1.0), xytext=(0, 5), xycoords="axes fraction", textcoords="offset points", ha="right", color=GREY
    )


def _write_seconds(axes: Axes, rows: Sequence[Mapping[str, Any]], used: Sequence[str]) -> None:
    """Write the seconds of each stage inside its part of the bar, where the part is wide enough."""
    fits = 0.05 * axes.get_xlim()[1]
    for k, row in enumerate(rows):
        for name in used:
            seconds = row["seconds"].get(name, 0.0)
            if seconds < fits:
                continue
            dark = STAGE_COLOURS.get(name, GREY) in (BLACK, BLUE, GREEN, GREY)
            middle = _before(row, name, used) + 0.5 * seconds
            axes.text(middle, k, f"{seconds:.2f}", ha="center", va="center", size=7.5, color="white" if dark else BLACK)
