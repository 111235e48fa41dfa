"""The process that Blender runs in: started, listened to, and cleaned up after, in whatever way it ends.

Blender does not run in the process that the user talks to. So neither Ctrl-C nor a crash inside a render nor a hang at
exit can leave anything half-made: this process, which never imports bpy, kills the worker's whole process group,
removes the run's private folder, and only a complete result is moved into the output folder.

The worker (`python -m stereo_reproject.worker`)
------------------------------------------------
stdin    one line of JSON: {"command": what to do, "blend", "output" (null without files), "work": absolute paths,
         "settings": StereoSettings as nested dicts, "files": those to be made, "only": names of runs, "session": a
         Session as a dict}.
         It then stays open for the whole run: at its end this process is gone, and the worker must end itself.
stdout   one JSON object per line:
           {"event": "stage", "stage": "fill", "fraction": 0..1 or null, "detail": "optional text"}
           {"event": "warning", "message": "..."}
           {"event": "done", "report": {...}, "files": ["left.exr", ...]}
           {"event": "error", "status": 1 or 2, "message": "what, where, what to do, on one line"}
         Lines that are no such object are passed over.
stderr   work/blender.log, whose last line is what a crash is reported with.
work     private to the run, and gone after it. Finished files are left in work/out; temporary ones belong in work/tmp,
         which the environment names as the folder for temporary files (TMPDIR, TEMP, TMP).

After "done" the worker has EXIT_SECONDS to end; how it ends then changes nothing.
"""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import queue
import signal
import subprocess
import sys
import sysconfig
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

from .errors import BadInputError, StereoReprojectError
from .report import check_report
from .settings import StereoSettings
from .work_folder import FILES, check_complete, publish, superseded_by, work_folder

POLL_SECONDS = 0.1
LIBRARIES = ("OpenEXR",)
"""What the worker needs that Blender does not bring."""
EXIT_SECONDS = 10.0
LOG_TAIL_BYTES = 65536
LAST_WORDS_LENGTH = 240

# On Windows a program without a console must not open one for its worker.
_CREATION_FLAGS = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0) | getattr(subprocess, "CREATE_NO_WINDOW", 0)

_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name))
_SIGNAL_WORDS: dict[int, str] = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}

Event = dict[str, Any]


@dataclass(frozen=True)
class Session:
    """What an open Blender knows that a .blend which it saved does not say; as it is, what a .blend says itself.

    scene is as `blender.scene.scene_key` has it, None the one that was active; devices are as `blender.devices` has
    them, None those of the worker's own preferences; output_path is the scene's, made absolute. scripts of the .blend
    run only when told to.
    """

    scene: tuple[str, str | None] | None = None
    devices: Mapping[str, Any] | None = None
    output_path: str | None = None
    scripts: bool = False


@dataclass(frozen=True)
class Job:
    """One run: the absolute paths of the .blend and of the output folder, how the pair is made, and what is done.

    files are those that the command (one of `worker.COMMANDS`) is to make, the one that vouches for the others last;
    without any, output may be None. only names the runs that a price list is to have; without any it has all.
    """

    blend: Path
    output: Path | None
    settings: StereoSettings
    command: str = "render"
    files: tuple[str, ...] = FILES
    only: tuple[str, ...] = ()
    session: Session = field(default_factory=Session)


class RunInterruptedError(StereoReprojectError):
    """A signal ended the run."""

    def __init__(self, signum: int) -> None:
        super().__init__(f"{_SIGNAL_WORDS.get(signum, 'stopped')}; no result was written")
        self.exit_status = 128 + signum


class Interrupts:
    """Holds back the signals that end a run until `check` is called, at a moment when nothing is half done."""

    def __init__(self) -> None:
        self._received: int | None = None
        self._previous: dict[int, Any] = {}

    def __enter__(self) -> Interrupts:
        if threading.current_thread() is not threading.main_thread():
            return self
        for signum in _SIGNALS:
            previous = signal.getsignal(signum)
            # Under nohup a run is meant to outlive its terminal.
            if previous == signal.SIG_IGN and signum != signal.SIGINT:
                continue
            self._previous[signum] = signal.SIG_DFL if previous is None else previous
            signal.signal(signum, self._receive)
        return self

    def __exit__(self, *_: object) -> None:
        for signum, previous in self._previous.items():
            signal.signal(signum, previous)

    def _receive(self, signum: int, _frame: FrameType | None) -> None:
        self._received = self._received or signum

    def check(self) -> None:
        """Raise RunInterruptedError if a signal has come."""
        if self._received is not None:
            raise RunInterruptedError(self._received)


