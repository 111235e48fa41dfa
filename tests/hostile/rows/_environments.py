"""Limits, rights, users and folders that the program is started with."""

from __future__ import annotations

import functools
import os
import resource
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from stereo_reproject.sequence.journal_folder import JOURNAL
from tests.hostile.case import Case
from tests.hostile.program import (
    DEMO,
    PAIR,
    SMALLEST,
    assert_bad_input,
    assert_done,
    assert_nothing_left,
    assert_one_line_or_done,
    run_program,
)
from tests.hostile.rows import _streams, _variables
from tests.hostile.rows._names import ANIMATION
from tests.hostile.rows._privileges import as_user, without_powers
from tests.hostile.rows._variables import ANIMATE, RENDER


def _limited(kind: int, value: int, command: tuple[Any, ...], works: bool | None, folder: Path) -> None:
    """Where a limit bites there is one line, and what is left of the result is nothing, or whole frames."""
    outcome = run_program(*command, cwd=folder, limits={kind: value}, environment={"TMPDIR": str(folder)})
    if works:
        assert_done(outcome)
    else:
        assert_one_line_or_done(outcome)
    if works is False:
        assert outcome.status, "the limit did not bite"
    files = PAIR if command is RENDER else ANIMATION
    if outcome.status == 0:
        assert_nothing_left(folder, "out", *(f"out/{name}" for name in files))
    else:
        left = {path.name for path in folder.rglob("*") if path.is_file() and JOURNAL not in path.parts}
        assert left <= set(ANIMATION), f"half-made: {left}"


def _umask(mask: int, powers: bool, folder: Path) -> None:
    def switch() -> None:
        os.umask(mask)
        if not powers:
            without_powers()

    outcome = run_program(*RENDER, cwd=folder, prepare=switch)
    if not mask & 0o700:
        assert_done(outcome)
        for name in PAIR:
            mode = (folder / "out" / name).stat().st_mode & 0o777
            assert mode == 0o666 & ~mask, f"{name} has the rights {mode:o}"
    else:
        assert_one_line_or_done(outcome)
        assert outcome.status == 0 or not [path for path in folder.rglob("*") if path.is_file()]


def _gone_folder(relative: bool, command: tuple[Any, ...], folder: Path) -> None:
    """The folder that it was started in is no more: with absolute paths that does not matter."""
    gone = folder / "gone"
    gone.mkdir()

    def leave() -> None:
        os.chdir(gone)
        gone.rmdir()

    output = "out" if relative else str(folder / "out")
    outcome = run_program(command[0], DEMO, "--output", output, *command[4:], prepare=leave)
    if relative:
        assert_bad_input(outcome)
        assert_nothing_left(folder)
    else:
        assert_done(outcome)


def _started_in(place: str, folder: Path) -> None:
    outcome = run_program("render", DEMO, "--output", folder / "out", *SMALLEST, cwd=place)
    assert_done(outcome)
    assert_nothing_left(folder, "out", *(f"out/{name}" for name in PAIR))


def _shut_folder(folder: Path) -> None:
    """A folder that may be neither read nor searched, and is the one that it was started in."""
    shut = folder / "shut"
    shut.mkdir()

    def enter() -> None:
        os.chdir(shut)
        shut.chmod(0)
        without_powers()

    outcome = run_program("render", DEMO, "--output", folder / "out", *SMALLEST, prepare=enter)
    assert_done(outcome)


def _shadows(names: tuple[str, ...], folder: Path) -> None:
    """Modules of these names, in the folder that it was started in, are not taken for those that Blender needs."""
    for name in names:
        (folder / name).write_text("from pathlib import Path\nPath('pwned').touch()\nraise SystemExit('shadowed')\n")
    outcome = run_program(*RENDER, cwd=folder)
    assert_done(outcome)
    assert_nothing_left(folder, *names, "out", *(f"out/{name}" for name in PAIR))


def _prepared(prepare: Callable[[], Any], folder: Path) -> None:
    assert_done(run_program(*RENDER, cwd=folder, prepare=prepare))


def _many_files() -> None:
    for _ in range(900):
        os.set_inheritable(os.open(os.devnull, os.O_RDONLY), True)


def _nobody(number: int, command: tuple[Any, ...], folder: Path) -> None:
    """A user that no list knows, without a home."""
    outcome = run_program(*command, cwd=folder, python=as_user(number), environment={"HOME": None})
    assert_done(outcome)


def _no_variables(folder: Path) -> None:
    """`env -i`, but for where the package is, and the mark by which the suite finds its processes."""
    names = {name: None for name in os.environ if name != "PATH"}
    assert_done(run_program(*RENDER, cwd=folder, environment=names))


def _limits() -> Iterator[Case]:
    for kind, words, values in (
        (
            resource.RLIMIT_AS,
            "memory",
            {200 << 20: False, 700 << 20: None, 1 << 30: None, 2 << 30: None, 16 << 30: True},
        ),
        (resource.RLIMIT_DATA, "data", {50 << 20: False, 300 << 20: None, 8 << 30: True}),
        (resource.RLIMIT_NOFILE, "open files", {8: False, 12: None, 20: None, 40: None, 256: True}),
        (resource.RLIMIT_FSIZE, "size of files", {0: False, 200: False, 2000: False, 5000: False, 1 << 30: True}),
        (resource.RLIMIT_STACK, "stack", {1 << 20: True, 64 << 20: True, resource.RLIM_INFINITY: True}),
        (resource.RLIMIT_CPU, "seconds of the processor", {60: True}),
        (resource.RLIMIT_MEMLOCK, "locked memory", {0: True}),
        (resource.RLIMIT_CORE, "core files", {0: True}),
    ):
        for value, works in values.items():
            for command in (RENDER, ANIMATE):
                check = functools.partial(_limited, kind, value, command, works)
                yield Case(f"{command[0]} with {words} up to {value}", check)


def _places() -> Iterator[Case]:
    for mask in (0o000, 0o077, 0o022, 0o222, 0o333, 0o777):
        for powers in (True, False):
            if powers or mask & 0o700:
                yield Case(
                    f"umask {mask:o}, {'as root' if powers else 'without rights'}",
                    functools.partial(_umask, mask, powers),
                )
    for command in (RENDER, ANIMATE):
        for relative in (True, False):
            check = functools.partial(_gone_folder, relative, command)
            yield Case(f"{command[0]} in a folder that is gone{', relative' if relative else ''}", check)
    for place in ("/", "/proc", "/dev", "/sys", "/proc/self/fd"):
        yield Case(f"in {place}", functools.partial(_started_in, place))
    yield Case("in a folder that may not be read", _shut_folder)
    yield Case(
        "beside other modules", functools.partial(_shadows, ("bpy.py", "numpy.py", "OpenEXR.py", "mathutils.py"))
    )
    for words, prepare in (
        ("nice 19", lambda: os.nice(19)),
        ("one processor", lambda: os.sched_setaffinity(0, {0})),
        ("idle scheduling", lambda: os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))),
        ("900 open files of its parent", _many_files),
        ("first to be killed for memory", lambda: Path("/proc/self/oom_score_adj").write_text("1000")),
    ):
        yield Case(words, functools.partial(_prepared, prepare))
    for number, command in ((12345, RENDER), (4294967293, RENDER), (12345, ANIMATE)):
        yield Case(f"{command[0]} as user {number}", functools.partial(_nobody, number, command))
    yield Case("without any variables", _no_variables)


def cases() -> Iterator[Case]:
    yield from _variables.cases()
    yield from _limits()
    yield from _streams.cases()
    yield from _places()
