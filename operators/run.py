"""A run in a process of its own, while Blender's window stays alive: started, asked how far it is, cancelled."""

from __future__ import annotations

import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import Any, ClassVar

import bpy

from ..stereo_reproject.blender.commands.processes import UNSAVED, save_copy
from ..stereo_reproject.blender.scene.devices import devices_in_use
from ..stereo_reproject.blender.scene.rendered import layers_to_render
from ..stereo_reproject.blender.scene.working import scene_key
from ..stereo_reproject.errors import BadInputError, StereoReprojectError
from ..stereo_reproject.images.exr import VIEWS
from ..stereo_reproject.jobs.frames_progress import FramesProgress
from ..stereo_reproject.jobs.progress import Progress
from ..stereo_reproject.jobs.supervisor import Event, Interrupts, Job, RunInterruptedError, Session, run_worker
from ..stereo_reproject.jobs.views_progress import ViewsProgress
from ..stereo_reproject.jobs.work_folder import work_folder
from ..stereo_reproject.pipeline.stages import Stage
from ..stereo_reproject.sequence.supervisor import run_animation
from ..stereo_reproject.settings.frame import StereoSettings
from ..stereo_reproject.settings.views import ViewsSettings
from ..stereo_reproject.words import Words
from . import second_blender
from .animation_run import Animation
from .preferences import temporary_folder

POLL_SECONDS = 0.1

THREAD_NAME = "Stereo Reproject job"
"""Name of the thread that waits for a job's process."""

EYES = tuple(f"{view}.exr" for view in VIEWS)


class Pictures(Enum):
    """Pictures of the eyes that a window wants while they are made."""

    NONE = 0
    AS_THEY_ARE_MADE = 1
    FROM_THE_FIRST_SAMPLE = 2
    """The source with a single sample too, before it is rendered whole."""


class _Cancel(Interrupts):
    """Interrupts of a run that another thread can cause, where Ctrl C would do so in the main thread."""

    def cancel(self) -> None:
        """Have the run end as soon as it looks for an interrupt."""
        self._received = signal.SIGINT

    @property
    def asked(self) -> bool:
        """True once the run was asked to end."""
        return self._received is not None


