"""Time of a stereo pair against Blender's own multiview, scene by scene, with the denoiser and without.

    python -m tests.bench.scene_times --scenes DIR [--size 960x540] [--samples 48] [--turns 1] [--output DIR]
        [SCENE ...]
    python -m tests.bench.scene_times --from scene_times.json [--output DIR]

DIR holds a folder with a .blend of the same name for each scene; all of them are measured where none is named. Each
measurement is one `python -m stereo_reproject render … --compare` in a process of its own: it makes the pair and then
has Blender's multiview render the same scene, and its report.json has the seconds of both. Multiview comes second, so
what the process has read and prepared by then speeds up multiview and never the pair.

The output folder gets scene_times.json (everything that was measured), scene_times.png and scene_times.svg; the table
for a page in Markdown goes to standard output. An interrupted program goes on with what is missing when it is called
again. With --from, nothing is rendered: the chart and the table are made from the file. Exit status: 0 all done, 1 a
run failed, 2 bad input, 130 interrupted, 143 terminated.
"""

from __future__ import annotations

import argparse
import json
import shlex
import signal
import statistics
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stereo_reproject.errors import StereoReprojectError
from stereo_reproject.files import write_json
from stereo_reproject.programs.converters import size, value_of, whole_number
from stereo_reproject.report.chart_canvas import (
    BLACK,
    BLUE,
    GREY,
    PALE,
    SKY,
    add_axes_between,
    check_charts,
    draw_whole,
    new_figure,
    percent,
    wrapped,
    write_texts,
)
from stereo_reproject.settings.frame import ACCURACIES, SceneOverrides
from tests.bench.performance.__main__ import PACKAGES, be_interruptible
from tests.bench.performance.cells import NONE, cell, seconds, table, times
from tests.bench.performance.keeping import DONE, FAILED, Kept, Record, have_run
from tests.bench.performance.plan import Case, Run, Scene, scenes_in
from tests.bench.performance.running import Runner, code_digest, commit
from tests.bench.warp.settings import machine_facts, versions

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SCHEMA = 1
NAME = "scene_times"
OUTPUT = Path("build/scene-times")

PART = "scene times"
METHOD = "auto"
"""Value of `--fill`: the pair is made as a user gets it who asks for nothing."""

BOUND_SHARE = 0.5
"""Share of multiview's time that one of its two eyes takes, if the other one costs nothing."""

BAR_COLOURS = {True: BLUE, False: SKY}
BAR_TEXT_COLOURS = {True: "white", False: BLACK}
BAR_NAMES = {True: "denoised", False: "not denoised"}

SCENE_INCHES = 0.52
"""Height of the two bars of a scene, with the gap to the next."""

BAR_HEIGHT = 0.4
"""Share of `SCENE_INCHES`."""


@dataclass(frozen=True)
class SceneTime:
    """Time of a scene's pair beside that of Blender's multiview: medians over the turns. None where it failed."""

    scene: str
    denoised: bool
    seconds: float | None = None
    """Of the pair, both eyes, without loading the file and writing the result."""
    multiview_seconds: float | None = None
    """Of both eyes, rendered by multiview."""
    share: float | None = None
    """The pair's seconds over multiview's of the same process."""
    traced: float | None = None
    """Share of the second eye's pixels that were traced."""
    noise_ratio: float | None = None
    """Error of the second eye over that of a plain render, whose only error is noise; None where there is no noise."""
    message: str | None = None
    """Why the scene could not be measured."""


def cases_of(scenes: Sequence[Scene], options: argparse.Namespace) -> list[Case]:
    """Return the runs of all turns: in each turn every scene denoised and not."""
    return [
        Case(
            PART,
            Run(
                scene,
                METHOD,
                options.size,
                options.samples,
                options.accuracy,
                turn=turn,
                denoise=denoise,
                compare=True,
            ),
        )
        for turn in range(options.turns)
        for scene in scenes
        for denoise in (True, False)
    ]


def times_of(records: Mapping[Run, Record]) -> list[SceneTime]:
    """Return the times of each scene, denoised and not, in the order of the runs."""
    kinds = dict.fromkeys((run.scene.name, run.denoise) for run in records)
    return [
        _time_of(*kind, [record for run, record in records.items() if (run.scene.name, run.denoise) == kind])
        for kind in kinds
    ]


def _time_of(scene: str, denoised: bool, records: Sequence[Record]) -> SceneTime:
    """Return the medians over the turns that are done; the first turn's message where none is."""
    reports = [record["report"] for record in records if record["status"] == DONE]
    if not reports:
        return SceneTime(scene, denoised, message=records[0]["message"])
    ours = [report["seconds"]["total"] for report in reports]
    peers = [report["compare"]["multiview_seconds"] for report in reports]
    return SceneTime(
        scene,
        denoised,
        statistics.median(ours),
        statistics.median(peers),
        statistics.median(own / peer for own, peer in zip(ours, peers, strict=True)),
        statistics.median(report["fractions"]["rerendered"] for report in reports),
        _median_of_known(report["compare"]["noise_ratio"] for report in reports),
    )


