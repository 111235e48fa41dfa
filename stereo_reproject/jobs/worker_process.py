"""The worker as a process: started where it finds what it needs, read line by line, and ended with all that it started.
Its messages are described in `supervisor`."""

from __future__ import annotations

import contextlib
import importlib.machinery
import os
import queue
import re
import signal
import subprocess
import sys
import sysconfig
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

from ..errors import LIMITED, StereoReprojectError
from ..words import Words, joined
from .memory import is_limited, oom_kills

POLL_SECONDS = 0.1
EXIT_SECONDS = 10.0
LOG_TAIL_BYTES = 65536
MAX_LOG_BYTES = 1 << 22
LAST_WORDS_LENGTH = 240
SAMPLES_TAIL_BYTES = 2048
SAMPLES_LINE = re.compile(rb"(?:Rendered (\d+)/(\d+) Tiles, )?Sample (\d+)/(\d+)\D")
"""Count of a render's samples in the log; large pictures are rendered in tiles, and each tile counts its own."""
REMARK = re.compile(r"Fra:\d|\d+:\d\d\.\d+ [^|]*\|(?! *(ERROR|FATAL))")
"""Lines of Blender's log that report progress, or that Blender 5 does not call an error."""

PACKAGE = __name__.split(".")[-3]

LIBRARIES = ("OpenEXR",)
"""Python packages that the worker needs and that Blender does not bring."""

# On Windows a program without a console must not open one for its worker, nor for what ends it.
_NO_WINDOW = getattr(subprocess, "CREATE_NO_WINDOW", 0)
_CREATION_FLAGS = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0) | _NO_WINDOW


def own_worker() -> list[str]:
    """Return the command that starts this package's own worker."""
    return module_command("programs.worker")


def module_command(name: str) -> list[str]:
    """Return the command that runs this package's module `name` in a new Python process, which must have a
    `worker_environment`."""
    # In an extension this package lies below Blender's own packages; the module is found by its folder.
    # Not from the folder in which it is started, where another package may have this name.
    return [sys.executable, "-P", "-m", f"{PACKAGE}.{name}"]


def start_worker(command: Sequence[str] | None, work: Path) -> Worker:
    """Start the worker by `command` (by default our own) with the private folder `work`, and return it. Use it in a
    `with` block, at whose end the worker is killed. Raises StereoReprojectError where no process can be started."""
    try:
        return Worker(command, work)
    except OSError as error:
        reason, program = error.strerror or str(error), (command or own_worker())[0]
        raise StereoReprojectError(
            Words("{program} could not be started ({reason}); free some resources", program=program, reason=reason)
        ) from error


