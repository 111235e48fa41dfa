"""What a run pays besides tracing, part by part, and the gain that this predicts for a fast GPU.

    python -m tests.bench.fixed_costs --scenes DIR [--sizes 1920x1080 960x540] [--samples 1] [--turns 3]
        [--clock wall|processor] [--other DIR] [--json FILE] [SCENE ...]

DIR holds NAME/NAME.blend or NAME.blend; cornell-box and living-room are measured where none is named. Each run is one
of the render command, in processes of its own, with holes traced packed and nothing denoised; Python's profiler tells
the parts of a stage apart, and its own time is in them. --other names the checkout of another version, which is
measured in turn with this one, as *before*. The tables show medians, in Markdown. --clock processor has the processor
time of the main thread, for a machine on which other programs run too (`measured_run.CLOCKS`).
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stereo_reproject.programs.converters import size, value_of, whole_number
from stereo_reproject.settings.frame import SceneOverrides
from stereo_reproject.trace.costs import TraceCosts
from tests.bench.fixed_costs.measured_run import CLOCKS
from tests.bench.performance.cells import size_text, table, times
from tests.bench.performance.plan import Scene, scenes_in

ROOT = Path(__file__).resolve().parents[3]
MEASURED_RUN = Path(__file__).with_name("measured_run.py")

SCENES = ("cornell-box", "living-room")
SIZES = ((1920, 1080), (960, 540))
SOURCE_SECONDS = (5.0, 20.0, 60.0)
"""Seconds of a source render for which the gain is predicted."""

BEFORE, NOW = "before", "now"

OUTSIDE = (
    "copy of the file (panel)",
    "start of the second Blender",
    "load of the .blend",
    "account",
    "left.exr, right.exr, estimate.exr",
    "stereo.exr",
    "stereo.png",
    "holes.png, estimate.png, grid.png",
    "end, and files moved into place",
)
"""Parts that are not in a pair's total seconds."""

SYNCS = ("sync of the source", "syncs of the later render calls")
"""Parts that Cycles' own render seconds hold: a device's source seconds have the first one in them."""


@dataclass(frozen=True)
class Prediction:
    """Predicted seconds of a pair beside multiview, for a source that takes so many seconds.

    pair_seconds are those of the report's total; run_seconds also have what comes before and after it. gain is that of
    the pair, run_gain that of the run, over the two eyes of multiview.
    """

    source_seconds: float
    pair_seconds: float
    run_seconds: float

    @property
    def gain(self) -> float:
        return 2.0 * self.source_seconds / self.pair_seconds

    @property
    def run_gain(self) -> float:
        return 2.0 * self.source_seconds / self.run_seconds


def parts_of(run: Mapping[str, Any]) -> dict[str, float]:
    """Return the seconds of each part of a measured run that is no tracing, by its name in the table."""
    stages, functions = run["stages"], run["functions"]

    def within(stage: str, *names: str) -> float:
        return sum(functions.get(stage, {}).get(name, 0.0) for name in names)

    def beside_renders(*names: str) -> float:
        return sum(stages[name] - within(name, "call", "read") for name in names if name in stages)

    def between(*names: str) -> float:
        return sum(within(name, "call", "read") - within(name, "cycles") for name in names)

    warp = ("sharpness", "edges", "reasons", "estimator")
    copy, start, load, account, eyes, stereo, picture, pictures, end = OUTSIDE
    return {
        copy: run["copy"],
        start: run["start"],
        load: stages["load"],
        "look at the scene": stages["plan"],
        SYNCS[0]: run["syncs"][0],
        SYNCS[1]: sum(run["syncs"][1:]),
        "render calls beside Cycles: EXR written and read": between("source", "fill", "refine"),
        "source, beside its render call": beside_renders("source"),
        "warp: map and lookups": stages["warp"] - within("warp", *warp),
        "warp: sharpness": within("warp", "sharpness"),
        "warp: edges and reasons": within("warp", "edges", "reasons"),
        "warp: contrast for probes": within("warp", "estimator"),
        "fill and refine, beside their render calls": beside_renders("fill", "refine"),
        "composite": stages["composite"],
        account: stages["account"],
        eyes: within("write", "eye files"),
        stereo: within("write", "stereo.exr"),
        picture: within("write", "stereo.png"),
        pictures: within("write", "holes.png", "estimate.png", "grid.png"),
        end: run["end"],
    }


