"""The chart of an animation: seconds over its frames, as in the paper's figure 8, and what was traced of each."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..report.chart_canvas import (
    BLACK,
    BLUE,
    GREY,
    NOTE_LINE_CHARACTERS,
    NOTE_LINE_INCHES,
    ORANGE,
    PALE,
    PURPLE,
    SKY,
    VERMILLION,
    WIDTH_INCHES,
    YELLOW,
    draw_whole,
    new_figure,
    percent,
    reported_note,
    wrapped,
    write_texts,
)
from ..report.label_places import spread
from ..settings.animation import spelled
from .report import plain_renders, views_in
from .series import REST, Series, mean_of, number_in, series_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {"source": PALE, "tracing": BLUE, "denoising": SKY, REST: PURPLE}
OURS = "Stereo Reproject"

MAX_MARKERS = 60
"""Points of the multiview reference up to which each has a marker; more would hide their line."""
MAX_VECTOR_FRAMES = 1000
"""Frames up to which the areas are made of lines in an SVG, else of pixels."""
MAX_NAMED_FRAMES = 12
"""Frames up to which each is named on the axis."""
MIN_AXIS_FRAMES = 5
"""Frames that the axis has room for at least, that a single one does not fill it."""

HEIGHT, ABOVE, BETWEEN, TRACED_HEIGHT, BELOW = 5.4, 0.78, 0.18, 1.05, 0.62
"""Inches: of the figure, and of it for the titles, between the axes, of the lower ones, and below them."""
LEFT, RIGHT = 0.098, 0.745
"""The axes' sides in shares of the width; the names are right of them."""
NAME_DISTANCE = 0.185
"""Inches from one name to the next."""


def draw_animation_chart(report: Mapping[str, Any], path: Path, *, until_whole: Path | None = None) -> None:
    """Draw the chart of an animation into path.svg and path.png. report is the content of animation.json; until_whole
    is the folder for unfinished files, see `files.whole_file`. Raises OSError."""
    draw_whole(draw_animation, report, path, until_whole)


def draw_animation(report: Mapping[str, Any]) -> Figure:
    """Return the chart of an animation: the seconds of each frame by stage, with those of Blender's multiview, and
    below them the share of traced pixels.

    report is the content of animation.json, with at least one frame. It may also have "reported", figures that others
    have published, which are drawn beside: see `reported_note`. Frames without figures are gaps.
    """
    series = series_of(report)
    notes = _notes(report, series)
    figure = new_figure(HEIGHT + NOTE_LINE_INCHES * len(notes.splitlines()))
    write_texts(figure, _title(report), _details(report, series), notes)
    upper, lower = _add_axes(figure, notes)
    _draw_stages(upper, series)
    _draw_reference(upper, series)
    _draw_traced(lower, series)
    _scale(upper, lower, series)
    _name_lines(upper, series)
    if report.get("reported"):
        _draw_reported(upper, lower, series, report["reported"])
    return figure


# Texts


def _title(report: Mapping[str, Any]) -> str:
    """Return the title of the chart: the number of frames and, if it is known, the speed-up over multiview."""
    whole = report.get("totals") or {}
    title = _counted(len(report["frames"]))
    speedup = number_in(whole, "speedup")
    if math.isnan(speedup):
        return title
    measured = whole.get("speedup_from") == "measured"
    how = f"measured on {_counted(whole['compared'])}" if measured else "predicted"
    return f"{title}, {speedup:.2f} × as fast as {_over(report)} ({how})"


def _over(report: Mapping[str, Any]) -> str:
    """Return in words what the animation of this report is held against."""
    mono = views_in(report["frames"]) == 1
    return plain_renders(1 if mono else None)


def _counted(frames: int) -> str:
    """Return a number of frames in words: "1 frame", "2 frames"."""
    return f"{frames} frame{'' if frames == 1 else 's'}"


def _details(report: Mapping[str, Any], series: Series) -> str:
    """Return the line below the title: size, samples and accuracy where all frames have the same, and the mean share of
    traced pixels."""
    rows = report["frames"]
    size, samples = _common(rows, "size"), _common(rows, "samples")
    parts = [
        f"{size[0]} × {size[1]} pixels" if size else None,
        f"{samples} samples" if samples else None,
        _common(rows, "accuracy"),
    ]
    traced = mean_of(series.traced)
    if traced is not None:
        of, how, _ = _traced_of(rows)
        parts.append(f"{percent(traced)} of {of} {how} on average")
    return ", ".join(part for part in parts if part)


