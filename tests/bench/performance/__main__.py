"""The performance analysis of the paper, in our terms, on this machine.

    python -m tests.bench.performance --scenes DIR [SCENE ...]
    python -m tests.bench.performance --quick

docs/performance.md says what it measures and what the files are that it writes. Exit status: 0 all done, 1 a run
failed, 2 bad input, 130 interrupted, 143 terminated.
"""

from __future__ import annotations

import argparse
import json
import shlex
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import FrameType
from typing import Any

from stereo_reproject.blender.scene.file_digest import file_digest
from stereo_reproject.errors import BadInputError, StereoReprojectError
from stereo_reproject.files import whole_file, write_json
from stereo_reproject.jobs.work_folder import WORK_PREFIX, work_folder
from stereo_reproject.programs.cli import version
from stereo_reproject.report.chart_canvas import check_charts
from tests.bench.performance import paper
from tests.bench.performance.keeping import DONE, FAILED, LEFT_OUT, Kept, Record, have_run
from tests.bench.performance.options import parse, plan_of
from tests.bench.performance.pictures import draw_all
from tests.bench.performance.plan import DEMO, PATH, TRIANGLES, Case, Plan, Run, Scene, cases, scene_of, scenes_in
from tests.bench.performance.results import analysed, write_csv
from tests.bench.performance.running import ROOT, Runner, code_digest, commit, last_json, run_process
from tests.bench.performance.tables import as_markdown
from tests.bench.warp.settings import machine_facts, versions

RESULTS = ("results.csv", "results.md", "results.json")
PACKAGES = ("bpy", "numpy", "scipy", "matplotlib")


