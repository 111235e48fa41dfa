"""Errors in writing an animation's files, in one line for the user: a folder that is gone, a full disk, or another."""

from __future__ import annotations

import contextlib
import os
import shutil
import stat
import sys
import time
from pathlib import Path

from ..errors import OutputError, StereoReprojectError
from ..jobs.work_folder import is_full_disk_error
from ..words import Words
from .journal_folder import journal_path

KEPT = "finished frames are kept, and --resume renders the rest"
"""Outcome of an animation that ends early, in words."""

REMOVAL_SECONDS = 0.5
"""Time that somebody may need to remove a folder of frames."""

FULL_DISK_BYTES = 1 << 20
"""Free bytes on a drive below which it counts as full."""

FULL_DISK_FILES = 32
"""Files for which a drive has room, below which it counts as full: two frames of half a dozen files are in the making
at a time."""


def failed_output(folder: Path, error: OSError | StereoReprojectError) -> OutputError:
    """Return the error for the user after a failed write below a folder of frames: that the folder is gone, that the
    disk is full, or the reason in `error`."""
    if _is_gone(folder, error):
        return OutputError(Words("{folder} is gone, with the frames that were in it", folder=folder))
    if _is_full(folder, error):
        return OutputError(
            Words("{folder}: the disk is full; free some space: {kept}", folder=folder, kept=Words(KEPT))
        )
    reason = error.strerror or str(error) if isinstance(error, OSError) else str(error)
    return OutputError(
        Words("{folder} cannot be written ({reason}): {kept}", folder=folder, reason=reason, kept=Words(KEPT))
    )


def blamed_on_output(folder: Path, error: StereoReprojectError) -> StereoReprojectError:
    """Return `error` itself, or in its place one that says that the folder is gone or its disk full, if that is so:
    Blender's own errors do not say it."""
    if isinstance(error, OutputError) or not (_is_gone(folder, error) or _is_full(folder, error)):
        return error
    return failed_output(folder, error)


def _is_gone(folder: Path, error: Exception) -> bool:
    """Return True if the error comes from the removal of the folder of frames: its journal is gone. May wait
    REMOVAL_SECONDS, because the removal may be under way."""
    # Blender makes folders that are missing on the way to its files; the journal is made by nobody else.
    there = _is_folder(journal_path(folder))
    if there and isinstance(error, (FileNotFoundError, NotADirectoryError)):
        # Whoever removes it may be at it just now, and its files go first.
        time.sleep(REMOVAL_SECONDS)
        there = _is_folder(journal_path(folder))
    return not there and isinstance(error, (FileNotFoundError, NotADirectoryError, StereoReprojectError))


def _is_folder(path: Path) -> bool:
    """Return True if a folder is at this path, or if that cannot be found out, as for lack of permission."""
    try:
        return stat.S_ISDIR(path.stat().st_mode)
    except OSError as error:
        # What may not be looked at any more is not gone.
        return not isinstance(error, (FileNotFoundError, NotADirectoryError))


def _is_full(folder: Path, error: Exception) -> bool:
    """Return True if the error says that the disk is full, or if the folder's drive is full."""
    return (isinstance(error, OSError) and is_full_disk_error(error)) or is_full(folder)


def is_full(folder: Path, *, below: int = FULL_DISK_BYTES) -> bool:
    """Return True if a folder's drive is full: fewer than `below` bytes are free, or room for fewer than
    FULL_DISK_FILES files. False where that is not known."""
    with contextlib.suppress(OSError):
        return shutil.disk_usage(folder).free < below or _has_no_names(folder)
    return False


def _has_no_names(folder: Path) -> bool:
    """Return True if a folder's drive has room for fewer than FULL_DISK_FILES more files; False where it has no such
    limit."""
    # Windows does not count them, and some drives have no limit.
    if sys.platform == "win32":
        return False
    drive = os.statvfs(folder)
    return drive.f_files > 0 and drive.f_favail < FULL_DISK_FILES
