"""The process that runs Blender: takes one job on standard input, and answers with events, one JSON line each.

It stands apart from the command line so that an interrupt, a crash or Blender's own output never reaches the user as
anything but one line. See `supervisor` for the other side.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..errors import in_one_line
from ..files import strict
from ..jobs.shown_pictures import PictureFiles
from ..jobs.warn_once import WarnOnce
from ..pipeline.onlooker import Onlooker
from ..pipeline.stages import Stage
from ..settings.animation import AnimationSettings
from ..settings.frame import SceneOverrides, StereoSettings
from ..settings.views import ViewsSettings
from ..words import to_data

Emit = Callable[..., None]


def main() -> None:
    """Read a job from standard input, do it, and end the process. Errors are reported as an event of one line."""
    emit = _open_events()
    status = 0
    try:
        _import_most()
        # As bytes: PYTHONIOENCODING may name an encoding in which a line does not even end.
        line = sys.stdin.buffer.readline()
        if not line:
            # The parent process has ended, or needs no worker any more.
            os._exit(0)
        threading.Thread(target=_end_with_parent, daemon=True).start()
        run_job(json.loads(line), emit)
    except Exception as error:  # noqa: BLE001 - whatever goes wrong is reported in one line
        failure = in_one_line(error)
        status = failure.exit_status
        emit("error", status=status, message=str(failure), words=to_data(str(failure)))
    # Blender's own clean-up at exit takes its time, and 4.5 may not come to an end at all.
    os._exit(status)


def _open_events() -> Emit:
    """Return the function that writes an event to the original standard output. From then on, all else that is printed
    goes to standard error, which is Blender's log."""
    stream = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)

    def emit(event: str, **fields: Any) -> None:
        # As in report.json: what is no number is null, for a window too.
        stream.write(json.dumps(strict({"event": event, **fields}), allow_nan=False) + "\n")
        stream.flush()

    return emit


def _import_most() -> None:
    """Import what nearly all jobs need: a worker that waits for its job has then done it."""
    from ..blender.commands import frame  # noqa: F401 - for later imports


def _end_with_parent() -> None:
    """End this process when standard input ends: the parent process keeps it open as long as it lives. Runs in a thread
    of its own."""
    while sys.stdin.buffer.read(1):
        pass
    os._exit(1)


def run_job(job: dict[str, Any], emit: Emit) -> None:
    """Do the job, a dict as described in `supervisor`, and report its progress and its result by `emit`. Raises the
    errors of the command."""
    COMMANDS[job["command"]](job, emit)


def _render(job: dict[str, Any], emit: Emit) -> None:
    """Render the pair of one frame into work/out, and report it."""
    from ..blender.commands.frame import render_files

    work, warn = Path(job["work"]), _warning_of(emit)
    scene, loaded = _open(job, emit, warn)
    report, files = render_files(
        scene,
        _settings(job["settings"]),
        work,
        files=job["files"],
        load_seconds=loaded,
        onlooker=_onlooker(job, emit),
    )
    _finish(report, files, emit, warn)


def _animate(job: dict[str, Any], emit: Emit) -> None:
    """Render the pairs of many frames into files of the scene's own format, and report them. In the events of stages,
    the detail names the frame."""
    from ..blender.commands.animation import render_animation_files

    warn = _warning_of(emit)
    scene, _ = _open(job, emit, warn)
    report = render_animation_files(
        scene,
        _settings(job["settings"]),
        _animation(job["animation"]),
        _saved(job),
        files=job["files"],
        listener=_listener(job, emit, warn),
    )
    # Without a frame of its own to render, a run leaves none.
    emit("done", report=report, files=job["files"] if report["last"] is not None else [])


def _saved(job: dict[str, Any]) -> Any:
    """Return the `SavedScene` of an animation's job."""
    from ..blender.commands.animation import SavedScene
    from ..jobs.supervisor import Session

    return SavedScene(Path(job["blend"]), Session(**job["session"]), Path(job["work"]))


def _listener(job: dict[str, Any], emit: Emit, warn: Callable[[str], None]) -> Any:
    """Return the `Listener` that emits what an animation of the job reports; `warn` gets its warnings."""
    from ..sequence.progress import Listener

    return Listener(
        _on_stage(emit),
        lambda event: emit("frame", **event),
        lambda text: emit("note", message=text),
        warn,
        _onlooker(job, emit),
    )


def _views(job: dict[str, Any], emit: Emit) -> None:
    """Render many views of one frame into work/out, with the quilt and what shows them, and report them; or those of
    many frames, as `_animate` does pairs."""
    if job["animation"] is not None:
        _animate_views(job, emit)
        return
    from ..blender.commands.views import render_views_files
    from ..blender.output.quilt_files import display_pixels

    work, warn = Path(job["work"]), _warning_of(emit)
    settings, views = _settings(job["settings"]), ViewsSettings(**job["views"])
    scene, loaded = _open(job, emit, warn)
    with display_pixels(scene, views.aspect, settings.scene.size):
        report, files = render_views_files(
            scene, settings, views, work, load_seconds=loaded, onlooker=_onlooker(job, emit), warn=warn
        )
    _finish(report, files, emit, warn)


