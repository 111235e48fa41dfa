"""Kills: each is resumed, and what comes of it is compared with what an uninterrupted run makes."""

from __future__ import annotations

import contextlib
import functools
import json
import os
import random
import signal
import subprocess
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from stereo_reproject.sequence.journal_folder import JOURNAL
from tests.hostile.case import Case
from tests.hostile.program import (
    DEMO,
    PAIR,
    SMALLEST,
    Outcome,
    Run,
    assert_done,
    assert_interrupted,
    assert_nothing_left,
    assert_one_line_or_done,
    names_in,
    run_program,
    start_program,
)
from tests.hostile.rows._animations import (
    FRAMES,
    claimed,
    pictures,
    recorded,
    records,
    reference,
    resume,
    scene,
    start,
    work_folders,
)

TITLE = "kills, each resumed and compared"
SEEN_BEFORE = 39

MOMENTS: dict[str, Callable[[Run, Path], object]] = {
    "with its folder just made": lambda _run, output: work_folders(output),
    "with Blender just started": lambda run, _output: run.children("worker"),
    "with its journal just made": lambda _run, output: (output / JOURNAL).exists(),
    "at the claim of frame 1": lambda _run, output: claimed(output, 1),
    "with its writer just started": lambda run, _output: run.children("writer"),
    "at the claim of frame 3": lambda _run, output: claimed(output, 3),
    "with one file of frame 3 in its place": lambda _run, output: (output / "0003_L.png").exists(),
    "at the record of frame 4": lambda _run, output: recorded(output, 4),
    "at the last frame but one": lambda _run, output: recorded(output, FRAMES - 1),
    "at the report": lambda _run, output: recorded(output, FRAMES),
}


def _everything(run: Run) -> list[int]:
    return run.processes()


def _main(run: Run) -> list[int]:
    return [run.process.pid]


def _helper(name: str) -> Callable[[Run], list[int]]:
    return lambda run: run.children(name)


def _main_and_worker(run: Run) -> list[int]:
    return [run.process.pid, *run.children("worker")]


VICTIMS: dict[str, Callable[[Run], list[int]]] = {
    "everything": _everything,
    "the program": _main,
    "the program and Blender": _main_and_worker,
    "Blender": _helper("worker"),
    "the writer": _helper("writer"),
    "the heartbeat": _helper("heartbeat"),
}


def _send(pids: Iterable[int], signum: int) -> None:
    for pid in pids:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signum)


def _wait(run: Run, seconds: float) -> None:
    """Some time of a run, or its end."""
    with contextlib.suppress(subprocess.TimeoutExpired):
        run.process.wait(seconds)


def _killed(moment: str, victim: str, signum: int, folder: Path) -> None:
    """Whatever is killed at whatever moment: what was finished stays as it was, and --resume makes it whole."""
    output = folder / "out"
    expected = reference(folder)
    with start(folder) as run:
        run.wait_for(lambda: MOMENTS[moment](run, output))
        _send(VICTIMS[victim](run), signum)
        outcome = run.end()
    assert not outcome.timed_out, f"it hangs: {outcome}"
    assert not outcome.left, f"it leaves something: {outcome}"
    if VICTIMS[victim] not in (_everything, _main, _main_and_worker):
        assert_one_line_or_done(outcome)
        # A heartbeat that was not yet started cannot clear away what it was to be of; the next run does.
        for path in (output / JOURNAL).glob("run-*"):
            path.unlink()
        assert_nothing_left(output, *names_in(output))
    _assert_finished(output, expected)
    resume(folder)


def _assert_finished(output: Path, expected: Path) -> None:
    """Each frame with a record is there, and is the one that it should be."""
    there, wanted = pictures(output), pictures(expected)
    for name, record in records(output).items():
        for file in record["files"]:
            assert there.get(file) == wanted[file], f"{file} is not as its record {name} says"


def _interrupted(moment: str, signum: int, folder: Path) -> None:
    """A signal that asks for the end leaves nothing half-made, at once."""
    output = folder / "out"
    with start(folder) as run:
        run.wait_for(lambda: MOMENTS[moment](run, output))
        run.process.send_signal(signum)
        outcome = run.end()
    if outcome.status != 0:
        # It may have been done a moment before.
        assert_interrupted(outcome, signum)
    if output.exists():
        assert_nothing_left(output, *names_in(output))
    resume(folder)