class BackgroundJob:
    """A job on a copy of the open file, in a process of its own. It starts when the object is made; a thread waits for
    it.

    Once `finished` is true, either `report` has the result or `error` the reason for failure, and the files are in
    `folder`. `close` ends the job if need be, and removes the files. `layers` are the names of the scene's view layers
    at the start; `name` is the open file's name without extension, `beside` its folder (None if it was never saved).
    """

    stage_words: ClassVar[Mapping[str, str]] = {}
    """Words for the user of stages, by their names, that are others in this job than usual."""
    views: ViewsSettings | None = None
    """Settings of many views, of a job that renders these; None of any other."""
    output: Path | None = None
    """Folder of files that stay; None for a job whose files go when it is closed."""

    def __init__(
        self,
        scene: bpy.types.Scene,
        settings: StereoSettings,
        command: str,
        files: Sequence[str],
        progress: Progress | FramesProgress | ViewsProgress,
        *,
        animation: Animation | None = None,
        pictures: Pictures = Pictures.NONE,
    ) -> None:
        """animation is None for a single picture. pictures says which are wanted while the eyes are made."""
        _check_saved(scene)
        self.uid = scene.session_uid
        self.scene_name = scene.name
        self.layers = [layer.name for layer in scene.view_layers]
        opened = Path(bpy.data.filepath)
        self.name = opened.stem or "untitled"
        self.beside = opened.parent if bpy.data.filepath else None
        self.settings = settings
        self.stage, self.detail = str(Stage.START), ""
        self.progress = progress
        self.report: dict[str, Any] | None = None
        self.error: StereoReprojectError | None = None
        # Made like the folders of all runs: what a Blender that was killed left behind, the next one removes.
        self.temporary = temporary_folder()
        """Folder of temporary files when the run started."""
        second = second_blender.take()
        self._worker = None if second is None else second.worker
        self._place = work_folder(self.temporary, ()) if second is None else second.place
        self._files = self._place.__enter__() if second is None else second.folder
        self.animation = animation
        self.frames_finished = 0
        """Number of frames that this job has finished so far."""
        self.picture: Event | None = None
        """Last event "picture": an eye as it is so far; None before the first."""
        self.savings: list[float] = []
        """Seconds that each frame of an animation has saved that this job has finished so far."""
        self._closed = False
        self._cancel = _Cancel()
        self._lock = threading.Lock()
        self.looks = 0
        """Number of times that the window has looked how far the job is."""
        try:
            self._blend, self.warnings = _saved_copy(self._files)
            job = _job_of(self, self._blend, scene, command, files, pictures)
            work = job, second_blender.worker_command()
            self._thread = threading.Thread(target=self._work, name=THREAD_NAME, args=work, daemon=True)
            self._thread.start()
        except BaseException:
            self._end_worker()
            self._place.__exit__(None, None, None)
            raise

    @property
    def folder(self) -> Path:
        """Folder of the files that the job makes."""
        return self._files / "result"

    @property
    def holds_pair(self) -> bool:
        """True if the eyes of a finished pair are in `folder` and nowhere else. Of an animation it is False: its frames
        are in files of their own.
        """
        is_pair = self.animation is None and self.report is not None
        return is_pair and all((self.folder / name).exists() for name in EYES)

    @property
    def finished(self) -> bool:
        """True once the job is over, whether it has succeeded, failed or been cancelled."""
        return not self._thread.is_alive()

    @property
    def cancelled(self) -> bool:
        """True if the job ended because it was cancelled."""
        return isinstance(self.error, RunInterruptedError)

    @property
    def is_ending(self) -> bool:
        """True from the moment at which the job was asked to end before it was over."""
        return self._cancel.asked

    def far(self) -> tuple[float, float | None]:
        """Return how much of the job is done, from 0 to 1, and the seconds that remain (None if unknown)."""
        now = time.monotonic()
        with self._lock:
            return self.progress.fraction(now), self.progress.remaining(now)

    def cancel(self) -> None:
        """Ask the job to end, and return at once; it ends a little later."""
        self._cancel.cancel()

    def wait(self, tick: Callable[[], None] = lambda: None) -> None:
        """Block until the job is over, calling `tick` again and again meanwhile."""
        while not self.finished:
            tick()
            self._thread.join(POLL_SECONDS)

    def close(self) -> None:
        """End the job if it still runs, wait until it has ended, and remove its files. A second call does nothing."""
        if self._closed:
            return
        self._closed = True
        self.cancel()
        self._thread.join()
        self._place.__exit__(None, None, None)
        if self.animation is not None:
            self.animation.clean_up()

    def _work(self, job: Job, command: Sequence[str] | None) -> None:
        """Run the job's process to its end, and set `report` or `error`. This is all that the job's thread does."""
        try:
            run = run_worker if job.animation is None else run_animation
            self.report = run(job, self._on_event, interrupts=self._cancel, command=command, waiting=self._worker)
        except StereoReprojectError as error:
            self.error = error
        except Exception as error:  # noqa: BLE001 - nobody else hears of what goes wrong in a thread
            traceback.print_exc()
            self.error = StereoReprojectError(
                Words("a defect of stereo_reproject: {kind}: {reason}", kind=type(error).__name__, reason=str(error))
            )
        finally:
            self._end_worker()
            if self.animation is not None:
                # Of the last frames, a run that ends early tells nothing.
                self.frames_finished = max(self.frames_finished, len(self.animation.newly_recorded()))
            self._blend.unlink(missing_ok=True)

    def _end_worker(self) -> None:
        """End the worker that waited for this job, if one did, whether it was used or not."""
        if self._worker is not None:
            self._worker.kill()

    def _on_event(self, event: Event) -> None:
        """Take in what the job's process tells under way: a warning, a picture, a stage, or an animation's progress."""
        if event["event"] == "warning":
            self.warnings.append(str(event.get("message")))
            return
        if event["event"] == "picture":
            self.picture = event
            return
        if event["event"] == "frame":
            with self._lock:
                if isinstance(self.progress, FramesProgress):
                    self.progress.finish(event)
                self.frames_finished += 1
                if event.get("saved") is not None:
                    self.savings.append(event["saved"])
            return
        if event["event"] != "stage":
            return
        now = time.monotonic()
        with self._lock:
            self.stage, self.detail = str(event.get("stage")), str(event.get("detail") or "")
            self.progress.begin(self.stage, now, self.detail)
            self.progress.advance(event.get("fraction"), now)


