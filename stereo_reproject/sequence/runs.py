"""Runs that work on the same animation: each has a file with a number that counts up, by which others see it live."""

from __future__ import annotations

import contextlib
import json
import os
import re
import secrets
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..errors import StereoReprojectError
from ..files import (
    UnusableFileError,
    flush,
    flush_folder,
    is_regular,
    leads_elsewhere,
    put_in_place,
    read_small,
    remove,
)
from ..jobs.work_folder import is_running, machine
from ..jobs.worker_process import module_command, worker_environment
from ..words import Words

BEAT_SECONDS = 2.0
BEAT_DIGITS = 20

APPEAR_ATTEMPTS = 5
"""Number of times that a run tries to make its file: each time, another run would have to remove the folder just then.
"""

CLAIM = ".claim."
"""Part of the name of a claim's file; a number follows."""

TOKEN = re.compile(r"[0-9a-f]{16}")
"""Form of a run's token, its name in the journal."""

RUN_FILE = re.compile(rf"run-({TOKEN.pattern})")
CLAIM_FILE = re.compile(r"[A-Za-z0-9._-]*[0-9]{4,}\.claim\.[1-9][0-9]{0,17}")
UNFINISHED_FILE = re.compile(rf"\.(run-{TOKEN.pattern}|[A-Za-z0-9._-]+\.(json|png|svg)\.{TOKEN.pattern})\.tmp")
"""Files of these names are ours, and so to be removed when no run needs them any more."""

RUN_BYTES = 8192
"""Greatest size of a run's file."""

UNSETTLED = b'"settled": 0'
"""Part of the file of a run that has yet to find out whether another is in its way."""

STALE_SECONDS = 90.0
"""Time after which a run is dead whose number has not changed. Drives may show a file's earlier content for a minute.
"""