def _traced_of(rows: Sequence[Mapping[str, Any]]) -> tuple[str, str, str]:
    """Return in words of whose pixels the traced ones are a share, what was done with these, and by what multiview's
    seconds are predicted."""
    views = views_in(rows)
    if views is None:
        return "the target eye", "traced", "what the source eye has cost"
    if views == 1:
        return "all frames", "rendered or traced", "what key frames have cost"
    return f"all {views} views", "rendered or traced", "what views rendered whole have cost"


def _common(rows: Sequence[Mapping[str, Any]], key: str) -> Any:
    """Return the value that all frames have for `key`; None where they differ or have none."""
    first = rows[0].get(key)
    return first if all(row.get(key) == first for row in rows) else None


def _notes(report: Mapping[str, Any], series: Series) -> str:
    """Return the notes below the chart: what its words mean, and which frames are missing or have failed."""
    compared = int(np.isfinite(series.measured).sum())
    of, how, cost = _traced_of(report["frames"])
    reference = f"measured on {compared} of {_counted(len(report['frames']))}" if compared else f"predicted from {cost}"
    share = f"the share of the pixels of {of} that was {how}"
    facts = (
        f"Beside the names: the mean over the frames. The seconds of {_over(report)} are {reference}. Traced: "
        f"{share}. Tracing: pilot, fill and refinement. The rest: the warp, the composite, and "
        "all else that is done before the next frame begins."
    )
    notes = [facts]
    failed = {int(frame) for frame in report.get("failed") or ()}
    missing = {*series.frames[~series.there].tolist()} - failed
    for what, frames in (("Not rendered", missing), ("Failed", failed)):
        if frames:
            line = f"{what}: frame{'s' if len(frames) > 1 else ''} {spelled(frames)}"
            notes.append(textwrap.shorten(line, NOTE_LINE_CHARACTERS, placeholder=" ..."))
    if report.get("reported"):
        notes.append(reported_note(report["reported"]))
    return wrapped(notes)


def _seconds_text(seconds: float) -> str:
    """Return seconds as a text with about three digits, such as "1.25 s"."""
    decimals = 0 if seconds >= 99.95 else 1 if seconds >= 9.995 else 2
    return f"{seconds:.{decimals}f} s"


# Drawing


def _add_axes(figure: Figure, notes: str) -> tuple[Axes, Axes]:
    """Add two axes over the same frames to the figure, and return them: the upper ones for seconds, the lower ones for
    the traced share. `notes` are the lines of text that need room below."""
    height = figure.get_figheight()
    below = BELOW + NOTE_LINE_INCHES * len(notes.splitlines())
    start = below + TRACED_HEIGHT + BETWEEN
    lower = figure.add_axes((LEFT, below / height, RIGHT - LEFT, TRACED_HEIGHT / height))
    upper = figure.add_axes((LEFT, start / height, RIGHT - LEFT, (height - ABOVE - start) / height), sharex=lower)
    upper.tick_params(axis="x", labelbottom=False)
    for axes in (upper, lower):
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
        axes.yaxis.set_label_coords(-0.098, 0.5)
        axes.yaxis.grid(color=PALE, alpha=0.3, linewidth=0.6)
        axes.set_axisbelow(True)
    return upper, lower


def _edges(series: Series) -> NDArray[np.float64]:
    """Return the places (N + 1,) on the axis where the frames begin and end. Each frame is one step wide, so that a
    frame between two gaps can be seen too."""
    half = 0.5 * series.step
    return np.append(series.frames - half, series.frames[-1] + half).astype(np.float64)


def _used(series: Series) -> list[str]:
    """Return the kinds of stages that took any time in any frame."""
    return [name for name, seconds in series.stages.items() if np.nansum(seconds) > 0.0]