class Worker:
    """The worker process, and all processes that it starts. At the end of a `with` block they are killed.

    `log` is the file that gets what Blender prints, and `oom_kills_before` the count of `memory.oom_kills` when the
    worker got its job.
    """

    def __init__(self, command: Sequence[str] | None, work: Path) -> None:
        self._own_python = command is None
        command = own_worker() if command is None else command
        self.log = work / "blender.log"
        self._work = work
        self.oom_kills_before = oom_kills()
        self._environment = private_environment(work, own_python=self._own_python)
        self._killed = False
        self._stage_begins = 0
        self._tiles_done = 0.0
        """Fraction of a render in tiles that is done."""
        self._lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        with self.log.open("ab") as log:
            # A group of its own: Ctrl-C on the terminal must reach this process alone.
            self.process = subprocess.Popen(
                list(command),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                env=self._environment,
                start_new_session=os.name == "posix",
                creationflags=_CREATION_FLAGS,
            )
        threading.Thread(target=self._read, daemon=True).start()

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()

    def is_as_started_now(self) -> bool:
        """Return whether the worker lives and has the environment variables that one started now would have."""
        environment = private_environment(self._work, own_python=self._own_python)
        return self.process.poll() is None and self._environment == environment

    def send(self, line: bytes) -> None:
        """Write a line to the worker's standard input, and count processes that the kernel ends from now on. Does
        nothing if the worker is dead: whoever reads its output notices that."""
        self.oom_kills_before = oom_kills()
        assert self.process.stdin is not None
        with contextlib.suppress(OSError):
            self.process.stdin.write(line)
            self.process.stdin.flush()

    def _read(self) -> None:
        """Put the lines of the worker's standard output into a queue, and b"" at its end; runs in a thread of its
        own."""
        # This thread alone closes the pipe: closing it elsewhere would wait for a read that is under way.
        assert self.process.stdout is not None
        with self.process.stdout as stdout:
            for line in stdout:
                self._lines.put(line)
        self._lines.put(b"")

    def next_line(self) -> bytes | None:
        """Return the next line of the worker's output; None if none comes within POLL_SECONDS, b"" if no more can
        come."""
        ended = self.process.poll() is not None
        try:
            return self._lines.get(timeout=POLL_SECONDS)
        except queue.Empty:
            # A descendant of a dead worker may keep the pipe open.
            return b"" if ended else None

    def wait(self, seconds: float) -> int | None:
        """Wait for the worker to end and return its exit status; None if it still runs after `seconds`."""
        try:
            return self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            return None

    def kill(self) -> None:
        """Kill the worker and all processes that it started, and wait until the worker is gone, for EXIT_SECONDS at
        most. A second call does nothing."""
        if self._killed:
            return
        self._killed = True
        _kill_group(self.process)
        self.wait(EXIT_SECONDS)
        assert self.process.stdin is not None
        with contextlib.suppress(OSError):
            self.process.stdin.close()

    def begin_stage(self) -> None:
        """Begin to count samples anew for `samples_done`: those in the log so far belong to earlier stages."""
        self._tiles_done = 0.0
        with contextlib.suppress(OSError):
            self._stage_begins = self.log.stat().st_size

    def trim_log(self) -> None:
        """Empty the log if it has more than MAX_LOG_BYTES. That of an animation would fill the drive."""
        with contextlib.suppress(OSError):
            if self.log.stat().st_size > MAX_LOG_BYTES:
                # The worker appends.
                os.truncate(self.log, 0)
                self._stage_begins = 0

    def samples_done(self) -> float | None:
        """Return the fraction of this stage's samples that are rendered, from 0 to 1, in all tiles of the picture, as
        Blender's log has it; None where the log does not say it."""
        with contextlib.suppress(OSError), self.log.open("rb") as log:
            log.seek(max(self._stage_begins, os.fstat(log.fileno()).st_size - SAMPLES_TAIL_BYTES))
            samples = SAMPLES_LINE.findall(log.read())
            if samples:
                counts = [[int(number or 0) for number in line] for line in samples[-2:]]
                tile, tiles, done, total = counts[-1]
                if not tiles:
                    return done / max(total, 1)
                # As a tile ends, the tiles are counted before its samples begin anew.
                has_ended = done >= total and counts[0][0] < tile
                return self._of_tiles(tile, tiles, 0.0 if has_ended else done / max(total, 1))
        return None

    def _of_tiles(self, tile: int, tiles: int, part: float) -> float:
        """Return the fraction of a render in tiles that is done, never less than before: so many of all tiles, and of
        one more a part, from 0 to 1."""
        if tile == 0 and self._tiles_done > 1.0 / tiles:
            # The stage has another render.
            self._tiles_done = 0.0
        self._tiles_done = max(self._tiles_done, (tile + part) / tiles)
        return self._tiles_done

    def last_words(self) -> str:
        """Return the last line in the log that tells something: not empty, and no mere progress report. "" where there
        is none; for the message after a crash."""
        with contextlib.suppress(OSError), self.log.open("rb") as log:
            log.seek(max(0, os.fstat(log.fileno()).st_size - LOG_TAIL_BYTES))
            lines = [line.strip() for line in log.read().decode("utf-8", "replace").splitlines()]
            return next((line for line in reversed(lines) if line and not REMARK.match(line)), "")[:LAST_WORDS_LENGTH]
        return ""


def worker_environment(*, own_python: bool = True) -> dict[str, str]:
    """Return the environment variables by which a new process finds this package and the libraries it needs. own_python
    is True if the process runs this same Python; for another, such as Blender's, settings of this Python are left
    out."""
    environment = dict(os.environ)
    if not own_python:
        # What is set for the caller's Python, or installed for a user's, is not for Blender's.
        environment = {name: value for name, value in environment.items() if not name.startswith("PYTHON")}
        environment["PYTHONNOUSERSITE"] = "1"
    # Charts are drawn on canvases of their own; with a backend that it does not know, matplotlib is not even imported.
    environment.pop("MPLBACKEND", None)
    # The worker must find this very package, wherever the caller stands and however it came here, and in Blender the
    # libraries that an extension brings along.
    homes = [Path(__file__).resolve().parents[2], *_folders_of(LIBRARIES)]
    installed = {Path(sysconfig.get_path(name)).resolve() for name in ("purelib", "platlib")}
    added = [str(home) for home in dict.fromkeys(homes) if home not in installed]
    if added:
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, (*added, environment.get("PYTHONPATH"))))
    return environment