def _median_of_known(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return statistics.median(known) if known else None


def by_gain(measured: Sequence[SceneTime]) -> list[tuple[str, list[SceneTime]]]:
    """Return the scenes and their times that are known, the greatest gain first: by the mean of a scene's shares.

    A scene of which nothing is known is left out.
    """
    scenes: dict[str, list[SceneTime]] = {}
    for time in measured:
        if time.share is not None:
            scenes.setdefault(time.scene, []).append(time)
    return sorted(scenes.items(), key=lambda item: statistics.fmean(time.share or 0.0 for time in item[1]))


def as_markdown(measured: Sequence[SceneTime]) -> str:
    """Return the table of all times in the order of the chart, and below them what could not be measured."""
    ordered = [time for _, own in by_gain(measured) for time in own]
    ordered += [time for time in measured if time.share is None]
    head = ["scene", "denoised", "pair", "multiview", "share of multiview", "speed-up", "traced", "noise ratio"]
    return table(head, [_cells(time) for time in ordered])


def _cells(time: SceneTime) -> list[str]:
    start = [cell(time.scene), "yes" if time.denoised else "no"]
    if time.share is None:
        return [*start, cell(time.message or "not measured"), *([NONE] * 5)]
    traced = NONE if time.traced is None else percent(time.traced)
    ratio = NONE if time.noise_ratio is None else f"{time.noise_ratio:.3f}"
    return [
        *start,
        seconds(time.seconds),
        seconds(time.multiview_seconds),
        percent(time.share),
        times(1.0 / time.share),
        traced,
        ratio,
    ]


def draw_times(data: Mapping[str, Any]) -> Figure:
    """Return the chart of what scene_times.json holds: two bars a scene, and lines at multiview and at its half."""
    measured = [SceneTime(**row) for row in data["rows"]]
    scenes = by_gain(measured)
    notes = _notes(measured, data["turns"])
    figure = new_figure(1.8 + 0.15 * len(notes.splitlines()) + SCENE_INCHES * max(len(scenes), 2))
    axes = add_axes_between(figure, notes, left=0.155, right=0.975)
    width, height = data["size"]
    details = (
        f"{width} × {height} pixels, {data['samples']} samples, accuracy {data['accuracy']}, Blender {data['blender']},"
        f" {data['machine']['cpu']}, {data['machine']['cores']} cores"
    )
    write_texts(figure, "Time of a stereo pair, as a share of that of Blender's own multiview", details, notes)
    for denoised in (True, False):
        _draw_bars(axes, scenes, denoised)
    _draw_lines(axes)
    _finish(axes, scenes)
    return figure


def _notes(measured: Sequence[SceneTime], turns: int) -> str:
    medians = f" Medians of {turns} turns." if turns > 1 else ""
    notes = [
        (
            "In the bars: seconds of the pair, and those of Blender's multiview, which renders both eyes. Both were "
            f"measured in one process, multiview after the pair; loading the file is left out.{medians}"
        )
    ]
    missing = [f"{time.scene} {BAR_NAMES[time.denoised]}" for time in measured if time.share is None]
    if missing:
        notes.append(f"Could not be measured: {', '.join(missing)}.")
    return wrapped(notes)


def _draw_bars(axes: Axes, scenes: Sequence[tuple[str, list[SceneTime]]], denoised: bool) -> None:
    """Draw the bars of one kind, with seconds inside and the share behind its end: the denoised above the other."""
    offset = -0.5 * BAR_HEIGHT if denoised else 0.5 * BAR_HEIGHT
    bars = [(row + offset, time) for row, (_, own) in enumerate(scenes) for time in own]
    bars = [(y, time, time.share or 0.0) for y, time in bars if time.denoised is denoised]
    axes.barh(
        [y for y, _, _ in bars],
        [length for _, _, length in bars],
        height=BAR_HEIGHT,
        color=BAR_COLOURS[denoised],
        edgecolor="white",
        linewidth=0.8,
        label=BAR_NAMES[denoised],
        zorder=2,
    )
    for y, time, length in bars:
        spent = f"{seconds(time.seconds)}, multiview {seconds(time.multiview_seconds)}"
        axes.text(0.012, y, spent, va="center", size=9, color=BAR_TEXT_COLOURS[denoised], zorder=3)
        axes.annotate(
            percent(length),
            (length, y),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            size=9.5,
            weight="bold",
            zorder=4,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
        )


def _draw_lines(axes: Axes) -> None:
    """Draw multiview's time and its half across the axes."""
    bound = "the bound: the second eye for nothing"
    axes.axvline(BOUND_SHARE, color=GREY, linewidth=1.1, linestyle=(0, (4, 3)), label=bound, zorder=3.5)
    axes.axvline(1.0, color=BLACK, linewidth=1.1, linestyle=(0, (1, 2)), label="Blender's multiview", zorder=3.5)


def _finish(axes: Axes, scenes: Sequence[tuple[str, list[SceneTime]]]) -> None:
    """Set the axes' ends, their labels and the legend."""
    from matplotlib.ticker import MultipleLocator, PercentFormatter

    longest = max((time.share or 0.0 for _, own in scenes for time in own), default=1.0)
    axes.set_xlim(0.0, max(1.13, 1.1 * longest))
    axes.set_ylim(len(scenes) - 0.45, -0.55)
    axes.set_yticks(range(len(scenes)), [scene for scene, _ in scenes], color=BLACK, size=10)
    axes.tick_params(axis="y", length=0)
    axes.xaxis.set_major_locator(MultipleLocator(0.25))
    axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0, symbol=" %"))
    axes.set_xlabel("time of the pair over that of multiview (shorter is better)")
    axes.xaxis.grid(color=PALE, alpha=0.3, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.legend(
        handles=[*axes.containers, *axes.lines],
        loc="lower left",
        bbox_to_anchor=(-0.005, 1.0),
        ncols=4,
        frameon=False,
        fontsize=9,
        handlelength=1.6,
        handletextpad=0.5,
        columnspacing=1.6,
        borderaxespad=0.2,
    )


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Return the options. Ends the program with status 2 where they are wrong."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.bench.scene_times", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("names", nargs="*", metavar="SCENE", help="only these scenes of the folder")
    given = parser.add_mutually_exclusive_group(required=True)
    given.add_argument("--scenes", type=Path, metavar="DIR", help="holds NAME/NAME.blend or NAME.blend")
    given.add_argument("--from", type=Path, metavar="FILE", dest="file", help="a scene_times.json to draw again")
    parser.add_argument(
        "--size", type=value_of(SceneOverrides, "size", size), default=(960, 540), metavar="WxH", help="of one eye"
    )
    parser.add_argument(
        "--samples", type=value_of(SceneOverrides, "samples", whole_number), default=48, metavar="N", help="per pixel"
    )
    parser.add_argument("--turns", type=_turns, default=1, metavar="N", help="how often; medians are shown")
    parser.add_argument("--accuracy", choices=ACCURACIES, default="balanced", help="of the pair (%(default)s)")
    parser.add_argument("--fresh", action="store_true", help="make finished runs again too")
    parser.add_argument(
        "--output", type=Path, metavar="DIR", help=f"for the results ({OUTPUT}; with --from, the folder of that file)"
    )
    options = parser.parse_args(arguments)
    options.output = options.output or (OUTPUT if options.file is None else options.file.parent)
    return options


def _turns(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"must be a whole number from 1, not {text!r}")
    return int(text)


def measured_data(options: argparse.Namespace, tell: Callable[[str], None]) -> dict[str, Any]:
    """Return what scene_times.json holds, of runs made now or kept from an earlier call. Raises ValueError.

    tell gets a line of text for each run as it ends.
    """
    facts = {"machine": machine_facts(), "versions": versions(*PACKAGES)}
    cases = cases_of(scenes_in(options.scenes, options.names), options)
    folder = options.output / "runs"
    for file in Kept.files(folder) if options.fresh else ():
        file.unlink()
    kept = Kept(folder, {**facts, "code": code_digest()})
    with tempfile.TemporaryDirectory() as work:
        records = have_run(cases, kept, Runner(Path(work)), tell=tell)
    reports = [record["report"] for record in records.values() if record["status"] == DONE]
    return {
        "schema": SCHEMA,
        "blender": reports[0]["blender"] if reports else facts["versions"]["blender"],
        "size": list(options.size),
        "samples": options.samples,
        "accuracy": options.accuracy,
        "turns": options.turns,
        **facts,
        "commit": commit(),
        "command": shlex.join(["python", "-m", "tests.bench.scene_times", *sys.argv[1:]]),
        "ended": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "rows": [asdict(time) for time in times_of(records)],
        "runs": [
            {"scene": run.scene.name, "denoised": run.denoise, "turn": run.turn, **record}
            for run, record in records.items()
        ],
    }


def read_data(path: Path) -> dict[str, Any]:
    """Return what a scene_times.json holds. Raises OSError, and ValueError where it is no such file."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path} is no JSON: {error}") from error
    if not isinstance(data, dict) or data.get("schema") != SCHEMA or "rows" not in data:
        raise ValueError(f"{path} is no {NAME}.json of this program")
    return data


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure the scenes or read the file, write the results and print the table. Return the exit status."""
    options = parse(arguments)
    try:
        check_charts()
        data = _measure(options) if options.file is None else read_data(options.file)
        options.output.mkdir(parents=True, exist_ok=True)
        draw_whole(draw_times, data, options.output / NAME)
    except (StereoReprojectError, ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt as error:
        print("interrupted; finished runs are kept, and the same command goes on", file=sys.stderr)
        return 128 + (error.args[0] if error.args else signal.SIGINT)
    print(as_markdown([SceneTime(**row) for row in data["rows"]]))
    return 1 if any(run["status"] == FAILED for run in data["runs"]) else 0


def _measure(options: argparse.Namespace) -> dict[str, Any]:
    """Measure the scenes and write scene_times.json; return what it holds."""
    be_interruptible()
    data = measured_data(options, lambda text: print(text, file=sys.stderr, flush=True))
    options.output.mkdir(parents=True, exist_ok=True)
    write_json(options.output / f"{NAME}.json", data)
    return data


if __name__ == "__main__":
    sys.exit(main())