def _draw_stages(axes: Axes, series: Series) -> None:
    """Draw the seconds of each kind of stage as areas on top of one another, and the seconds of the whole frame as a
    line."""
    edges, below = _edges(series), np.zeros(len(series.frames))
    for name in _used(series):
        above = below + series.stages[name]
        _fill(axes, above, edges, below, color=COLOURS[name], label=name)
        below = np.nan_to_num(above)
    axes.stairs(series.seconds, edges, baseline=None, color=VERMILLION, linewidth=_width(series), label=OURS)


def _fill(axes: Axes, above: NDArray, edges: NDArray, below: NDArray | float, **look: Any) -> None:
    """Fill the area between `below` and `above`, the heights (N,) of N frames; edges (N + 1,) are the frames' sides.
    look are options of matplotlib."""
    # An SVG with every corner of thousands of frames would be of some megabytes.
    many = len(above) > MAX_VECTOR_FRAMES
    axes.stairs(above, edges, baseline=below, fill=True, linewidth=0.0, rasterized=many, **look)


def _width(series: Series) -> float:
    """Return the width of a line in points, for matplotlib: thinner where there are many frames."""
    return 1.6 if len(series.frames) <= 200 else 0.8


def _reference(series: Series) -> tuple[str, NDArray]:
    """Return "measured" or "predicted", and the seconds (N,) of Blender's multiview known in that way: measured ones if
    any frame was compared."""
    measured = np.isfinite(series.measured).any()
    return ("measured", series.measured) if measured else ("predicted", series.predicted)


def _draw_reference(axes: Axes, series: Series) -> None:
    """Draw the seconds of multiview as a line: over every frame if they are predicted, else through the frames that
    were compared."""
    how, seconds = _reference(series)
    if how == "predicted":
        axes.stairs(seconds, _edges(series), baseline=None, label=series.reference, **_look_of_reference(how, seconds))
        return
    # The line goes on over frames that were not compared, but not over those that are not there.
    shown = np.isfinite(seconds) | ~series.there
    frames, seconds = series.frames[shown], seconds[shown]
    look = {**_look_of_reference(how, seconds), "marker": "o"}
    axes.plot(frames, seconds, markevery=_marked(seconds), label=series.reference, **look)


def _marked(seconds: NDArray) -> list[int]:
    """Return the indices of the points of multiview's line that get a marker: all points with known seconds or, if
    these are more than MAX_MARKERS, only those without a known neighbour. seconds (N,) are NaN where they are not
    known."""
    known = np.isfinite(seconds)
    if known.sum() > MAX_MARKERS:
        beside = np.pad(known, 1)
        known = known & ~beside[:-2] & ~beside[2:]
    return np.flatnonzero(known).tolist()


def _draw_traced(axes: Axes, series: Series) -> None:
    """Draw the share of traced pixels, in percent, as an area with a line on top."""
    shares, edges = 100.0 * series.traced, _edges(series)
    _fill(axes, shares, edges, 0.0, color=BLUE, alpha=0.25)
    axes.stairs(shares, edges, baseline=None, color=BLUE, linewidth=_width(series), label="traced")
    axes.set_ylabel("traced, %")
    axes.set_xlabel("frame")


def _draw_reported(upper: Axes, lower: Axes, series: Series, reported: Mapping[str, Any]) -> None:
    """Draw others' published figures: the range of seconds that would follow from their speed-ups over multiview into
    the upper axes, their traced share into the lower ones."""
    seconds = _reference(series)[1]
    known = np.isfinite(seconds)
    ends = [seconds[known] / speedup for speedup in reported["speedup"]]
    upper.fill_between(series.frames[known], *ends, color=YELLOW, alpha=0.35, linewidth=0.0, label=reported["name"])
    for end in ends:
        upper.plot(series.frames[known], end, color=ORANGE, linewidth=0.9, linestyle=(0, (5, 2)))
    share = 100.0 * reported["traced"]
    lower.axhline(share, color=ORANGE, linewidth=1.1, linestyle=(0, (5, 2)), label=reported["name"])
    lower.set_ylim(0.0, max(lower.get_ylim()[1], 1.15 * share))
    place: dict[str, Any] = {"transform": lower.get_yaxis_transform(), "va": "center", "size": 9}
    lower.text(1.015, share, f"{reported['name']}, {percent(reported['traced'])}", **place)