def run_worker(
    job: Job,
    on_event: Callable[[Event], None],
    *,
    on_tick: Callable[[], None] = lambda: None,
    interrupts: Interrupts | None = None,
    command: Sequence[str] | None = None,
) -> dict[str, Any]:
    """Have `job` done by a worker process, move its files into the output folder, and return its report.

    on_event gets each "stage" and "warning" event; on_tick is called several times a second. `command` starts another
    worker than `python -m stereo_reproject.worker`. Raises BadInputError, RunInterruptedError or StereoReprojectError;
    then nothing of the run is left behind.
    """
    interrupts = interrupts or Interrupts()
    with _work_folder(job) as work:
        interrupts.check()
        with _start(command, work) as worker:
            worker.send(job)
            done = _listen(worker, on_event, on_tick, interrupts)
        report = done.get("report")
        if not isinstance(report, dict):
            raise StereoReprojectError("the worker ended without a report; this is a defect of stereo_reproject")
        if job.command == "render":
            check_report(report)
        if job.output is not None:
            check_complete(work / "out", done.get("files"), job.files)
            superseded = superseded_by(job.files) if job.command == "render" else ()
            publish(work, job.output, job.files, superseded=superseded, between_steps=interrupts.check)
    return report


@contextlib.contextmanager
def _work_folder(job: Job) -> Iterator[Path]:
    if job.output is not None:
        with work_folder(job.output, job.files) as work:
            yield work
        return
    # What leaves no files behind works where temporary files belong.
    with tempfile.TemporaryDirectory(prefix="stereo_reproject-") as parent, work_folder(Path(parent), ()) as work:
        yield work


def _worker_command() -> list[str]:
    # In an extension this package lies below Blender's own packages; the worker finds it by its folder.
    # Not from the folder in which it is started, where another package may have this name.
    return [sys.executable, "-P", "-m", f"{(__package__ or '').rpartition('.')[2]}.worker"]


def _start(command: Sequence[str] | None, work: Path) -> _Worker:
    try:
        return _Worker(command, work)
    except OSError as error:
        reason, program = error.strerror or str(error), (command or _worker_command())[0]
        raise StereoReprojectError(f"{program} could not be started ({reason}); free some resources") from error


class _Worker:
    """The worker process, with its whole process group."""

    def __init__(self, command: Sequence[str] | None, work: Path) -> None:
        own_python = command is None
        command = _worker_command() if command is None else command
        self.log = work / "blender.log"
        self._work = work
        self._lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        with self.log.open("ab") as log:
            # A group of its own: Ctrl-C on the terminal must reach this process alone.
            self.process = subprocess.Popen(
                list(command),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                env=_environment(work, own_python=own_python),
                start_new_session=os.name == "posix",
                creationflags=_CREATION_FLAGS,
            )
        threading.Thread(target=self._read, daemon=True).start()

    def __enter__(self) -> _Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()

    def send(self, job: Job) -> None:
        """Hand the job over. A worker that is dead already is found out by whoever listens."""
        message = {
            "command": job.command,
            "blend": str(job.blend),
            "output": None if job.output is None else str(job.output),
            "work": str(self._work),
            "files": list(job.files),
            "session": asdict(job.session),
            "settings": asdict(job.settings),
            "only": list(job.only),
        }
        assert self.process.stdin is not None
        with contextlib.suppress(OSError):
            self.process.stdin.write(json.dumps(message).encode() + b"\n")
            self.process.stdin.flush()

    def _read(self) -> None:
        # This thread alone closes the pipe: closing it elsewhere would wait for a read that is under way.
        assert self.process.stdout is not None
        with self.process.stdout as stdout:
            for line in stdout:
                self._lines.put(line)
        self._lines.put(b"")

    def next_line(self) -> bytes | None:
        """The next line of output; None if none comes within POLL_SECONDS, b"" if none can come any more."""
        ended = self.process.poll() is not None
        try:
            return self._lines.get(timeout=POLL_SECONDS)
        except queue.Empty:
            # A descendant of a dead worker may keep the pipe open.
            return b"" if ended else None

    def wait(self, seconds: float) -> int | None:
        """The exit status, or None if the worker still runs after `seconds`."""
        try:
            return self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            return None

    def kill(self) -> None:
        """End the worker and all that it started."""
        _kill_group(self.process)
        self.wait(EXIT_SECONDS)
        assert self.process.stdin is not None
        with contextlib.suppress(OSError):
            self.process.stdin.close()

    def last_words(self) -> str:
        """The last line in the log that is not empty."""
        with contextlib.suppress(OSError), self.log.open("rb") as log:
            log.seek(max(0, os.fstat(log.fileno()).st_size - LOG_TAIL_BYTES))
            lines = [line.strip() for line in log.read().decode("utf-8", "replace").splitlines()]
            return next((line for line in reversed(lines) if line), "")[:LAST_WORDS_LENGTH]
        return ""