def medians(runs: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the median of each part over the turns."""
    return {name: statistics.median(run[name] for run in runs) for name in runs[0]}


def in_total(parts: Mapping[str, float]) -> float:
    """Return the seconds of the parts that are in a pair's total and are no tracing."""
    return sum(value for name, value in parts.items() if name not in (*OUTSIDE, *SYNCS))


def predicted(parts: Mapping[str, float], traced: float, calls: int, source_seconds: float) -> Prediction:
    """Return the prediction for a source of so many seconds, its sync among them.

    parts are what was measured here; traced is the share of the second eye that is traced, in so many calls after the
    source's. A packed pixel and a call cost as assumed (`TraceCosts`); all that is no tracing costs as here.
    """
    costs = TraceCosts()
    tracing = traced * costs.packed_pixel_cost * source_seconds + calls * costs.render_call_seconds
    pair = source_seconds + tracing + in_total(parts)
    return Prediction(source_seconds, pair, pair + sum(parts[name] for name in OUTSIDE))


def break_even(parts: Mapping[str, float], traced: float, calls: int, *, whole_run: bool) -> float:
    """Return the source seconds below which the pair, or with whole_run the run, takes longer than multiview."""
    none = predicted(parts, traced, calls, 0.0)
    fixed = none.run_seconds if whole_run else none.pair_seconds
    return fixed / (1.0 - traced * TraceCosts().packed_pixel_cost)


def measured(scene: Scene, picture: tuple[int, int], samples: int, clock: str, root: Path) -> dict[str, Any]:
    """Return what one run of the version in the folder `root` has measured by a clock. Raises CalledProcessError."""
    overrides = {
        "size": picture,
        "samples": samples,
        "denoise": False,
        "interocular_distance": scene.interocular,
        "convergence_distance": scene.convergence,
    }
    options = json.dumps({"blend": str(scene.blend.resolve()), "overrides": overrides, "clock": clock})
    environment = {**os.environ, "PYTHONPATH": str(root), "STEREO_REPROJECT_USER_FOLDER": ""}
    command = [sys.executable, "-P", str(MEASURED_RUN), "drive", options]
    done = subprocess.run(command, env=environment, cwd=root, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def as_markdown(runs: Mapping[tuple[str, str, str], Sequence[Mapping[str, Any]]]) -> str:
    """Return the tables of the parts and of the prediction. runs are those of each scene, size and version."""
    parts = {key: medians([parts_of(run) for run in turns]) for key, turns in runs.items()}
    names = next(iter(parts.values()))
    head = ["part", *(", ".join(key) for key in parts)]
    rows = [[name, *(f"{of_key[name]:.2f} s" for of_key in parts.values())] for name in names]
    rows.append(["all in the pair's total", *(f"{in_total(of_key):.2f} s" for of_key in parts.values())])
    outside = (sum(of_key[name] for name in OUTSIDE) for of_key in parts.values())
    rows.append(["all outside of it", *(f"{seconds:.2f} s" for seconds in outside)])
    gains = []
    for key, of_key in parts.items():
        traced = statistics.median(run["traced"] for run in runs[key])
        calls = round(statistics.median(len(run["syncs"]) - 1 for run in runs[key]))
        told = [predicted(of_key, traced, calls, source) for source in SOURCE_SECONDS]
        even = [f"{break_even(of_key, traced, calls, whole_run=whole):.1f} s" for whole in (False, True)]
        shown = [f"{times(one.gain)} ({times(one.run_gain)})" for one in told]
        gains.append([", ".join(key), f"{traced:.1%}", *shown, f"{even[0]} ({even[1]})"])
    told_of = [f"source of {source:g} s" for source in SOURCE_SECONDS]
    return "\n\n".join([table(head, rows), table(["run", "traced", *told_of, "break-even"], gains)])


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Return the options; an error in them ends the program."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.bench.fixed_costs", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("names", nargs="*", metavar="SCENE", default=SCENES)
    parser.add_argument("--scenes", type=Path, required=True, metavar="DIR")
    parser.add_argument("--sizes", type=value_of(SceneOverrides, "size", size), nargs="+", default=SIZES, metavar="WxH")
    parser.add_argument("--samples", type=value_of(SceneOverrides, "samples", whole_number), default=1)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--clock", choices=tuple(CLOCKS), default="wall", help="processor where other programs run too")
    parser.add_argument("--other", type=Path, metavar="DIR", help="checkout of another version, measured in turn")
    parser.add_argument("--json", type=Path, metavar="FILE", help="everything that was measured")
    return parser.parse_args(arguments)


def main() -> None:
    """Measure all runs, turn by turn, and print the tables."""
    options = parse()
    versions = {**({BEFORE: options.other.resolve()} if options.other else {}), NOW: ROOT}
    runs: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    for _ in range(options.turns):
        for scene in scenes_in(options.scenes, options.names):
            for picture in options.sizes:
                for version, root in versions.items():
                    key = (scene.name, size_text(picture), version)
                    runs.setdefault(key, []).append(measured(scene, picture, options.samples, options.clock, root))
                    print(*key, file=sys.stderr)
    if options.json:
        options.json.write_text(json.dumps([[*key, turns] for key, turns in runs.items()]))
    print(as_markdown(runs))


if __name__ == "__main__":
    main()
