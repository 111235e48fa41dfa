"""A run on an odd .blend, and what every such run must keep: its exit status, one line, nothing left half-made."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

from stereo_reproject.work_folder import FILES
from tests.hostile.blends import EITHER, REFUSED, OddBlend, blends_of
from tests.hostile.case import Case
from tests.hostile.program import (
    Outcome,
    assert_bad_input,
    assert_done,
    assert_nothing_left,
    assert_one_line_or_done,
    run_program,
)

OPTIONS = ("--accuracy", "draft")

SECONDS = 120.0
"""Far more than any of these runs takes."""


def cases_of(module: str) -> Iterable[Case]:
    """A case for each file that a module of makers makes."""
    return (Case(blend.name, partial(check, blend)) for blend in blends_of(module))


def check(blend: OddBlend, folder: Path) -> None:
    """Render an odd .blend, and raise AssertionError when something is not as promised."""
    assert not blend.unmade, f"the .blend could not be made: {blend.unmade}"
    scene = folder / "odd.blend"
    shutil.copyfile(blend.path, scene)
    outcome = run_program(
        blend.command, str(scene), "--output", str(folder / "out"), *OPTIONS, *blend.options, timeout=SECONDS
    )
    assert_ended(outcome, blend.statuses, blend.words)
    if blend.command == "render":
        assert_pair_or_nothing(outcome, folder, "odd.blend")
    else:
        assert_frames_or_nothing(outcome, folder, "odd.blend")


def assert_ended(outcome: Outcome, statuses: tuple[int, ...], words: tuple[str, ...]) -> None:
    """The run ended as it may, in time, and said what it must."""
    check_end: Callable[[Outcome], None] = {EITHER: assert_one_line_or_done, REFUSED: assert_bad_input}.get(
        statuses, assert_done
    )
    check_end(outcome)
    said = f"{outcome.stdout}\n{outcome.stderr}".lower()
    missing = [word for word in words if word.lower() not in said]
    assert not missing, f"{missing} is not said: {outcome.stderr!r}"


def assert_pair_or_nothing(outcome: Outcome, folder: Path, *others: str) -> None:
    """A pair is whole, or there is nothing of it; the folder has nothing else in it but the others."""
    if outcome.status != 0:
        assert_nothing_left(folder, *others)
        return
    assert_nothing_left(folder, "out", *others)
    assert_nothing_left(folder / "out", *FILES)
    json.loads((folder / "out" / "report.json").read_bytes())


def assert_frames_or_nothing(outcome: Outcome, folder: Path, *others: str) -> None:
    """Frames lie in the output folder alone, and none is empty; nothing is left of a run that was refused."""
    if outcome.status == REFUSED[0]:
        assert_nothing_left(folder, *others)
        return
    assert_nothing_left(folder, "out", *others)
    found = [path for path in (folder / "out").rglob("*") if path.is_file()]
    half_made = [path.name for path in found if ".tmp" in path.name or ".claim." in path.name or not _has_content(path)]
    assert not half_made, f"half-made files: {half_made}"
    if outcome.status == 0:
        assert json.loads(_report_of(found).read_bytes())["frames"], "no frame is in the report"


def _has_content(path: Path) -> bool:
    return path.stat().st_size > 0


def _report_of(found: Iterable[Path]) -> Path:
    reports = [path for path in found if path.name.endswith("animation.json")]
    assert len(reports) == 1, f"reports: {[path.name for path in reports]}"
    return reports[0]