def _environment(work: Path, *, own_python: bool) -> dict[str, str]:
    environment = dict(os.environ)
    if not own_python:
        # What the caller has set for its Python may be of no use to Blender's.
        for name in ("PYTHONPATH", "PYTHONHOME"):
            environment.pop(name, None)
    environment.update(dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(work / "tmp")))
    # The worker must find this very package, wherever the caller stands and however it came here, and in Blender the
    # libraries that an extension brings along.
    homes = [Path(__file__).resolve().parent.parent, *_folders_of(LIBRARIES)]
    installed = {Path(sysconfig.get_path(name)).resolve() for name in ("purelib", "platlib")}
    added = [str(home) for home in dict.fromkeys(homes) if home not in installed]
    if added:
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, (*added, environment.get("PYTHONPATH"))))
    return environment


def _folders_of(modules: Sequence[str]) -> Iterator[Path]:
    for name in modules:
        with contextlib.suppress(ImportError, ValueError):
            found = importlib.util.find_spec(name)
            if found is not None and found.origin is not None:
                place = Path(found.origin).resolve().parent
                yield place.parent if found.submodule_search_locations else place


def _kill_group(process: subprocess.Popen[bytes]) -> None:
    if sys.platform == "win32":
        if process.poll() is None:
            taskkill = ["taskkill", "/T", "/F", "/PID", str(process.pid)]
            with contextlib.suppress(OSError):
                subprocess.run(taskkill, capture_output=True, check=False)
            process.kill()
    else:
        # A group outlives its leader: what the worker started is ended even when the worker itself is dead.
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)


def _listen(
    worker: _Worker, on_event: Callable[[Event], None], on_tick: Callable[[], None], interrupts: Interrupts
) -> Event:
    """Pass the worker's events on until it is done and has ended; return its "done" event."""
    stage = "start"
    while True:
        interrupts.check()
        on_tick()
        line = worker.next_line()
        if line is None:
            continue
        if not line:
            raise StereoReprojectError(_crash_message(worker, stage))
        event = _parse(line)
        match event.get("event"):
            case "stage":
                stage = str(event.get("stage"))
                on_event(event)
            case "warning":
                on_event(event)
            case "error":
                kind = BadInputError if event.get("status") == BadInputError.exit_status else StereoReprojectError
                raise kind(str(event.get("message")))
            case "done":
                _await_exit(worker, on_tick, interrupts)
                return event


def _parse(line: bytes) -> Event:
    try:
        event = json.loads(line)
    except ValueError:
        return {}
    return event if isinstance(event, dict) else {}


def _await_exit(worker: _Worker, on_tick: Callable[[], None], interrupts: Interrupts) -> None:
    deadline = time.monotonic() + EXIT_SECONDS
    while worker.wait(POLL_SECONDS) is None and time.monotonic() < deadline:
        interrupts.check()
        on_tick()


def _crash_message(worker: _Worker, stage: str) -> str:
    status = worker.wait(EXIT_SECONDS)
    if status is None:
        how = "its output ended"
    elif status < 0:
        how = f"signal {-status}"
    else:
        how = f"exit status {status:#x}" if status > 255 else f"exit status {status}"
    message = f"Blender stopped unexpectedly ({how}) during {stage}"
    if os.name == "posix" and status == -signal.SIGKILL:
        message += ", perhaps for want of memory: try a smaller --size or free some"
    words = worker.last_words()
    return f"{message}; last words: {words}" if words else message
