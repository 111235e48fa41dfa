"""The chart of error against time: a point for each case and for multiview, and the front of those that none beats."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..report.chart_canvas import (
    BLACK,
    BLUE,
    DOTS_PER_INCH,
    GREEN,
    GREY,
    ORANGE,
    PALE,
    PURPLE,
    SKY,
    VERMILLION,
    add_axes_between,
    new_figure,
    percent,
    wrapped,
)
from ..report.label_places import nearest, place_labels
from .cases import HEURISTIC, MULTIVIEW
from .notes import source_note, write_titles

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation

KINDS: dict[str, tuple[str, str]] = {
    "setting": (BLUE, "o"),
    "paper": (ORANGE, "s"),
    HEURISTIC: (VERMILLION, "^"),
    "card": (GREEN, "D"),
    "full": (PURPLE, "p"),
    MULTIVIEW: (BLACK, "*"),
}
"""Colour and marker of a point: either alone would tell them apart."""

LOGARITHMIC_FROM_ERROR_RATIO = 3.0
"""Ratio of the greatest to the smallest error from which the axis is logarithmic."""

# What a logarithmic axis may be labelled with.
TICKS = (0.5, 0.6, 0.7, 0.8, 0.9, 1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 15, 20, 30, 50, 100, 200, 500, 1000)
MIN_TICK_DISTANCE_OF_AXIS = 0.045
"""Share of the logarithmic axis that lies between two ticks at least."""

UNLINED_LABEL_PIXELS = 26.0
"""Pixels within which a label needs no line to its point."""


def draw_tradeoff(prices: Mapping[str, Any]) -> Figure:
    """Return the chart of noise ratio against seconds: a point for each case and for multiview, and a line through
    those on the Pareto front. prices is the content of tradeoff.json."""
    figure = new_figure(6.2)
    shown = [row for row in prices["rows"] if row["noise_ratio"] is not None]
    points = [(row["seconds"]["total"], row["noise_ratio"]) for row in shown] + [(prices["peer"]["seconds"], 1.0)]
    notes = _tradeoff_notes(prices)
    axes = add_axes_between(figure, notes, left=0.09, right=0.97)
    write_titles(figure, prices, "error against time", notes)
    _scale(axes, prices, points)
    guides = _draw_guides(axes, prices)
    front = _draw_front(axes, prices, shown)
    labels = _draw_points(axes, prices, shown)
    _legend(axes, front)
    _arrange(axes, points, labels, [guides], sorted(_front_points(prices, shown)))
    return figure


def _tradeoff_notes(prices: Mapping[str, Any]) -> str:
    """Return the notes below the chart: what its words mean, and which cases are not shown."""
    missing = [row["name"] for row in prices["rows"] if row["noise_ratio"] is None]
    missing += [f"{entry['name']} ({entry['reason']})" for entry in prices["left_out"]]
    notes = [
        (
            "Percentages: the share of the target eye's pixels that was traced. Noise ratio: the error against a plain "
            "render of that eye over the error of a second plain render, which differs in its noise alone."
        ),
        f"{source_note(prices)} The time of multiview is that of both its eyes.",
    ]
    if missing:
        notes.append(f"Not shown: {'; '.join(missing)}.")
    return wrapped(notes)


def _scale(axes: Axes, prices: Mapping[str, Any], points: Sequence[tuple[float, float]]) -> None:
    """Set the ranges, labels and grid of the axes. points are (seconds, error) of all marks; the axis of errors is
    logarithmic where they differ much."""
    seconds = [x for x, _ in points]
    first = min(prices["source"]["seconds"], *seconds)
    span = max(max(seconds) - first, 1e-6)
    axes.set_xlim(max(first - 0.1 * span, 0.0), max(seconds) + 0.12 * span)
    axes.set_xlabel("time of the pair, seconds")
    errors = [y for _, y in points]
    low, high = min(errors), max(errors)
    axes.set_ylabel("noise ratio (1 = as good as rendering it again)")
    if low > 0.0 and high / low > LOGARITHMIC_FROM_ERROR_RATIO:
        _logarithmic(axes, low, high)
    else:
        room = max(0.12 * (high - low), 0.04)
        axes.set_ylim(low - 1.6 * room, high + 1.6 * room)
    axes.grid(color=PALE, alpha=0.3, linewidth=0.6)
    axes.set_axisbelow(True)


def _logarithmic(axes: Axes, low: float, high: float) -> None:
    """Make the axis of errors logarithmic, from a little below `low` to a little above `high`, with ticks at round
    numbers."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    room = (high / low) ** 0.12
    low, high = low / room, high * room
    axes.set_yscale("log")
    axes.set_ylim(low, high)
    ticks: list[float] = [1.0]
    for tick in sorted(TICKS, key=lambda tick: abs(np.log(tick))):
        apart = np.abs(np.log(np.array(ticks) / tick)).min() / np.log(high / low)
        if low <= tick <= high and apart >= MIN_TICK_DISTANCE_OF_AXIS:
            ticks.append(tick)
    axes.yaxis.set_major_locator(FixedLocator(sorted(ticks)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_locator(NullLocator())


def _draw_guides(axes: Axes, prices: Mapping[str, Any]) -> Artist:
    """Draw two lines across the axes, at the noise floor (1) and at multiview's seconds. Return the text beside the
    noise floor."""
    axes.axhline(1.0, color=GREY, linewidth=1.0, linestyle=(0, (4, 3)), zorder=1.5)
    axes.axvline(prices["peer"]["seconds"], color=BLACK, linewidth=0.9, linestyle=(0, (1, 2)), zorder=1.5)
    return axes.annotate(
        "noise floor: a second plain render",
        (0.0, 1.0),
        xycoords=("axes fraction", "data"),
        xytext=(4, -3),
        textcoords="offset points",
        va="top",
        size=8,
        color=GREY,
    )


def _front_points(prices: Mapping[str, Any], shown: Sequence[Mapping[str, Any]]) -> list[tuple[float, float]]:
    """Return (seconds, error) of the points on the Pareto front, multiview's last if it is on it."""
    points = [(row["seconds"]["total"], row["noise_ratio"]) for row in shown if row["pareto"]]
    return [*points, (prices["peer"]["seconds"], 1.0)] if prices["peer"]["pareto"] else points


def _draw_front(axes: Axes, prices: Mapping[str, Any], shown: Sequence[Mapping[str, Any]]) -> Artist:
    """Draw the line through the points on the Pareto front and return it. shown are the rows that have a noise
    ratio."""
    front = sorted(_front_points(prices, shown))
    xs, ys = [x for x, _ in front], [y for _, y in front]
    return axes.plot(xs, ys, color=SKY, linewidth=2.2, zorder=2, solid_joinstyle="round")[0]


def _draw_points(axes: Axes, prices: Mapping[str, Any], shown: Sequence[Mapping[str, Any]]) -> list[Annotation]:
    """Draw the points of the shown rows and of multiview, filled where they are on the Pareto front. Return their
    labels, which `_arrange` has still to put in their places."""
    multiview = prices["peer"]
    entries = [(row["name"], row["kind"], row["seconds"]["total"], row["noise_ratio"], row) for row in shown]
    entries.append(("Blender's multiview", MULTIVIEW, multiview["seconds"], 1.0, {**multiview, "traced": None}))
    labels = []
    for name, kind, seconds, error, row in entries:
        colour, marker = KINDS.get(kind, (GREY, "o"))
        face = colour if row["pareto"] else "white"
        size = 13 if marker == "*" else 7.5
        axes.plot([seconds], [error], marker, ms=size, mec=colour, mfc=face, mew=1.5, zorder=3 if marker == "*" else 4)
        text = name if row["traced"] is None else f"{name} · {percent(row['traced'])}"
        labels.append(_label(axes, text, (seconds, error)))
    return labels


def _label(axes: Axes, text: str, point: tuple[float, float]) -> Annotation:
    """Return a new label with this text, placed at its point, (seconds, error), for the time being."""
    return axes.annotate(
        text,
        point,
        xytext=(0, 0),
        textcoords="offset points",
        size=9,
        ha="left",
        va="bottom",
        zorder=5,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5},
    )


def _legend(axes: Axes, front: Artist) -> None:
    """Draw the legend above the axes; front is the line of the Pareto front."""
    from matplotlib.lines import Line2D

    def dot(face: str) -> Line2D:
        return Line2D([], [], marker="o", linestyle="", markersize=7, color=BLUE, markerfacecolor=face, mew=1.5)

    axes.legend(
        [front, dot(BLUE), dot("white")],
        ["Pareto front", "on it: no other is both as fast and as good", "not on it"],
        loc="lower left",
        bbox_to_anchor=(-0.005, 1.0),
        ncols=3,
        frameon=False,
        fontsize=8.5,
        handletextpad=0.5,
        borderaxespad=0.2,
    )


def _arrange(
    axes: Axes,
    points: Sequence[tuple[float, float]],
    labels: Sequence[Annotation],
    texts: Sequence[Artist],
    front: Sequence[tuple[float, float]],
) -> None:
    """Move the labels of points to where they cover neither each other nor a point nor one of `texts`, and the lines as
    little as possible. Labels that end up far from their points get a line to them.

    points are (seconds, error), multiview's the last, and labels are in their order; front are the points on the Pareto
    front.
    """
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()
    pixels = axes.transData.transform(points)
    sizes = np.array([extent(label) for label in labels])[:, 2:]
    marker = 6.0 * DOTS_PER_INCH / 72.0
    solid = np.concatenate([pixels - marker, pixels + marker], axis=1)
    for text in texts:
        left, bottom, width, height = extent(text)
        solid = np.vstack([solid, (left, bottom, left + width, bottom + height)])
    lines = _along([*axes.transData.transform(front)]) if len(front) > 1 else np.zeros((0, 4))
    (peer_x, floor_y), (x0, y0, x1, y1) = pixels[-1], axes.bbox.extents
    lines = np.vstack([lines, _along([(x0, floor_y), (x1, floor_y)]), _along([(peer_x, y0), (peer_x, y1)])])
    corners = place_labels(
        pixels, sizes, obstacles=solid, lines=lines, frame=(x0 + 2, y0 + 2, figure.bbox.width - 8, y1)
    )
    for label, corner, pixel, size in zip(labels, corners, pixels, sizes, strict=True):
        label.set_position(tuple((corner - pixel) * 72.0 / DOTS_PER_INCH))
        offset = nearest(pixel, corner, size) - pixel
        if np.hypot(*offset) > UNLINED_LABEL_PIXELS:
            _draw_leader(axes, label.xy, offset * 72.0 / DOTS_PER_INCH)


def _draw_leader(axes: Axes, point: tuple[float, float], offset: np.ndarray) -> None:
    """Draw a line from a point, given in data coordinates, to its label, which begins `offset` typographic points
    away."""
    style = {"arrowstyle": "-", "color": GREY, "linewidth": 0.7, "shrinkA": 0.0, "shrinkB": 5.0}
    axes.annotate("", point, xytext=tuple(offset), textcoords="offset points", arrowprops=style, zorder=2.5)


def extent(artist: Artist) -> tuple[float, float, float, float]:
    """Return (left, bottom, width, height) of an artist in pixels; for an annotation, those of its text without the
    line to its point."""
    from matplotlib.text import Text

    box = Text.get_window_extent(artist) if isinstance(artist, Text) else artist.get_window_extent()
    return box.x0, box.y0, box.width, box.height


def _along(corners: Sequence[Any]) -> np.ndarray:
    """Return small boxes (L, 4), as (left, bottom, right, top), along the lines from each of these places to the next,
    in pixels. There must be at least two places."""
    boxes = []
    for a, b in itertools.pairwise(np.asarray(corners, np.float64)):
        step = np.subtract(b, a)
        at = a + np.linspace(0.0, 1.0, max(2, int(np.hypot(*step) / 6.0)))[:, None] * step
        boxes.append(np.concatenate([at - 1.5, at + 1.5], axis=1))
    return np.concatenate(boxes)
