"""The two charts of a price list: error against time, and where each run's time goes. The only use of matplotlib.

Drawn on canvases of their own, without pyplot: nothing that a caller does with matplotlib changes them, nor they it.
"""

from __future__ import annotations

import contextlib
import itertools
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import BadInputError
from .label_places import nearest, place_labels
from .tradeoff import HEURISTIC, PEER, stage_order

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation

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

KINDS: dict[str, tuple[str, str]] = {
    "setting": (BLUE, "o"),
    "paper": (ORANGE, "s"),
    HEURISTIC: (VERMILLION, "^"),
    "card": (GREEN, "D"),
    "full": (PURPLE, "p"),
    PEER: (BLACK, "*"),
}
"""Colour and marker of a point: either alone would tell them apart."""

STAGE_COLOURS = {
    "source": PALE,
    "warp": ORANGE,
    "pilot": YELLOW,
    "fill": BLUE,
    "probes": SKY,
    "refine": GREEN,
    "composite": PURPLE,
}
BOTH_EYES = "both eyes"
"""What the peer's bar is called: its time has no stages."""

LOGARITHMIC_FROM = 3.0
"""Ratio of the greatest to the smallest error from which the axis is logarithmic."""

TICKS = (0.5, 0.6, 0.7, 0.8, 0.9, 1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 15, 20, 30, 50, 100, 200, 500, 1000)
NEAR = 26.0
"""Pixels within which a label needs no line to its point."""

TICK_DISTANCE = 0.045
"""Share of the logarithmic axis that lies between two ticks at least."""


def check_charts() -> None:
    """Raises BadInputError where matplotlib is missing, which is better known before an hour of rendering than after.

    It is no part of the Blender extension.
    """
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


def _figure(height: float) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height), dpi=DPI, facecolor="white")
    # Labels are measured before they are placed, and only a canvas measures.
    FigureCanvasAgg(figure)
    return figure


def _place(figure: Figure, notes: str, *, left: float, right: float) -> Axes:
    """Axes from `left` to `right` in shares of the width, with room for the titles above and the notes below."""
    height = figure.get_figheight()
    above, below = 1.0, 0.65 + NOTE_LINE * len(notes.splitlines())
    axes = figure.add_axes((left, below / height, right - left, 1.0 - (above + below) / height))
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return axes


def _titles(figure: Figure, prices: Mapping[str, Any], what: str, notes: str) -> None:
    """The title and what was rendered above the axes, the notes below, each at its distance from the edge."""
    height = figure.get_figheight()
    width, rows = prices["size"]
    frame = f", frame {prices['frame']}" if "frame" in prices else ""
    details = f"{width} × {rows} pixels, {prices['samples']} samples{frame}, Blender {prices['blender']}"
    figure.text(0.02, 1.0 - 0.17 / height, f"{prices['scene']}: {what}", size=13, weight="bold", va="top")
    figure.text(0.02, 1.0 - 0.44 / height, details, size=9, color=GREY, va="top")
    figure.text(0.02, 0.10 / height, notes, size=7.5, color=GREY, va="bottom", linespacing=1.35)


# Error against time


def draw_tradeoff(prices: Mapping[str, Any]) -> Figure:
    """Noise ratio over seconds, a point for each run and one for the peer, and the front of those that none beats."""
    figure = _figure(6.2)
    shown = [row for row in prices["rows"] if row["noise_ratio"] is not None]
    points = [(row["seconds"]["total"], row["noise_ratio"]) for row in shown] + [(prices["peer"]["seconds"], 1.0)]
    notes = _tradeoff_notes(prices)
    axes = _place(figure, notes, left=0.09, right=0.97)
    _titles(figure, prices, "error against time", notes)
    _scale(axes, prices, points)
    guides = _draw_guides(axes, prices)
    front = _draw_front(axes, prices, shown)
    labels = _draw_points(axes, prices, shown)
    _legend(axes, front)
    _arrange(axes, points, labels, [guides], sorted(_front_points(prices, shown)))
    return figure


def _tradeoff_notes(prices: Mapping[str, Any]) -> str:
    missing = [row["name"] for row in prices["rows"] if row["noise_ratio"] is None]
    missing += [f"{entry['name']} ({entry['reason']})" for entry in prices["left_out"]]
    notes = [
        (
            "Percentages: the share of the target eye's pixels that was traced. Noise ratio: the error against a plain "
            "render of that eye over the error of a second plain render, which differs in its noise alone."
        ),
        f"{_source_note(prices)} The time of multiview is that of both its eyes.",
    ]
    if missing:
        notes.append(f"Not shown: {'; '.join(missing)}.")
    return _wrapped(notes)


def _wrapped(notes: Sequence[str]) -> str:
    return "\n".join(line for note in notes for line in textwrap.wrap(note, NOTE_LENGTH))


def _source_note(prices: Mapping[str, Any]) -> str:
    seconds = prices["source"]["seconds"]
    shared = f"The source eye was rendered once; its {seconds:.2f} s, with the sync of the scene, count in every run"
    own = any(row["kind"] == HEURISTIC for row in prices["rows"])
    return f"{shared}{', but the heuristic mask has a source with more passes of its own' if own else ''}."