class LiveRuns:
    """The runs that have a file in the journal's `folder`, and the means to tell which of them live: the number in a
    live run's file changes.

    A run whose number has not changed for stale_seconds counts as dead. clock returns seconds that never go backwards.
    """

    def __init__(
        self, folder: Path, *, stale_seconds: float = STALE_SECONDS, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.stale_seconds = stale_seconds
        self.clock = clock
        self._folder = folder
        self._seen: dict[str, tuple[bytes, float]] = {}
        self._beating: set[str] = set()

    def lives(self, token: str) -> bool:
        """Return True if a run may still be at work. A dead run of this machine is recognised at once, one of another
        machine when its number has not changed for a while, so that this must be asked repeatedly."""
        try:
            content = self._content(token)
        except (FileNotFoundError, UnusableFileError):
            return False
        if _is_dead_here(content):
            return False
        now = self.clock()
        beat = content[-BEAT_DIGITS:]
        if token not in self._seen or self._seen[token][0] != beat:
            if token in self._seen:
                self._beating.add(token)
            self._seen[token] = beat, now
        return now - self._seen[token][1] < self.stale_seconds

    def is_at_work(self, token: str) -> bool | None:
        """Return True for a run whose number was seen to change and that lives, False for a dead one, and None while
        neither is known."""
        if not self.lives(token):
            return False
        return True if token in self._beating else None

    def announced(self, *, but: str) -> dict[str, Mapping[str, Any]]:
        """Return the facts that other runs have announced of themselves, by token, if these runs may be at work. but is
        the token of this run. Raises OSError."""
        found: dict[str, Mapping[str, Any]] = {}
        for token in sorted(self._tokens() - {but}):
            with contextlib.suppress(FileNotFoundError, UnusableFileError):
                if self.lives(token):
                    found[token] = _facts(self._content(token))
        return found

    def mark_settled(self, token: str) -> None:
        """Note in a run's file that it is settled: it has found no other run in its way, see `other_runs.settle`. Does
        nothing where the file is gone. Raises OSError."""
        path = self.path(token)
        # Without its file it counts as dead, whatever it does.
        if not is_regular(path):
            return
        with path.open("r+b") as file:
            place = file.read(RUN_BYTES).rfind(UNSETTLED)
            if place >= 0:
                # One byte over another: the heartbeat writes into the same file, and a full disk has room for it.
                file.seek(place + len(UNSETTLED) - 1)
                file.write(b"1")

    def _content(self, token: str) -> bytes:
        """Return the content of a run's file. `token` may also be the file name of a claim that names no run, which has
        the content b"". Raises OSError, such as FileNotFoundError where there is neither."""
        if TOKEN.fullmatch(token):
            return read_small(self.path(token), RUN_BYTES)
        # A claim that names no run yet is watched as if it were one.
        if CLAIM_FILE.fullmatch(token) and is_regular(self._folder / token):
            return b""
        raise FileNotFoundError(token)

    def path(self, token: str) -> Path:
        """Return the path of a run's file."""
        return self._folder / f"run-{token}"

    def clear(self, own: str) -> None:
        """Remove the files that dead runs have left. own is the token of the calling run, which must have nothing
        half-made itself.

        Claims and unfinished files are removed only if no other run lives, because one that was thought dead may go on.
        Nothing is removed in a folder that is a link. Errors are ignored.
        """
        if leads_elsewhere(self._folder):
            return
        # Listed before the runs are: whatever appears later is of a run that is there by then.
        with contextlib.suppress(OSError):
            left = [path for path in self._folder.iterdir() if _is_left_over(path)]
            others = self._tokens() - {own}
            dead = {token for token in others if not self.lives(token)}
            for path in [*map(self.path, dead), *(left if dead == others else ())]:
                remove(path)

    def any_lives(self, *, but: str) -> bool:
        """Return True if any run other than `but`, a token, may be at work. Raises OSError."""
        return any(token != but and self.lives(token) for token in self._tokens())

    def _tokens(self) -> set[str]:
        """Return the tokens of the runs that have a file. Raises OSError."""
        found = ((RUN_FILE.fullmatch(path.name), path) for path in self._folder.iterdir())
        return {match[1] for match, path in found if match and is_regular(path)}


def _is_left_over(path: Path) -> bool:
    """Return True if a path is a regular file with the name of a claim or of an unfinished file of ours."""
    named_so = CLAIM_FILE.fullmatch(path.name) or UNFINISHED_FILE.fullmatch(path.name)
    return named_so is not None and is_regular(path)


def _is_dead_here(content: bytes) -> bool:
    """Return True if a run's file, of which this is the content, is of a process of this machine that is gone."""
    facts = _facts(content)
    pid = facts.get("pid")
    return type(pid) is int and facts.get("machine") == machine() and not is_running(pid)


def _facts(content: bytes) -> Mapping[str, Any]:
    """Return the facts in the content of a run's file; {} where they cannot be read."""
    with contextlib.suppress(ValueError, LookupError, RecursionError):
        facts = json.loads(content.splitlines()[0])
        if isinstance(facts, dict):
            return facts
    return {}


@contextmanager
def run_at_work(runs: LiveRuns, announced: Mapping[str, Any] | None = None) -> Iterator[str]:
    """Announce this process as a run at work, for the time of a `with` block, and yield its token. Other runs see it as
    live until the block is over or the process is gone; then its file is removed, also after an error.

    announced are facts about it for the others, less than `RUN_BYTES` as JSON, which they see from the first moment on.
    Its number is counted up by a process of its own, because no thread may run beside Blender. Raises OSError and
    StereoReprojectError.
    """
    token = secrets.token_hex(8)
    path = runs.path(token)
    facts = {**(announced or {}), "machine": machine(), "pid": os.getpid()}
    _appear(path, f"{json.dumps(facts)}\n{0:0{BEAT_DIGITS}}")
    try:
        with _heartbeat(path):
            runs.clear(token)
            yield token
    finally:
        runs.clear(token)
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)


def _appear(path: Path, text: str) -> None:
    """Write a run's file with this text, whole or not at all. The folder is made if it is missing, and again if a run
    that has just ended removes it. Raises OSError."""
    beside = path.with_name(f".{path.name}.tmp")
    for left in reversed(range(APPEAR_ATTEMPTS)):
        try:
            path.parent.mkdir(exist_ok=True)
            beside.write_text(text, encoding="ascii")
            flush(beside)
            put_in_place(beside, path)
            flush_folder(path.parent)
        except FileNotFoundError:
            if not left:
                raise
        except OSError:
            # The disk is full, and is not to hold what comes to nothing.
            for half in (beside, path):
                with contextlib.suppress(OSError):
                    half.unlink(missing_ok=True)
            raise
        else:
            return


@contextmanager
def _heartbeat(path: Path) -> Iterator[None]:
    """Run the process that counts up the number in a run's file, for the time of a `with` block; it is ended
    afterwards, also after an error. Raises StereoReprojectError if it cannot be started."""
    try:
        process = subprocess.Popen(
            [*module_command("programs.heartbeat"), str(path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=worker_environment(),
            # What kills this process's group must not kill the one that reports it.
            start_new_session=os.name == "posix",
            creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        )
    except OSError as error:
        raise StereoReprojectError(
            Words(
                "{program} could not be started ({reason}); free some resources",
                program=sys.executable,
                reason=error.strerror,
            )
        ) from error
    try:
        yield
    finally:
        assert process.stdin is not None
        with contextlib.suppress(OSError):
            process.stdin.close()
        process.wait()
