"""The process that Blender runs in: started, listened to, and cleaned up after, in whatever way it ends.

Blender does not run in the process that the user talks to. So neither Ctrl-C nor a crash inside a render nor a hang at
exit can leave anything half-made: this process, which never imports bpy, kills the worker's whole process group,
removes the run's private folder, and only a complete result is moved into the output folder.

The worker (`python -m stereo_reproject.programs.worker`)
------------------------------------------------
stdin    one line of JSON: {"command": what to do, "blend", "output" (null without files), "work": absolute paths,
         "settings": StereoSettings as nested dicts, "files": those to be made, "only": names of runs, "session": a
         Session as a dict, "animation": AnimationSettings as a dict, or null,
         "views": ViewsSettings as a dict, or null, "strict": whether a warning that is known
         before the first render is an error, "pictures", "first_look": as in `Job`}.
         It then stays open for the whole run: at its end this process is gone, and the worker must end itself.
stdout   one JSON object per line:
           {"event": "stage", "stage": "fill", "detail": "optional text"}
           {"event": "warning", "message": "..."}
           {"event": "note", "message": "..."}
           {"event": "frame", "frame": 13, "seconds": 3.5, "saved": 2.5, "traced": 0.08, "done": 12, "total": 24,
            "each": 3.5, "remaining": 42.0}
           {"event": "picture", "view": "left", "file": "/absolute/path.exr"}
           {"event": "done", "report": {...}, "files": ["left.exr", ...]}
           {"event": "error", "status": 1 or 2, "message": "what, where, what to do, on one line",
            "words": what `words.to_data` returns of the message}
         Lines that are no such object are passed over.
stderr   work/blender.log, whose last line a crash is reported with, but for SIGKILL. As far as it counts the samples
         of a render ("Sample 3/16"), `on_event` gets the stage again, with its "fraction" from 0 to 1.
work     private to the run, and gone after it. Finished files are left in work/out; temporary ones belong in work/tmp,
         which the environment names as the folder for temporary files (TMPDIR, TEMP, TMP).

After "done" the worker has EXIT_SECONDS to end; how it ends then changes nothing.
"""

from __future__ import annotations

import contextlib
import json
import re
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ..errors import BadInputError, StereoReprojectError
from ..files import is_missing
from ..pipeline.stages import Stage
from ..settings.animation import AnimationSettings
from ..settings.frame import StereoSettings
from ..settings.views import ViewsSettings
from ..words import Words, from_data
from .interrupts import Interrupts, RunInterruptedError
from .plain_paths import STAND_INS, plain_blend
from .work_folder import (
    CUTOUTS,
    FILES,
    check_complete,
    publish,
    superseded_by,
    views_superseded_by,
    with_cutouts,
    work_folder,
)
from .worker_process import EXIT_SECONDS, POLL_SECONDS, Worker, crash_message, start_worker

Event = dict[str, Any]

FRAME = "frame "
"""Beginning of the detail of an animation's stages; the frame's number follows, and after a comma what of the frame is
rendered, where there is more than one part."""

_FRAME_DETAIL = re.compile(rf"{FRAME}(\d+)(?:, .*)?")


def frame_of(detail: str) -> int | None:
    """Return the number of the frame in the detail of a stage; None where it names none."""
    match = _FRAME_DETAIL.fullmatch(detail)
    return None if match is None else int(match[1])


VIEW = re.compile(r"view (\d+) of (\d+)")
"""Detail of the stages of many views, while one of them is made: its number from 1 on, and how many there are."""

HANDED_OVER = Stage.WRITE
"""The stage of an animation's frame that is another process's by now: whatever ends Blender then is not its doing."""


@dataclass(frozen=True)
class Session:
    """Facts about an open Blender that are not in the .blend it saved. The defaults mean: as the .blend itself has it.

    scene is a `blender.scene.working.scene_key`; None is the scene that was active. devices are those of
    `blender.scene.devices`; None means those of the worker's own preferences. original is the path of the file that the
    .blend is a copy of: files are written beside it; it is empty for a file that was never saved. scripts is True if
    scripts in the .blend may run. layers are the names of the view layers that the window renders.
    """

    scene: tuple[str, str | None] | None = None
    devices: Mapping[str, Any] | None = None
    original: str | None = None
    scripts: bool = False
    layers: tuple[str, ...] | None = None


