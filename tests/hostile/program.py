"""The program as users start it, in a process group of its own, and what must hold of it in whatever way it ends."""

from __future__ import annotations

import contextlib
import os
import re
import resource
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]

PROGRAMS = "stereo_reproject.programs"
"""Package of the modules that a run starts as processes of their own."""
DEMO = ROOT / "demo" / "cornell-box" / "cornell-box.blend"

SMALLEST = ("--size", "16x16", "--samples", "1", "--accuracy", "draft", "--no-denoise", "--fill", "packed")
"""Options of the quickest pair that there is: two seconds, nearly all of them Blender's start."""

PROGRAM = "stereo_reproject: "
ERROR = f"{PROGRAM}error: "
WARNING = f"{PROGRAM}warning: "

GONE_SECONDS = 15.0
"""How long processes of a run that has ended may take to be gone: the heartbeat clears up after it."""

PAIR = (
    "left.exr",
    "right.exr",
    "stereo.exr",
    "stereo.png",
    "holes.png",
    "estimate.png",
    "estimate.exr",
    "grid.png",
    "report.json",
)
"""The files of a pair, written down once more: the suite must notice when one is missing."""

UNFINISHED = re.compile(r"\.stereo_reproject-|\.tmp$|\.tmp\.|\.claim\.|^run-")
"""Names of what runs make under way, and of which nothing may be left."""

MARK = "STEREO_REPROJECT_HOSTILE_RUN"
"""An environment variable by which a run's processes are found, whoever their parent is by then."""

CASE_MARK = "STEREO_REPROJECT_HOSTILE_CASE"
"""The same of a case: its folder."""


@dataclass(frozen=True)
class Outcome:
    """How a run ended: status is the exit status, or minus the signal's number. left names what it left behind
    elsewhere: files in its temporary folder, and processes that still ran and were ended."""

    status: int
    stdout: bytes
    stderr: bytes
    seconds: float
    timed_out: bool
    left: tuple[str, ...] = ()

    def __str__(self) -> str:
        end = f"timed out after {self.seconds:.0f} s" if self.timed_out else f"status {self.status}"
        words = self.stderr.decode("utf-8", "backslashreplace")
        return f"{end}, stderr {words[-1200:]!r}, left {list(self.left)}"


def run_program(
    *arguments: str | bytes | Path,
    cwd: Path | str | None = None,
    environment: Mapping[str, str | bytes | None] | None = None,
    timeout: float = 120.0,
    limits: Mapping[int, int] | None = None,
    **how: Any,
) -> Outcome:
    """Run `python -m stereo_reproject` with these arguments to its end, or kill it after `timeout` seconds.

    environment changes variables of the suite's own, None removes one; limits are values of `resource.RLIMIT_...`.
    What `how` may hold beside is that of `start_program`.
    """
    with start_program(*arguments, cwd=cwd, environment=environment, limits=limits, **how) as run:
        return run.end(timeout)


def start_program(
    *arguments: str | bytes | Path,
    cwd: Path | str | None = None,
    environment: Mapping[str, str | bytes | None] | None = None,
    limits: Mapping[int, int] | None = None,
    prepare: Callable[[], None] | None = None,
    python: Sequence[str] = (sys.executable,),
    stdin: Any = subprocess.DEVNULL,
    stdout: Any = subprocess.PIPE,
    stderr: Any = subprocess.PIPE,
) -> Run:
    """Start it and return at once. prepare runs in the child before the program does; python is what starts it."""
    temporary = Path(tempfile.mkdtemp(prefix="hostile-temp-"))
    temporary.chmod(0o777)
    mark = secrets.token_hex(8)
    variables: dict[str, str | bytes] = {**os.environ, "TMPDIR": str(temporary), "PYTHONPATH": str(ROOT), MARK: mark}
    for name, value in (environment or {}).items():
        variables.pop(name, None)
        if value is not None:
            variables[name] = value

    def in_child() -> None:
        # Who starts in the background may have switched interrupts off, and a child inherits that.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        for kind, value in (limits or {}).items():
            resource.setrlimit(kind, (value, value))
        if prepare is not None:
            prepare()

    process = subprocess.Popen(
        [*python, "-m", "stereo_reproject", *arguments],
        cwd=cwd,
        env=variables,
        stdin=stdin,
        stdout=stdout,
        stderr=stderr,
        start_new_session=True,
        preexec_fn=in_child,  # noqa: PLW1509 - nothing here runs threads
    )
    return Run(process, mark, temporary)


