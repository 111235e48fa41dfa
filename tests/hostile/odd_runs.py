"""A run on an odd .blend, and what every such run must keep: its exit status, one line, nothing left half-made."""

from __future__ import annotations

import json
import os
import resource
import shutil
from collections.abc import Iterable
from functools import partial
from pathlib import Path

from tests.hostile.blends import DONE, EITHER, OUTSIDE, OddBlend, blends_of
from tests.hostile.case import Case
from tests.hostile.linked_files import MAIN
from tests.hostile.program import (
    PAIR,
    Outcome,
    assert_bad_input,
    assert_done,
    assert_nothing_left,
    assert_one_line_or_done,
    run_program,
)

OPTIONS = ("--accuracy", "draft")

GIGABYTE = 1 << 30
MEMORY = {resource.RLIMIT_AS: 6 * GIGABYTE}
"""A count that was damaged must not fill the machine's memory."""


def cases_of(module: str) -> Iterable[Case]:
    """A case for each file that a module of makers makes."""
    return (Case(blend.name, partial(check_odd, blend)) for blend in blends_of(module))


def check_odd(blend: OddBlend, folder: Path) -> None:
    """Render an odd .blend, and raise AssertionError when something is not as promised."""
    assert not blend.unmade, f"the .blend could not be made: {blend.unmade}"
    scene = folder / "odd.blend"
    shutil.copyfile(blend.path, scene)
    outcome = run_program(blend.command, scene, "--output", folder / "out", *OPTIONS, *blend.options)
    assert_ended(outcome, blend.statuses, *blend.words)
    check = assert_pair_or_nothing if blend.command == "render" else assert_frames_or_nothing
    check(outcome, folder, "odd.blend")
    assert not Path(OUTSIDE).exists(), f"{OUTSIDE} was written: {outcome}"


def assert_ended(outcome: Outcome, statuses: tuple[int, ...], *words: str) -> None:
    """The run ended as it may, in time, and said what it must."""
    match statuses:
        case _ if statuses == DONE:
            assert_done(outcome)
        case _ if statuses == EITHER:
            assert_one_line_or_done(outcome)
        case _:
            assert_bad_input(outcome)
    said = (outcome.stdout + outcome.stderr).decode("utf-8", "backslashreplace").lower()
    missing = [word for word in words if word.lower() not in said]
    assert not missing, f"it does not say {missing}: {outcome}"


def assert_pair_or_nothing(outcome: Outcome, folder: Path, *others: str) -> None:
    """A pair is whole, or there is nothing of it; the folder has nothing else in it but the others."""
    if outcome.status != 0:
        assert_nothing_left(folder, *others)
        return
    assert_nothing_left(folder, "out", *(f"out/{name}" for name in PAIR), *others)
    json.loads((folder / "out" / "report.json").read_bytes())


def assert_frames_or_nothing(outcome: Outcome, folder: Path, *others: str) -> None:
    """Frames lie in the output folder alone, and none is empty; nothing is left of a run that was refused."""
    if not (folder / "out").exists():
        assert outcome.status != 0, f"it is done, and nothing is there: {outcome}"
        assert_nothing_left(folder, *others)
        return
    assert_nothing_left(folder, "out/", *others)
    found = [path for path in (folder / "out").rglob("*") if path.is_file()]
    empty = [path.name for path in found if not path.stat().st_size]
    assert not empty, f"empty files: {empty}"
    if outcome.status == 0:
        reports = [path for path in found if path.name.endswith("animation.json")]
        assert len(reports) == 1, f"its reports are {reports}"
        frames = json.loads(reports[0].read_bytes())["frames"]
        assert frames, "no frame is in its report"
        missing = [name for frame in frames for name in frame["files"] if not (folder / "out" / name).is_file()]
        assert not missing, f"missing: {missing}"


def render_beside(
    folder: Path, statuses: tuple[int, ...], *words: str, options: tuple[str, ...] = (), main: str = MAIN
) -> None:
    """Render the file of this name in the folder, beside what else lies there."""
    beside = {os.fspath(path.relative_to(folder)) for path in folder.rglob("*")}
    outcome = run_program("render", folder / main, "--output", folder / "out", *OPTIONS, *options, limits=MEMORY)
    assert_ended(outcome, statuses, *words)
    assert_pair_or_nothing(outcome, folder, *beside)