def _job_of(
    run: BackgroundJob, blend: Path, scene: bpy.types.Scene, command: str, files: Sequence[str], pictures: Pictures
) -> Job:
    """Return the job for a run's worker process, on the copy of the open file at the path `blend`; the other parameters
    are those of `BackgroundJob`.
    """
    return Job(
        blend,
        run.output or (run.folder if files else None),
        run.settings,
        command,
        tuple(files),
        session=_session_of(scene),
        animation=None if run.animation is None else run.animation.settings,
        views=run.views,
        pictures=pictures is not Pictures.NONE,
        first_look=pictures is Pictures.FROM_THE_FIRST_SAMPLE,
    )


def _check_saved(scene: bpy.types.Scene) -> None:
    """Raise BadInputError unless a scene will be in a copy of the open file."""
    if not scene.users:
        message = "scene {scene} is shown in no window, and would not be saved with the file"
        raise BadInputError(Words(message, scene=repr(scene.name)))


def job_has_thread() -> bool:
    """Return whether the thread of a job is alive: no operator may then run under an override of its context, see
    `zoom_to_fit` in `pictures`.
    """
    return any(thread.name == THREAD_NAME for thread in threading.enumerate())


def other_windows(context: bpy.types.Context) -> list[bpy.types.Window]:
    """Return the windows, besides the context's, in which an operator can be started that listens there; none while a
    job has its thread, see `job_has_thread`.
    """
    if job_has_thread():
        return []
    return [window for window in context.window_manager.windows if window != context.window]


def _session_of(scene: bpy.types.Scene) -> Session:
    """Return what this Blender knows of a scene that is not in the copy of its file."""
    return Session(
        scene_key(scene),
        devices_in_use(),
        bpy.data.filepath,
        scene.stereo_reproject.use_scripts,
        tuple(layers_to_render(scene)),
    )


def _saved_copy(folder: Path) -> tuple[Path, list[str]]:
    """Save the open file, unsaved changes included, in a folder; return the copy's path and warnings. Files that it
    refers to are found from there too; where baked simulations are not, there is a warning.
    """
    blend, warnings = folder / (Path(bpy.data.filepath).name or UNSAVED), []
    if bpy.data.filepath:
        caches = Path(bpy.data.filepath).with_name(f"blendcache_{blend.stem}")
        if caches.is_dir() and not link_folder(caches, blend.with_name(caches.name)):
            message = "baked simulations in {folder} are not found from where the copy is rendered"
            warnings.append(Words(message, folder=caches))
    save_copy(folder)
    return blend, warnings


def link_folder(folder: Path, link: Path) -> bool:
    """Make `folder` reachable under the path `link` too; return False where that cannot be, since some drives have no
    links. Blender looks for baked simulations beside the .blend, in a folder named after it.
    """
    try:
        if sys.platform == "win32":
            # A symbolic link would need rights that few people have.
            import _winapi

            _winapi.CreateJunction(str(folder), str(link))
        else:
            link.symlink_to(folder, target_is_directory=True)
        return link.is_dir()
    except OSError:
        return False


def seconds_of(report: Mapping[str, Any], stages: Mapping[str, float]) -> dict[str, float]:
    """Return the seconds that each of `stages` (its keys) took, by the report of a finished run; 0 for one that it
    lacks.
    """
    return {stage: report["seconds"].get(stage, 0.0) for stage in stages}