class Run:
    """A run under way. Leaving it as a context ends all its processes, and removes its temporary folder."""

    def __init__(self, process: subprocess.Popen[bytes], mark: str, temporary: Path) -> None:
        self.process, self.temporary = process, temporary
        self._mark, self._started = mark, time.monotonic()

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()
        for stream in (self.process.stdin, self.process.stdout, self.process.stderr):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        shutil.rmtree(self.temporary, ignore_errors=True)

    def end(self, timeout: float = 120.0) -> Outcome:
        """How it ends, within so many seconds."""
        timed_out = False
        try:
            out, err = self.process.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            timed_out = True
            self.kill()
            out, err = self.process.communicate()
        seconds = time.monotonic() - self._started
        left = [] if timed_out else [f"process {words}" for words in self._still_running()]
        left += [str(path) for path in sorted(self.temporary.rglob("*"))]
        return Outcome(self.process.returncode, out or b"", err or b"", seconds, timed_out, tuple(left))

    def processes(self) -> list[int]:
        """All of its processes that live, those of its worker and their helpers included."""
        return [pid for pid in _processes() if self._is_ours(pid)]

    def children(self, module: str) -> list[int]:
        """Those that run the program of this name: worker, writer, heartbeat."""
        wanted = f"{PROGRAMS}.{module}".encode()
        return [pid for pid in self.processes() if wanted in _read(pid, "cmdline").split(b"\0")]

    def wait_for(self, condition: Callable[[], Any], *, seconds: float = 60.0) -> Any:
        """What the condition gives once that is true. Raises AssertionError when the run ends before, or is late."""
        deadline = time.monotonic() + seconds
        while not (found := condition()):
            assert self.process.poll() is None, f"it ended too early: {self.process.communicate()}"
            assert time.monotonic() < deadline, "waited in vain for a moment of the run"
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(0.01)
        return found

    def kill(self) -> None:
        """End everything of it at once."""
        while alive := self.processes():
            for pid in alive:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            self.process.poll()
            time.sleep(0.01)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(GONE_SECONDS)

    def _is_ours(self, pid: int) -> bool:
        if pid == self.process.pid:
            return self.process.poll() is None
        return f"{MARK}={self._mark}".encode() in _read(pid, "environ").split(b"\0")

    def _still_running(self) -> list[str]:
        deadline = time.monotonic() + GONE_SECONDS
        while (alive := self.processes()) and time.monotonic() < deadline:
            time.sleep(0.02)
        words = [_read(pid, "cmdline").replace(b"\0", b" ").decode("utf-8", "replace") for pid in alive]
        self.kill()
        return words


def end_all(name: str, value: str) -> None:
    """End every process whose environment has this variable, and what it has started meanwhile."""
    wanted = os.fsencode(f"{name}={value}")
    while alive := [pid for pid in _processes() if wanted in _read(pid, "environ").split(b"\0")]:
        for pid in alive:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        time.sleep(0.01)


def _processes() -> Iterator[int]:
    yield from (int(path.name) for path in Path("/proc").iterdir() if path.name.isdecimal())


def _read(pid: int, name: str) -> bytes:
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/{name}").read_bytes()
    return b""


def lines_of(outcome: Outcome) -> list[str]:
    """The lines on standard error that are no warnings."""
    lines = outcome.stderr.decode("utf-8", "backslashreplace").splitlines()
    return [line for line in lines if not line.startswith(WARNING)]


def _assert_sane(outcome: Outcome) -> None:
    """What holds of every run: it ends, says no nonsense, and leaves nothing elsewhere."""
    assert not outcome.timed_out, f"it hangs: {outcome}"
    text = outcome.stderr + outcome.stdout
    assert b"Traceback (most recent call last)" not in text, f"a traceback: {outcome}"
    assert b"defect" not in outcome.stderr, f"it calls itself defect: {outcome}"
    assert outcome.status >= 0, f"a signal ended it: {outcome}"
    assert not outcome.left, f"something is left behind: {outcome}"


def assert_done(outcome: Outcome) -> None:
    """Exit status 0, and nothing on standard error but warnings."""
    _assert_sane(outcome)
    assert outcome.status == 0, f"it should have been done: {outcome}"
    assert not lines_of(outcome), f"it says something though it is done: {outcome}"


def assert_bad_input(outcome: Outcome, *words: str) -> None:
    """Exit status 2, and one line that has these words in it."""
    _assert_sane(outcome)
    assert outcome.status == 2, f"it should have been refused: {outcome}"
    _assert_one_line(outcome)
    for word in words:
        assert word in lines_of(outcome)[0], f"it does not say {word!r}: {outcome}"


def assert_one_line_or_done(outcome: Outcome) -> None:
    """Done, or refused or failed with one line."""
    if outcome.status == 0 and not outcome.timed_out:
        assert_done(outcome)
        return
    _assert_sane(outcome)
    assert outcome.status in (1, 2), f"an odd exit status: {outcome}"
    _assert_one_line(outcome)


def assert_interrupted(outcome: Outcome, signum: int) -> None:
    """Exit status 128 and the signal's number, and one line that says so."""
    _assert_sane(outcome)
    assert outcome.status == 128 + signum, f"it should have ended with {128 + signum}: {outcome}"
    assert len(lines_of(outcome)) <= 1, f"not one line: {outcome}"


def _assert_one_line(outcome: Outcome) -> None:
    lines = lines_of(outcome)
    assert len(lines) == 1, f"not one line: {outcome}"
    assert lines[0].startswith(ERROR), f"not as errors begin: {outcome}"
    # Control characters would be a terminal's commands.
    assert lines[0].isprintable(), f"unprintable: {outcome}"
    assert outcome.stderr.endswith(b"\n"), f"the line does not end: {outcome}"


def names_in(folder: Path | str | bytes) -> set[str]:
    """Everything below a folder by its path in it, with undecodable bytes as surrogates. Links are not followed."""
    folder = os.fsdecode(folder)
    found: set[str] = set()
    for place, folders, files in os.walk(folder):
        found |= {os.path.relpath(os.path.join(place, name), folder) for name in (*folders, *files)}  # noqa: PTH118
    return found


def assert_nothing_left(folder: Path, *expected: str) -> None:
    """The folder holds entries of these names and no others (a name that ends in / stands for a folder with whatever
    is in it), and below it there is nothing half-made."""
    there = names_in(folder)
    half = sorted(name for name in there if UNFINISHED.search(Path(name).name))
    assert not half, f"half-made: {half} in {folder}"
    whole = tuple(name for name in expected if name.endswith("/"))
    wanted = {name.rstrip("/") for name in expected}
    odd = sorted(name for name in there - wanted if not name.startswith(whole)) if whole else sorted(there - wanted)
    assert not odd, f"unexpected: {odd} in {folder}"
    missing = sorted(wanted - there)
    assert not missing, f"missing: {missing} in {folder}"