def _scale(upper: Axes, lower: Axes, series: Series) -> None:
    """Set the ranges, labels and ticks of both axes."""
    from matplotlib.ticker import MaxNLocator

    upper.set_ylabel("seconds per frame")
    stacked = np.sum([np.nan_to_num(seconds) for seconds in series.stages.values()], axis=0)
    known = np.concatenate([stacked, series.seconds, _reference(series)[1]])
    upper.set_ylim(0.0, 1.08 * np.nanmax(known) or 1.0)
    traced = 100.0 * series.traced[np.isfinite(series.traced)]
    lower.set_ylim(0.0, 1.15 * traced.max(initial=0.0) or 1.0)
    lower.yaxis.set_major_locator(MaxNLocator(3))
    edges = _edges(series)
    aside = 0.5 * series.step * max(MIN_AXIS_FRAMES - len(series.frames), 0)
    lower.set_xlim(edges[0] - aside, edges[-1] + aside)
    if len(series.frames) <= MAX_NAMED_FRAMES:
        lower.set_xticks(series.frames)
    else:
        lower.xaxis.set_major_locator(MaxNLocator(12, integer=True, steps=[1, 2, 5, 10]))


# Names beside the lines


def _name_lines(axes: Axes, series: Series) -> None:
    """Write the names of the lines and areas right of the axes, each about as high as its right end, with the mean of
    its seconds."""
    entries = _named(series)
    top, height = axes.get_ylim()[1], axes.bbox.height / axes.figure.dpi
    ends = [end / top * height for _, _, _, end in entries]
    for (name, mean, style, _), place in zip(entries, spread(ends, NAME_DISTANCE, height), strict=True):
        _draw_name(axes, name, mean, style, place / height)


def _named(series: Series) -> list[tuple[str, float, dict[str, Any], float]]:
    """Return for each line and area its name, the mean of its seconds, the look of its sample, and the seconds at its
    right end. Those without any known seconds are left out."""
    entries, below = [], np.zeros(len(series.frames))
    for name in _used(series):
        above = below + series.stages[name]
        look = {"marker": "s", "markersize": 7.5, "color": COLOURS[name], "linestyle": ""}
        entries.append((name, series.stages[name], look, 0.5 * (below + above)))
        below = above
    entries.append((OURS, series.seconds, {"color": VERMILLION, "linewidth": 1.8}, series.seconds))
    how, seconds = _reference(series)
    entries.append((f"{series.reference}, {how}", seconds, _look_of_reference(how, seconds), seconds))
    return [
        (name, mean, look, float(places[np.isfinite(places)][-1]))
        for name, values, look, places in entries
        if (mean := mean_of(values)) is not None
    ]


def _look_of_reference(how: str, seconds: NDArray) -> dict[str, Any]:
    """Return the look of multiview's line as options of matplotlib; how is "measured" or "predicted", and seconds (N,)
    decide if it has markers."""
    if how == "predicted":
        return {"color": BLACK, "linewidth": 0.9, "linestyle": (0, (4, 3))}
    marker = "o" if np.isfinite(seconds).sum() <= MAX_MARKERS else None
    return {"color": BLACK, "linewidth": 1.1, "marker": marker, "markersize": 4.5}


def _draw_name(axes: Axes, name: str, mean: float, look: Mapping[str, Any], height: float) -> None:
    """Write one name right of the axes with a sample of its line or area before it, and its mean seconds behind it.
    height is a share of the axes' height."""
    from matplotlib.lines import Line2D

    # In shares of the axes' width; the sample is the figure's, since the lines of the axes are data.
    inch = 1.0 / (WIDTH_INCHES * (RIGHT - LEFT))
    start, end = 1.0 + 0.1 * inch, 1.0 + 0.36 * inch
    xs = [0.5 * (start + end)] if look.get("linestyle") == "" else [start, 0.5 * (start + end), end]
    sample = Line2D(xs, [height] * len(xs), transform=axes.transAxes, markevery=[len(xs) // 2], **look)
    axes.figure.add_artist(sample)
    bold = "bold" if name == OURS else "normal"
    place: dict[str, Any] = {"transform": axes.transAxes, "va": "center", "size": 9}
    axes.text(1.0 + 0.44 * inch, height, name, weight=bold, **place)
    axes.text(1.0 + 2.2 * inch, height, _seconds_text(mean), color=GREY, ha="right", **place)