@dataclass(frozen=True)
class Job:
    """One run of the worker: `command` is done with the .blend at the absolute path `blend`, by these settings, into
    the folder `output` (an absolute path).

    command is a key of `worker.COMMANDS`. files are the names of the files that it is to make; the last of them (the
    report) is moved into place last, so that where it stands the others are complete. Without files, output may be
    None. only names the cases of a price list that are wanted; empty means all. animation has the settings of an
    animation, of pairs or of many views, and views those of many views; each is None for any other command.

    pictures: True where the eyes are wanted as pictures while they are made, each announced by an event "picture" whose
    file is whole and lives as long as the run; first_look: True where the first of them is to have a single sample.

    With strict, anything that the scene is known to lack before the first render is an error, not a warning. It changes
    no picture, and so it is not one of the settings that decide whether a frame must be rendered again.
    """

    blend: Path
    output: Path | None
    settings: StereoSettings
    command: str = "render"
    files: tuple[str, ...] = FILES
    only: tuple[str, ...] = ()
    session: Session = field(default_factory=Session)
    animation: AnimationSettings | None = None
    strict: bool = False
    pictures: bool = False
    first_look: bool = False
    views: ViewsSettings | None = None


class WorkerCrashedError(StereoReprojectError):
    """The worker process ended without reporting a result or an error, as in a crash of Blender."""


def run_worker(
    job: Job,
    on_event: Callable[[Event], None],
    *,
    on_tick: Callable[[], None] = lambda: None,
    interrupts: Interrupts | None = None,
    command: Sequence[str] | None = None,
    waiting: Worker | None = None,
) -> dict[str, Any]:
    """Have `job` done by a worker process, move its files into the output folder, and return its report.

    on_event gets each event that the worker sends but the last (all above but "done" and "error"); on_tick is called
    several times a second. interrupts holds back signals meanwhile; by default none are. `command` starts another
    program as the worker; by default it is our own. `waiting` is a worker that was started before and has no job yet:
    it is taken in place of a new one. Raises BadInputError, RunInterruptedError or StereoReprojectError; then nothing
    that the run has made is left, but for the finished frames of an animation.
    """
    interrupts = interrupts or Interrupts()
    with _work_folder(job) as work, plain_blend(job.blend) as blend, interrupts.until_cleaning():
        interrupts.check()
        with waiting or start_worker(command, work) as worker, _told_when_gone(job, work):
            worker.send(_message(job, work, blend))
            done = _listen(worker, on_event, on_tick, interrupts, job=job, names=_known_names(work, blend))
        report = done.get("report")
        if not isinstance(report, dict):
            raise StereoReprojectError("the worker ended without a report; this is a defect of stereo_reproject")
        files = _files_made(job, done.get("files"))
        if job.output is not None:
            check_complete(work / "out", done.get("files"), files)
            superseded = _superseded(job, job.output, files)
            publish(work, job.output, files, superseded=superseded, between_steps=interrupts.check)
    return report


def _files_made(job: Job, names: Any) -> tuple[str, ...]:
    """Return the names of the files that the job's result consists of, the report last. names is the list that the
    worker reported (which may be anything)."""
    made = [str(name) for name in names] if isinstance(names, list) else []
    if job.animation is not None:
        return tuple(made)
    if job.command == "views":
        # Only what was rendered tells the quilt's name.
        return (*(name for name in made if name not in job.files), *job.files)
    # And only that tells whether there are cut-outs.
    return with_cutouts(job.files, cutouts=job.command == "render" and CUTOUTS in made)


def _superseded(job: Job, output: Path, files: Sequence[str]) -> tuple[str, ...]:
    """Return the names of files in the folder `output` that an earlier run of the job's kind left there, and that do
    not belong to those of its result."""
    if job.command == "views" and job.animation is None:
        return views_superseded_by(output, files)
    return superseded_by(files) if job.command == "render" else ()


@contextlib.contextmanager
def _work_folder(job: Job) -> Iterator[Path]:
    """Yield the run's private folder, for the time of a `with` block: inside the output folder, or among temporary
    files for a job that writes none. It is removed afterwards, also after an error."""
    if job.output is not None:
        with work_folder(job.output, job.files) as work:
            yield work
        return
    # What leaves no files behind works where temporary files belong.
    with work_folder(Path(tempfile.gettempdir()), ()) as work:
        yield work