def _animate_views(job: dict[str, Any], emit: Emit) -> None:
    """Render many views of many frames into quilts, and report them."""
    from ..blender.commands.animation import render_frames_of
    from ..blender.commands.frame_kinds import Quilts

    warn = _warning_of(emit)
    scene, _ = _open(job, emit, warn)
    kind = Quilts(_settings(job["settings"]), ViewsSettings(**job["views"]))
    saved, listener = _saved(job), _listener(job, emit, warn)
    report = render_frames_of(kind, scene, _animation(job["animation"]), saved, listener=listener)
    emit("done", report=report, files=[])


def _tradeoff(job: dict[str, Any], emit: Emit) -> None:
    """Measure the cases of a price list on one frame, and report them. In the events of stages, the stage is the case
    and the detail the stage of its render."""
    from ..report.chart_canvas import check_charts

    check_charts()
    from ..blender.commands.price_list import render_prices

    work, warn = Path(job["work"]), _warning_of(emit)
    scene, _ = _open(job, emit, warn)
    settings, only = _settings(job["settings"]), job["only"]
    prices, files = render_prices(scene, settings, work, only=only, on_stage=_on_stage(emit))
    _finish(prices, files, emit, warn)


def _inspect(job: dict[str, Any], emit: Emit, *, sketch: bool = True) -> None:
    """Report which effects the scene calls for and what its pair will cost. Without `sketch` nothing is rendered, and
    no cost is predicted."""
    from ..blender.commands.inspection import inspect_scene

    work, warn = Path(job["work"]), _warning_of(emit)
    scene, _ = _open(job, emit, warn)
    inspection = inspect_scene(scene, _settings(job["settings"]), work, sketch=sketch, on_stage=_on_stage(emit))
    _finish(inspection, [], emit, warn)


def _plan(job: dict[str, Any], emit: Emit) -> None:
    """Report which effects the scene calls for, without rendering and so without a predicted cost."""
    _inspect(job, emit, sketch=False)


COMMANDS: dict[str, Callable[[dict[str, Any], Emit], None]] = {
    "render": _render,
    "animate": _animate,
    "views": _views,
    "tradeoff": _tradeoff,
    "inspect": _inspect,
    "plan": _plan,
}


def _open(job: dict[str, Any], emit: Emit, warn: Callable[[str], None]) -> tuple[Any, float]:
    """Open the job's .blend and return its scene and the seconds that loading took. Before that is returned, `warn`
    gets what the scene lacks; with the job's "strict" that is raised as an error."""
    from ..blender.output.opening import open_session
    from ..blender.scene.warnings import warnings_ahead
    from ..jobs.supervisor import Session

    start = time.perf_counter()
    emit("stage", stage=Stage.LOAD)
    scene = open_session(Path(job["blend"]), Session(**job["session"]))
    loaded = time.perf_counter() - start
    overrides = _settings(job["settings"]).scene
    if job["animation"] is not None:
        overrides = replace(overrides, frame=(job["animation"]["frames"] or [scene.frame_start])[0])
    for warning in warnings_ahead(scene, overrides, strict=job["strict"]):
        warn(warning)
    return scene, loaded


def _warning_of(emit: Emit) -> WarnOnce:
    """Return a function that emits each warning text once, because those found before the first render come again in
    the final report."""
    return WarnOnce(lambda text: emit("warning", message=text))


def _onlooker(job: dict[str, Any], emit: Emit) -> Onlooker:
    """Return who is told the stages by `emit`, and shown the eyes as files where the job asks for pictures."""
    show = PictureFiles(Path(job["work"]), emit).show if job["pictures"] else None
    return Onlooker(_on_stage(emit), show, job["first_look"])


def _finish(report: dict[str, Any], files: list[str], emit: Emit, warn: Callable[[str], None]) -> None:
    """Emit the report's warnings and then the event that the job is done; `files` are the names of the files in
    work/out."""
    for warning in report.get("warnings", ()):
        warn(warning)
    emit("done", report=report, files=files)


def _settings(fields: dict[str, Any]) -> StereoSettings:
    """Return the settings of a pair from the dict that the job has of them. JSON has lists where the settings need
    tuples."""
    scene = dict(fields["scene"])
    if scene.get("size") is not None:
        scene["size"] = tuple(scene["size"])
    return StereoSettings(**{**fields, "scene": SceneOverrides(**scene)})


def _animation(fields: dict[str, Any]) -> AnimationSettings:
    """Return the settings of an animation from the dict that the job has of them, with the types that JSON cannot
    keep."""
    frames, skip = fields["frames"], fields["skip"]
    as_they_were = {
        "frames": None if frames is None else tuple(frames),
        "skip": {int(frame): why for frame, why in skip.items()},
        "finished": tuple(fields["finished"]),
    }
    return AnimationSettings(**{**fields, **as_they_were})


def _on_stage(emit: Emit) -> Callable[..., None]:
    """Return a function that emits the event of a stage as it begins; it takes the stage's name and an optional detail.

    The other process reads from Blender's log how many samples are rendered. Nothing in this process may do so while
    Blender renders: a Python handler for render statistics stops 5.2 for good. And in 4.5, whose operators test if
    Python's lock is taken but not by whom, another thread that runs just then ends the process (signal 11).
    """

    def on_stage(name: str, detail: str = "") -> None:
        emit("stage", stage=name, detail=detail)

    return on_stage


if __name__ == "__main__":
    main()