def _impatient(folder: Path) -> None:
    """Ctrl-C, ten times."""
    output = folder / "out"
    with start(folder) as run:
        run.wait_for(lambda: recorded(output, 2))
        for _ in range(10):
            _send([run.process.pid], signal.SIGINT)
            _wait(run, 0.02)
        outcome = run.end()
    assert_interrupted(outcome, signal.SIGINT)
    resume(folder)


def _again_and_again(seed: int, folder: Path) -> None:
    """Killed at random moments until it has come to its end, everything or only the program."""
    output, moments = folder / "out", random.Random(seed)
    expected = reference(folder)
    for _ in range(4):
        with start(folder, "--resume") as run:
            _wait(run, moments.uniform(0.1, 2.5))
            _send(moments.choice([_everything, _main, _main_and_worker])(run), signal.SIGKILL)
            outcome = run.end()
        assert not outcome.timed_out
        _assert_finished(output, expected)
    resume(folder)


def _one_of_several(count: int, victim: str, moment: str, folder: Path) -> None:
    """Of several that work on the same frames one is killed: the others take its frame over, and end with all there."""
    output = folder / "out"
    reference(folder)
    with contextlib.ExitStack() as stack:
        runs = [stack.enter_context(start(folder, "--resume")) for _ in range(count)]
        runs[0].wait_for(lambda: MOMENTS[moment](runs[0], output))
        _send(VICTIMS[victim](runs[0]), signal.SIGKILL)
        outcomes = [run.end(240) for run in runs]
    for outcome in outcomes[1:]:
        assert_done(outcome)
    resume(folder)


def _movie(moment: str, folder: Path) -> None:
    """Killed while a movie is made: there is none or a whole one, and the next run makes it."""
    output = folder / "out"
    options = ("--layout", "side-by-side", "--movie")
    moments: dict[str, Callable[[], object]] = {
        "before it": lambda: recorded(output, FRAMES),
        "under way": lambda: recorded(output, FRAMES) and [*output.rglob("*.mp4")],
        "just there": lambda: [*output.glob("*.mp4")],
    }
    with start(folder, *options) as run:
        run.wait_for(moments[moment])
        _send(_everything(run), signal.SIGKILL)
        run.end()
    for path in output.glob("*.mp4"):
        assert path.stat().st_size > 500, f"half a movie: {path}"
    arguments = ("animate", scene(folder), "--output", output, *SMALLEST, "--frames", f"1-{FRAMES}")
    assert_done(run_program(*arguments, *options, "--resume"))
    (movie,) = output.glob("*.mp4")
    assert movie.stat().st_size > 500
    assert not work_folders(output)


def _pair(moment: str, victim: str, folder: Path) -> None:
    """A pair over an earlier one is that one or the new one, never a mixture that a report vouches for."""
    output = folder / "out"
    arguments = ("render", DEMO, "--output", output, *SMALLEST)
    assert_done(run_program(*arguments, "--size", "8x8"))
    with start_program(*arguments) as run:
        _wait_for_pair(run, output, moment)
        _send(VICTIMS[victim](run), signal.SIGKILL)
        outcome = run.end()
    assert not outcome.timed_out
    _assert_report_vouches(output, outcome)
    assert_done(run_program(*arguments))
    assert_nothing_left(output, *PAIR)
    assert json.loads((output / "report.json").read_text())["size"] == [16, 16]


def _wait_for_pair(run: Run, output: Path, moment: str) -> None:
    moments: dict[str, Callable[[], object]] = {
        "at its start": lambda: work_folders(output),
        "with Blender started": lambda: run.children("worker"),
        "with a source": lambda: [*output.glob(".stereo_reproject-*/*.exr"), *output.glob(".stereo_reproject-*/out/*")],
        "with a file finished": lambda: [*output.glob(".stereo_reproject-*/out/*")],
        "with all finished": lambda: [*output.glob(".stereo_reproject-*/out/report.json")],
        "while the old goes": lambda: [*output.glob(".stereo_reproject-*/old/*")],
        "while the new comes": lambda: not (output / "report.json").exists() or run.process.poll() is not None,
    }
    with contextlib.suppress(AssertionError):
        # Some of these are over in a millisecond, and the run with them.
        run.wait_for(moments[moment])