@contextlib.contextmanager
def _told_when_gone(job: Job, work: Path) -> Iterator[None]:
    """Replace errors raised in a `with` block by one that says that the run's folder was removed, if it was. Signals
    and the errors of an animation, which says so itself, are left as they are."""
    try:
        yield
    except RunInterruptedError:
        raise
    except StereoReprojectError as error:
        # Blender makes folders that are missing, but not this file.
        if job.animation is not None or not is_missing(work / "pid"):
            raise
        folder = tempfile.gettempdir() if job.output is None else job.output
        raise BadInputError(
            Words("what the run had in {folder} was removed under way; run it again", folder=folder)
        ) from error


def _known_names(work: Path, blend: Path) -> dict[bytes, bytes]:
    """Return the stand-in paths (see `plain_path`) that may occur in the worker's messages, each with the real path
    that the user knows. Both are bytes as they are written inside a JSON string."""
    plain = {str(folder): str(folder.resolve()) for folder in (work, blend.parent)}
    return {_json_text(name): _json_text(known) for name, known in plain.items() if name.startswith(STAND_INS)}


def _json_text(text: str) -> bytes:
    """Return `text` as bytes as it is written inside a JSON string, without the quotes."""
    return json.dumps(text)[1:-1].encode()


def _message(job: Job, work: Path, blend: Path) -> bytes:
    """Return the line of JSON by which the worker is told its job. `work` is the run's private folder; `blend` is the
    path by which Blender finds the job's file, see `plain_blend`."""
    fields = {
        "command": job.command,
        "blend": str(blend),
        "output": None if job.output is None else str(job.output),
        "work": str(work),
        "settings": asdict(job.settings),
        "files": list(job.files),
        "only": list(job.only),
        "session": asdict(job.session),
        "animation": None if job.animation is None else asdict(job.animation),
        "views": None if job.views is None else asdict(job.views),
        "strict": job.strict,
        "pictures": job.pictures,
        "first_look": job.first_look,
    }
    return json.dumps(fields).encode() + b"\n"


def _kept_by(job: Job) -> str:
    """Return in words what is left in the output folder after a failed run; "" for a job that writes no files."""
    if job.animation is not None:
        return "frames that are finished are kept"
    return "" if job.output is None else "nothing was written, and existing files are kept"


def _listen(
    worker: Worker,
    on_event: Callable[[Event], None],
    on_tick: Callable[[], None],
    interrupts: Interrupts,
    *,
    job: Job,
    names: Mapping[bytes, bytes],
) -> Event:
    """Pass the worker's events on to on_event until it is done and has ended, and return its "done" event.

    Also reports the running stage again, with its fraction, as the samples in Blender's log go on. names are those of
    `_known_names`. Raises WorkerCrashedError where the worker ends without an answer, the worker's own error where it
    sends one, and RunInterruptedError.
    """
    stage: Event = {"event": "stage", "stage": Stage.START, "fraction": None}
    while True:
        interrupts.check()
        on_tick()
        line = worker.next_line()
        if line is None:
            fraction = worker.samples_done()
            if fraction not in (None, stage["fraction"]):
                stage = {**stage, "fraction": fraction}
                on_event(stage)
            continue
        if not line:
            raise WorkerCrashedError(crash_message(worker, str(stage["stage"]), kept=_kept_by(job)))
        event = _parse(line, names)
        match event.get("event"):
            case "stage":
                stage = {"stage": "", "fraction": None, **event}
                worker.begin_stage()
                on_event(stage)
            case "warning" | "note" | "frame" | "picture":
                worker.trim_log()
                on_event(event)
            case "error":
                kind = BadInputError if event.get("status") == BadInputError.exit_status else StereoReprojectError
                raise kind(from_data(str(event.get("message")), event.get("words")))
            case "done":
                _await_exit(worker, on_tick, interrupts)
                return event


def _parse(line: bytes, names: Mapping[bytes, bytes]) -> Event:
    """Return the event in one line of the worker's output, with real paths in place of stand-ins (`names`, see
    `_known_names`); {} for a line that is no event."""
    for name, known in names.items():
        line = line.replace(name, known)
    try:
        event = json.loads(line)
    except ValueError:
        return {}
    return event if isinstance(event, dict) else {}


def _await_exit(worker: Worker, on_tick: Callable[[], None], interrupts: Interrupts) -> None:
    """Wait until the worker that is done has ended, for EXIT_SECONDS at most. Raises RunInterruptedError."""
    deadline = time.monotonic() + EXIT_SECONDS
    while worker.wait(POLL_SECONDS) is None and time.monotonic() < deadline:
        interrupts.check()
        on_tick()
