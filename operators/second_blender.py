"""A second Blender that is started as soon as the render buttons are seen, before there is a job for it: its start is
over when the user clicks.

At most one waits at a time. It has read no file and renders nothing; it ends with this Blender, or with its job.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import bpy

from ..stereo_reproject.blender.commands.processes import module_in_blender
from ..stereo_reproject.errors import StereoReprojectError
from ..stereo_reproject.jobs.work_folder import work_folder
from ..stereo_reproject.jobs.worker_process import Worker, start_worker
from .preferences import preferred, temporary_folder

START_SECONDS = 0.5
"""Seconds from the moment the buttons are first seen until the second Blender is started: the window is drawn first."""

BUSY_SECONDS = 2.0
"""Seconds until the next try, while Blender renders."""


@dataclass(frozen=True)
class SecondBlender:
    """A worker that waits for its job, with the private folder in which it was started.

    `place` removes the folder when it is left. `temporary` is the folder of temporary files in which it lies, and
    `command` is what started the worker (None: this package's own command).
    """

    place: AbstractContextManager[Path]
    folder: Path
    worker: Worker
    temporary: Path
    command: Sequence[str] | None

    def is_up_to_date(self) -> bool:
        """Return whether it is what would be started now: the process lives, and neither the folder of temporary files
        nor what Blender is started with has changed.
        """
        same = self.temporary == temporary_folder() and self.command == worker_command()
        return same and self.folder.is_dir() and self.worker.is_as_started_now()

    def end(self) -> None:
        """End the process and remove its folder."""
        self.worker.kill()
        self.place.__exit__(None, None, None)


_waiting: list[SecondBlender] = []
"""The one that waits, if any."""

_failed: list[tuple[Path, Sequence[str] | None]] = []
"""Folder of temporary files and command of the last one that could not be started, if it was the last."""


def worker_command() -> Sequence[str] | None:
    """Return the command that starts a worker in this very Blender, see `module_in_blender`."""
    return module_in_blender("programs.worker")


def keep_ready() -> None:
    """Have a second Blender started soon, unless one waits or the preferences forbid it. It is called as the buttons
    are drawn; without a window nothing is started.
    """
    if _waiting or bpy.app.background or bpy.app.timers.is_registered(_start_soon) or not preferred("keep_ready"):
        return
    if (temporary_folder(), worker_command()) not in _failed:
        bpy.app.timers.register(_start_soon, first_interval=START_SECONDS)


def _start_soon() -> float | None:
    """Start the second Blender from a timer; while Blender renders or a job runs, return the seconds until the next
    try.
    """
    from .jobs import running

    if bpy.app.is_job_running("RENDER") or running() is not None:
        return BUSY_SECONDS
    if not _waiting and preferred("keep_ready"):
        start()
    return None


def start() -> None:
    """Start a second Blender that waits. Where that fails nothing is said: the next job starts its own, and tells why
    it cannot.
    """
    temporary, command = temporary_folder(), worker_command()
    _failed[:] = [(temporary, command)]
    place = work_folder(temporary, ())
    try:
        folder = place.__enter__()
    except StereoReprojectError:
        return
    try:
        worker = start_worker(command, folder)
    except StereoReprojectError:
        place.__exit__(None, None, None)
        return
    _failed.clear()
    _waiting.append(SecondBlender(place, folder, worker, temporary, command))


def take() -> SecondBlender | None:
    """Return the second Blender that waits, which is the caller's from now on; None where there is none that could be
    used.
    """
    if not _waiting:
        return None
    second = _waiting.pop()
    if second.is_up_to_date():
        return second
    second.end()
    return None


def end_waiting() -> None:
    """End the second Blender that waits or is to be started, if any."""
    if bpy.app.timers.is_registered(_start_soon):
        bpy.app.timers.unregister(_start_soon)
    while _waiting:
        _waiting.pop().end()