def private_environment(folder: Path, *, own_python: bool) -> dict[str, str]:
    """Return a `worker_environment` whose temporary files go into tmp in a run's private `folder`, so that they are
    removed with it. Blender leaves some behind when its process is ended."""
    environment = worker_environment(own_python=own_python)
    environment.update(dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(folder / "tmp")))
    return environment


def _folders_of(modules: Sequence[str]) -> Iterator[Path]:
    """Yield the folders from which these Python modules are imported; those that are not found are left out. The
    current folder is not searched."""
    # Not in the folder where the caller stands, in which Python looks first: anything may lie there under these names.
    here = _resolved(os.curdir)
    path = [entry for entry in sys.path if _resolved(entry or os.curdir) not in (None, here)]
    for name in modules:
        with contextlib.suppress(ImportError, ValueError):
            found = importlib.machinery.PathFinder.find_spec(name, path)
            if found is not None and found.origin is not None:
                place = Path(found.origin).resolve().parent
                yield place.parent if found.submodule_search_locations else place


def _resolved(folder: str) -> str | None:
    """Return a folder's path with all links followed; None for the current folder if that is gone."""
    try:
        return os.path.realpath(folder)
    except OSError:
        return None


def _kill_group(process: subprocess.Popen[bytes]) -> None:
    """Kill a process and all that it started. On Linux and macOS this works when the process itself is dead already,
    too."""
    if sys.platform == "win32":
        if process.poll() is None:
            taskkill = ["taskkill", "/T", "/F", "/PID", str(process.pid)]
            with contextlib.suppress(OSError):
                subprocess.run(taskkill, capture_output=True, check=False, creationflags=_NO_WINDOW)
            process.kill()
    else:
        # A group outlives its leader: what the worker started is ended even when the worker itself is dead.
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)


def crash_message(worker: Worker, stage: str, *, kept: str) -> Words:
    """Return a message in words about a Blender that ended without reporting an error: how it ended, during which
    stage, the likely cause, and the last line of its log. `kept` says what became of the results and is put into the
    message. Waits up to EXIT_SECONDS for the process to end."""
    status = worker.wait(EXIT_SECONDS)
    killed = os.name == "posix" and status == -signal.SIGKILL
    why = log = ""
    if killed:
        why = Words(_why_killed(worker.oom_kills_before))
    elif status is not None and status < 0 and is_limited():
        # Few libraries get over it when they are given no memory.
        why = Words(LIMITED)
    words = worker.last_words()
    if words and not killed:
        # A process that is killed from outside leaves no word of it in its log.
        log = Words("last in its log: {words}", words=words)
    ended = Words("Blender {ended} during {stage}", ended=_how_it_ended(status), stage=stage)
    return joined("; ", ended=ended, why=why, kept=Words(kept), log=log)


def _why_killed(oom_kills_before: int | None) -> str:
    """Return the likely reason, in words, for a kill by SIGKILL: memory ran out if the kernel has ended processes since
    `oom_kills_before` was counted; else something unknown."""
    now = oom_kills()
    if now is not None and oom_kills_before is not None and now > oom_kills_before:
        return "memory has run out: render smaller, or free some"
    return "something outside of it has done that; if memory ran out, render smaller, or free some"


def _how_it_ended(status: int | None) -> Words:
    """Return in words how a process ended, from its exit status: negative is the number of the signal that killed it,
    None means that it still runs."""
    if status is None:
        return Words("stopped unexpectedly (its output ended)")
    if status >= 0:
        shown = hex(status) if status > 255 else status
        return Words("stopped unexpectedly (exit status {status})", status=shown)
    with contextlib.suppress(ValueError):
        return Words("was killed by signal {number} ({name})", number=-status, name=signal.Signals(-status).name)
    return Words("was killed by signal {number}", number=-status)