def _scale(axes: Axes, prices: Mapping[str, Any], points: Sequence[tuple[float, float]]) -> None:
    seconds = [x for x, _ in points]
    first = min(prices["source"]["seconds"], *seconds)
    span = max(max(seconds) - first, 1e-6)
    axes.set_xlim(max(first - 0.1 * span, 0.0), max(seconds) + 0.12 * span)
    axes.set_xlabel("time of the pair, seconds")
    errors = [y for _, y in points]
    low, high = min(errors), max(errors)
    axes.set_ylabel("noise ratio (1 = as good as rendering it again)")
    if low > 0.0 and high / low > LOGARITHMIC_FROM:
        _logarithmic(axes, low, high)
    else:
        room = max(0.12 * (high - low), 0.04)
        axes.set_ylim(low - 1.6 * room, high + 1.6 * room)
    axes.grid(color=PALE, alpha=0.3, linewidth=0.6)
    axes.set_axisbelow(True)


def _logarithmic(axes: Axes, low: float, high: float) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    room = (high / low) ** 0.12
    low, high = low / room, high * room
    axes.set_yscale("log")
    axes.set_ylim(low, high)
    ticks: list[float] = [1.0]
    for tick in sorted(TICKS, key=lambda tick: abs(np.log(tick))):
        apart = np.abs(np.log(np.array(ticks) / tick)).min() / np.log(high / low)
        if low <= tick <= high and apart >= TICK_DISTANCE:
            ticks.append(tick)
    axes.yaxis.set_major_locator(FixedLocator(sorted(ticks)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_locator(NullLocator())


def _draw_guides(axes: Axes, prices: Mapping[str, Any]) -> Artist:
    """The noise floor and the peer's time as lines across the axes; the floor's text."""
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
    points = [(row["seconds"]["total"], row["noise_ratio"]) for row in shown if row["pareto"]]
    return [*points, (prices["peer"]["seconds"], 1.0)] if prices["peer"]["pareto"] else points


def _draw_front(axes: Axes, prices: Mapping[str, Any], shown: Sequence[Mapping[str, Any]]) -> Artist:
    front = sorted(_front_points(prices, shown))
    xs, ys = [x for x, _ in front], [y for _, y in front]
    return axes.plot(xs, ys, color=SKY, linewidth=2.2, zorder=2, solid_joinstyle="round")[0]


def _draw_points(axes: Axes, prices: Mapping[str, Any], shown: Sequence[Mapping[str, Any]]) -> list[Annotation]:
    """The points, and their labels, not yet in their places. Filled: on the front."""
    peer = prices["peer"]
    entries = [(row["name"], row["kind"], row["seconds"]["total"], row["noise_ratio"], row) for row in shown]
    entries.append(("Blender's multiview", PEER, peer["seconds"], 1.0, {**peer, "traced": None}))
    labels = []
    for name, kind, seconds, error, row in entries:
        colour, marker = KINDS.get(kind, (GREY, "o"))
        face = colour if row["pareto"] else "white"
        size = 13 if marker == "*" else 7.5
        axes.plot([seconds], [error], marker, ms=size, mec=colour, mfc=face, mew=1.5, zorder=3 if marker == "*" else 4)
        text = name if row["traced"] is None else f"{name} · {_percent(row['traced'])}"
        labels.append(_label(axes, text, (seconds, error)))
    return labels


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %" if share < 0.0995 else f"{100.0 * share:.0f} %"


def _label(axes: Axes, text: str, point: tuple[float, float]) -> Annotation:
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
    """Put the labels where they cover neither each other nor a point, and as little of the lines as can be."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()
    pixels = axes.transData.transform(points)
    sizes = np.array([_extent(label) for label in labels])[:, 2:]
    marker = 6.0 * DPI / 72.0
    solid = np.concatenate([pixels - marker, pixels + marker], axis=1)
    for text in texts:
        left, bottom, width, height = _extent(text)
        solid = np.vstack([solid, (left, bottom, left + width, bottom + height)])
    lines = _along([*axes.transData.transform(front)]) if len(front) > 1 else np.zeros((0, 4))
    (peer_x, floor_y), (x0, y0, x1, y1) = pixels[-1], axes.bbox.extents
    lines = np.vstack([lines, _along([(x0, floor_y), (x1, floor_y)]), _along([(peer_x, y0), (peer_x, y1)])])
    corners = place_labels(
        pixels, sizes, obstacles=solid, lines=lines, frame=(x0 + 2, y0 + 2, figure.bbox.width - 8, y1)
    )
    for label, corner, pixel, size in zip(labels, corners, pixels, sizes, strict=True):
        label.set_position(tuple((corner - pixel) * 72.0 / DPI))
        offset = nearest(pixel, corner, size) - pixel
        if np.hypot(*offset) > NEAR:
            _draw_leader(axes, label.xy, offset * 72.0 / DPI)


def _draw_leader(axes: Axes, point: tuple[float, float], offset: np.ndarray) -> None:
    """A line from a point to where its label begins, `offset` typographic points away."""
    style = {"arrowstyle": "-", "color": GREY, "linewidth": 0.7, "shrinkA": 0.0, "shrinkB": 5.0}
    axes.annotate("", point, xytext=tuple(offset), textcoords="offset points", arrowprops=style, zorder=2.5)


def _extent(artist: Artist) -> tuple[float, float, float, float]:
    """Left, bottom, width and height in pixels; of an annotation its text alone, without the line to its point."""
    from matplotlib.text import Text

    box = Text.get_window_extent(artist) if isinstance(artist, Text) else artist.get_window_extent()
    return tuple(box.bounds)


def _along(corners: Sequence[Any]) -> np.ndarray:
    """Small boxes (L, 4) along the lines between these places in pixels."""
    boxes = []
    for a, b in itertools.pairwise(np.asarray(corners)):
        steps = np.linspace(0.0, 1.0, max(2, int(np.hypot(*(b - a)) / 6.0)))[:, None]
        at = a + steps * (b - a)
        boxes.append(np.concatenate([at - 1.5, at + 1.5], axis=1))
    return np.concatenate(boxes)


# Where the time goes


def draw_stages(prices: Mapping[str, Any]) -> Figure:
    """A bar for each run and one for the peer, made of their stages, as in the paper's figure 9."""
    rows, peer = prices["rows"], prices["peer"]
    figure = _figure(1.95 + 0.36 * (len(rows) + 1))
    notes = _stage_notes(rows, _source_note(prices))
    axes = _place(figure, notes, left=0.16, right=0.81)
    _titles(figure, prices, "where the time goes", notes)
    used = [name for name in stage_order(name for row in rows for name in row["seconds"]) if name != "total"]
    for name in used:
        colour = STAGE_COLOURS.get(name, GREY)
        seconds = [row["seconds"].get(name, 0.0) for row in rows]
        starts = [_before(row, name, used) for row in rows]
        axes.barh(range(len(rows)), seconds, left=starts, height=0.68, color=colour, label=name)
    axes.barh([len(rows)], [peer["seconds"]], height=0.68, color=GREY, label=BOTH_EYES)
    axes.axvline(peer["seconds"], color=BLACK, linewidth=0.9, linestyle=(0, (1, 2)), zorder=0.5)
    _name_bars(axes, rows, peer)
    _write_seconds(axes, rows, used)
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


def _stage_notes(rows: Sequence[Mapping[str, Any]], source: str) -> str:
    columns = "Speed-up: over Blender's multiview. Traced: the share of the target eye's pixels."
    probed = any("probes" in row["seconds"] for row in rows)
    split = " Holes and probes are traced in one render, whose time is divided by their pixels." if probed else ""
    return _wrapped([columns, source + split])


def _before(row: Mapping[str, Any], stage: str, used: Sequence[str]) -> float:
    return sum(row["seconds"].get(name, 0.0) for name in used[: used.index(stage)])


def _name_bars(axes: Axes, rows: Sequence[Mapping[str, Any]], peer: Mapping[str, Any]) -> None:
    axes.set_yticks(range(len(rows) + 1), [*(row["name"] for row in rows), "Blender's multiview"], color=BLACK)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(rows) + 0.55, -0.55)
    totals = [row["seconds"]["total"] for row in rows] + [peer["seconds"]]
    axes.set_xlim(0.0, max(totals) * 1.13)
    axes.set_xlabel("seconds")
    axes.xaxis.grid(color=PALE, alpha=0.3, linewidth=0.6)
    axes.set_axisbelow(True)
    for k, total in enumerate(totals):
        text = axes.annotate(f"{total:.2f} s", (total, k), xytext=(4, 0), textcoords="offset points", va="center")
        text.set_bbox({"facecolor": "white", "edgecolor": "none", "boxstyle": "square,pad=0.1"})
    _column(axes, 1.1, "speed-up", [*(f"{row['speedup']:.2f} ×" for row in rows), "1.00 ×"])
    _column(axes, 1.24, "traced", [*(_percent(row["traced"]) for row in rows), ""])


def _column(axes: Axes, x: float, heading: str, entries: Sequence[str]) -> None:
    """Figures beside the bars, right-aligned at x, a share of the axes' width."""
    place = axes.get_yaxis_transform()
    for k, entry in enumerate(entries):
        axes.text(x, k, entry, transform=place, ha="right", va="center")
    axes.annotate(
        heading, (x, 1.0), xytext=(0, 5), xycoords="axes fraction", textcoords="offset points", ha="right", color=GREY
    )


def _write_seconds(axes: Axes, rows: Sequence[Mapping[str, Any]], used: Sequence[str]) -> None:
    """The seconds of each stage inside its part of the bar, where they fit."""
    fits = 0.05 * axes.get_xlim()[1]
    for k, row in enumerate(rows):
        for name in used:
            seconds = row["seconds"].get(name, 0.0)
            if seconds < fits:
                continue
            dark = STAGE_COLOURS.get(name, GREY) in (BLUE, GREEN, GREY)
            middle = _before(row, name, used) + 0.5 * seconds
            axes.text(middle, k, f"{seconds:.2f}", ha="center", va="center", size=7.5, color="white" if dark else BLACK)