def _assert_report_vouches(output: Path, outcome: Outcome) -> None:
    """Where a report stands, all files are there, of one size."""
    if not (output / "report.json").exists():
        return
    missing = [name for name in PAIR if not (output / name).exists()]
    assert not missing, f"a report beside missing files {missing}: {outcome}"
    width, height = json.loads((output / "report.json").read_text())["size"]
    sizes = {name: _png_size(output / name) for name in ("holes.png", "stereo.png")}
    assert sizes["stereo.png"] == (2 * width, height), f"a report of another pair: {sizes}, {width} x {height}"


def _png_size(path: Path) -> tuple[int, int]:
    header = path.read_bytes()[16:24]
    return int.from_bytes(header[:4], "big"), int.from_bytes(header[4:], "big")


def _inspection(victim: str, folder: Path) -> None:
    """An inspection that is killed leaves its folder where temporary files are, and the next takes that away."""
    temporary = folder / "temporary"
    temporary.mkdir()
    variables = {"TMPDIR": str(temporary)}
    with start_program("inspect", DEMO, *SMALLEST, environment=variables) as run:
        run.wait_for(lambda: run.children("worker"))
        _send(VICTIMS[victim](run), signal.SIGKILL)
        assert not run.end().timed_out
    assert_done(run_program("inspect", DEMO, *SMALLEST, environment=variables))
    assert_nothing_left(folder, "temporary")


def _kills() -> Iterator[tuple[str, str, int]]:
    for moment in MOMENTS:
        yield moment, "everything", signal.SIGKILL
        yield moment, "the program", signal.SIGKILL
        if moment != "with its folder just made":
            yield moment, "Blender", signal.SIGKILL
    yield "at the claim of frame 3", "the program and Blender", signal.SIGKILL
    for moment in list(MOMENTS)[4:8]:
        yield moment, "the writer", signal.SIGKILL
    yield "at the claim of frame 3", "the heartbeat", signal.SIGKILL
    yield "at the record of frame 4", "the heartbeat", signal.SIGTERM
    for signum in (signal.SIGSEGV, signal.SIGABRT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1, signal.SIGPIPE):
        yield "at the claim of frame 3", "Blender", signum
    yield "at the claim of frame 3", "the writer", signal.SIGSEGV
    yield "at the claim of frame 3", "the program", signal.SIGSEGV
    yield "at the record of frame 4", "the program", signal.SIGQUIT


def cases() -> Iterator[Case]:
    for moment, victim, signum in _kills():
        name = f"{victim} {moment}, by {signal.Signals(signum).name}"
        yield Case(name, functools.partial(_killed, moment, victim, signum))
    for signum in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        for moment in list(MOMENTS)[:: 2 if signum == signal.SIGINT else 4]:
            name = f"{signal.Signals(signum).name} {moment}"
            yield Case(name, functools.partial(_interrupted, moment, signum))
    yield Case("Ctrl-C ten times", _impatient)
    for seed in range(6):
        yield Case(f"at random moments, {seed}", functools.partial(_again_and_again, seed))
    for count, victim, moment in (
        (2, "everything", "at the claim of frame 1"),
        (2, "the program", "at the claim of frame 3"),
        (3, "everything", "at the claim of frame 3"),
        (3, "everything", "at the last frame but one"),
    ):
        check = functools.partial(_one_of_several, count, victim, moment)
        yield Case(f"{victim} of one of {count} {moment}", check)
    for moment in ("before it", "under way", "just there"):
        yield Case(f"a movie {moment}", functools.partial(_movie, moment))
    for moment, victim in (
        ("at its start", "the program"),
        ("at its start", "everything"),
        ("with Blender started", "Blender"),
        ("with Blender started", "the program"),
        ("with a source", "everything"),
        ("with a file finished", "Blender"),
        ("with a file finished", "everything"),
        ("with all finished", "the program"),
        ("while the old goes", "everything"),
        ("while the new comes", "everything"),
    ):
        yield Case(f"a pair {moment}, {victim}", functools.partial(_pair, moment, victim))
    for victim in ("everything", "the program", "Blender"):
        yield Case(f"an inspection, {victim}", functools.partial(_inspection, victim))