def main(arguments: Sequence[str] | None = None) -> int:
    be_interruptible()
    try:
        options = parse(arguments)
        check_charts()
        return _analyse(options, lambda text: print(text, flush=True))
    except (StereoReprojectError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        where = f": {error.filename}" if error.filename else ""
        print(f"error: {error.strerror or error}{where}", file=sys.stderr)
        return 1
    except KeyboardInterrupt as error:
        print("interrupted; finished runs are kept, and the same command goes on", file=sys.stderr)
        return 128 + (error.args[0] if error.args else signal.SIGINT)


def be_interruptible() -> None:
    """End in order on these signals, also where Ctrl-C is ignored, as in the background of a script."""
    for signum in (signal.SIGINT, signal.SIGTERM):
        signal.signal(signum, _interrupt)


def _interrupt(signum: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt(signum)


def _analyse(options: argparse.Namespace, tell: Callable[[str], None]) -> int:
    plan, output = plan_of(options), options.output.resolve()
    demo = scene_of(ROOT / DEMO)
    scenes = [demo] if options.quick else scenes_in(options.scenes, options.names)
    study = _study(options, [demo, *scenes])
    with work_folder(output, RESULTS) as work:
        _check_alone(output, work)
        return _have_analysed(options, plan, scenes, study, output, work, tell)


def _check_alone(output: Path, work: Path) -> None:
    """Raises BadInputError where another analysis is at work: side by side, neither's times would say anything."""
    for other in output.glob(f"{WORK_PREFIX}*"):
        if other != work:
            raise BadInputError(
                f"another analysis is writing to {output}; wait for it, choose another folder, "
                f"or remove {other.name} if none is"
            )


def _have_analysed(
    options: argparse.Namespace,
    plan: Plan,
    scenes: Sequence[Scene],
    study: Scene,
    output: Path,
    work: Path,
    tell: Callable[[str], None],
) -> int:
    kept_in = output / "runs"
    if options.fresh:
        for file in (*Kept.files(kept_in), *(note for note in output.glob("variants/*.json") if "of" in _noted(note))):
            file.unlink()
    facts = {"machine": machine_facts(), "versions": {"stereo_reproject": version(), **versions(*PACKAGES)}}
    path = _path(plan, options, study, output, work)
    subdivided = _subdivided(plan, study, output, work)
    planned = cases(plan, scenes, study, path, subdivided)
    if not planned:
        raise BadInputError(f"nothing of {', '.join(plan.parts)} can be measured of these scenes; name others")
    records = have_run(
        planned,
        Kept(kept_in, {**facts, "code": code_digest()}),
        Runner(work / "tmp"),
        tell=tell,
        seconds=options.seconds,
    )
    _write(output, options, facts, planned, records)
    tell(f"files: {output}")
    return 1 if any(record["status"] == FAILED for record in records.values()) else 0


def _study(options: argparse.Namespace, known: Sequence[Scene]) -> Scene:
    """The scene of which one thing is varied. Raises ValueError."""
    found = {scene.name: scene for scene in known}
    name = options.study or DEMO.stem
    if name not in found:
        raise ValueError(f"--study: no scene {name}; known are: {', '.join(found)}")
    return found[name]


def _path(plan: Plan, options: argparse.Namespace, study: Scene, output: Path, work: Path) -> Scene:
    """The scene with a moving camera: the one that was named, or the study with a path that is made."""
    if options.animated is not None:
        if not options.animated.is_file():
            raise ValueError(f"--animated: there is no file {options.animated}")
        return scene_of(options.animated.resolve())
    name = f"{study.name}-path"
    if PATH not in plan.parts:
        return replace(study, name=name)
    distance = [] if study.convergence is None else [f"--distance={study.convergence}"]
    return _variant(study, name, [f"--frames={max(plan.frames)}", *distance], output, work)


def _subdivided(plan: Plan, study: Scene, output: Path, work: Path) -> list[Scene]:
    if TRIANGLES not in plan.parts:
        return []
    return [
        _variant(study, f"{study.name}-subdivided-{level}", [f"--subdivisions={level}"], output, work)
        for level in plan.subdivisions
    ]


def _variant(scene: Scene, name: str, how: Sequence[str], output: Path, work: Path) -> Scene:
    """A variant of a scene, made in a process of its own unless it is there; with what is amiss, if it cannot be."""
    folder = output / "variants"
    blend, note = folder / f"{name}.blend", folder / f"{name}.json"
    wanted = [file_digest(scene.blend), *how]
    made = _noted(note)
    if not (made.get("of") == wanted and blend.is_file()):
        folder.mkdir(parents=True, exist_ok=True)
        module = "tests.bench.performance.variants"
        ended = run_process(["-m", module, str(scene.blend), str(blend), *how], work / "tmp")
        told = last_json(ended.output)
        if ended.status != 0 or told is None:
            return replace(scene, name=name, amiss=f"the variant could not be made: {ended.message()}")
        made = {"of": wanted, "triangles": told["triangles"]}
        write_json(note, made)
    return replace(scene, name=name, blend=blend, triangles=made["triangles"])


def _noted(path: Path) -> dict[str, Any]:
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return value if isinstance(value, dict) else {}


def _write(
    output: Path,
    options: argparse.Namespace,
    facts: Mapping[str, Any],
    planned: Sequence[Case],
    records: Mapping[Run, Record],
) -> None:
    """All files of the results, each whole."""
    results = analysed(planned, records)
    blenders = [row["blender"] for row in results["runs"] if row["blender"]]
    counts = {state: sum(r["status"] == state for r in records.values()) for state in (DONE, FAILED, LEFT_OUT)}
    results["facts"] = {
        **facts,
        "command": shlex.join(["python", "-m", "tests.bench.performance", *sys.argv[1:]]),
        "commit": commit(),
        "turns": plan_of(options).turns,
        "quick": options.quick,
        "blender": blenders[0] if blenders else None,
        "runs": counts,
        "ended": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "paper": paper.FACTS,
    }
    results["charts"] = draw_all(results, output)
    with whole_file(output / "results.csv") as beside:
        write_csv(beside, results["runs"])
    with whole_file(output / "results.md") as beside:
        beside.write_text(as_markdown(results), encoding="utf-8")
    write_json(output / "results.json", results)


if __name__ == "__main__":
    sys.exit(main())
