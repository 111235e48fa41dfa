"""The run's private folder, inside the output folder: made, cleaned up after, and emptied into the result.

It lies on the same drive as the result, so that finished files are moved there and never copied:

pid      the process that the folder belongs to and its machine; when that process is gone, the next run removes it.
         Both are in the folder's name too, for a process may be gone before it has written that.
out      finished files, until all of them are whole
tmp      temporary files
old      what an earlier run left in the output folder, while the new files take its place
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import platform
import re
import secrets
import shutil
import sys
import tempfile
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from ..delivery.quilts import QUILT_FILE
from ..errors import BadInputError, StereoReprojectError
from ..files import flush, flush_folder, is_missing, leads_elsewhere, put_in_place, read_small
from ..settings.views import VIEWS_LAYOUTS
from ..words import Words
from .plain_paths import plain_path

# What a rendered pair consists of. The report comes last: where it stands, the files beside it belong to it.
FILES = (
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

DIFFERENCE = "difference.png"
"""Name of a file that a pair has besides when it is compared with multiview."""

CUTOUTS = "cutouts.png"
"""Name of a file that a pair of panoramas has besides: the eyes and the traced pixels as a headset shows them."""

MULTIVIEW_EYES = {"left": "multiview-left.exr", "right": "multiview-right.exr"}
"""Names, by view, of files with multiview's own pair. A pair has them only where they are asked for by name."""


def pair_files(*, compare: bool) -> tuple[str, ...]:
    """Return the names of the files of a rendered pair, the report last; `compare` adds the picture of the difference
    from multiview."""
    return (*FILES[:-1], DIFFERENCE, FILES[-1]) if compare else FILES


def with_cutouts(files: Sequence[str], *, cutouts: bool) -> tuple[str, ...]:
    """Return the names of a pair's files, the report last, with that of the cut-outs of panoramas if there are
    some."""
    return (*files[:-1], CUTOUTS, *files[-1:]) if cutouts else tuple(files)


def superseded_by(files: Sequence[str]) -> tuple[str, ...]:
    """Return the names of files that an earlier pair may have left in the folder and that a pair with these `files`
    does not have. They are removed, because they would not belong to it."""
    return tuple(name for name in with_cutouts(pair_files(compare=True), cutouts=True) if name not in files)


VIEWS_FOLDER = "views"
"""Name of the folder, in that of the result, that holds the pictures of many views, one file for each."""

CONTACT_SHEET = "contact.png"
SWEEP = "sweep.mp4"
"""Names of the files that show many views: beside each other, and one after the other."""

ALL_VIEWS = "views.exr"
"""Name of the file that has all views, where they are stored in one."""

HOLES_FOLDER = "holes"
"""Name of the folder beside that of the views that has a picture of the traced pixels of each view that was made."""

_VIEW_FILE = re.compile(rf"{VIEWS_FOLDER}/[^/\\]+\.exr|{HOLES_FOLDER}/[^/\\]+\.png|{re.escape(ALL_VIEWS)}")


def views_files(names: Sequence[str], layout: str = VIEWS_LAYOUTS[0]) -> tuple[str, ...]:
    """Return the names of the files of many views, the report last, but for those that only the render tells: the
    aspect in the name of the quilt, and which views were made. names are those of the views' files, without an
    extension; empty as long as only the scene tells them. layout is one of `VIEWS_LAYOUTS`."""
    each = tuple(f"{VIEWS_FOLDER}/{name}.exr" for name in names) if layout == VIEWS_LAYOUTS[0] else (ALL_VIEWS,)
    return (*each, CONTACT_SHEET, SWEEP, FILES[-1])


def views_superseded_by(output: Path, files: Sequence[str]) -> tuple[str, ...]:
    """Return the names of files in the folder `output` that an earlier run of other views left there, by its report,
    and that one with these `files` does not have: its quilts, views and holes. Files of the same names that
    no report there tells of are others'."""
    found = [
        name for name in _files_told(output / FILES[-1]) if QUILT_FILE.fullmatch(name) or _VIEW_FILE.fullmatch(name)
    ]
    return tuple(name for name in sorted(set(found)) if name not in files and (output / name).is_file())


def _files_told(report: Path) -> list[str]:
    """Return the names of files that a report says it is of; an empty list where there is no such report."""
    with contextlib.suppress(OSError, ValueError):
        told = json.loads(report.read_text(encoding="utf-8"))
        files = told.get("files") if isinstance(told, dict) else None
        return [name for name in files if isinstance(name, str)] if isinstance(files, list) else []
    return []


WORK_PREFIX = ".stereo_reproject-"
REMOVAL_SECONDS = 2.0
RETRY_SECONDS = 0.05
PID_BYTES = 4096
MAX_PID = (1 << 32) - 1
# A work folder without a pid may belong to a run that is just starting, on another machine.
MAX_NAMELESS_SECONDS = 60.0

_own: set[str] = set()
"""Folders of this very process that are in use, by their real paths."""


@contextlib.contextmanager
def work_folder(output: Path, files: Sequence[str] = FILES) -> Iterator[Path]:
    """Yield a run's private folder inside `output`, for the time of a `with` block; `output` is made if it is missing.
    The private folder is removed afterwards, also after an error, and so is `output` if it was made here and is empty.

    It holds the folders out, tmp and old. files are the names of the files that `output` is to get. The yielded path is
    one that Blender reads as it is written. Folders left by killed runs are removed too. Raises BadInputError if
    `output` cannot be used.
    """
    created: list[Path] = []
    work: Path | None = None
    try:
        try:
            _make_folders(output, created)
            _check_names_free(output, files)
            remove_abandoned(output)
            work = _make_private(output)
            _own.add(os.path.realpath(work))
            (work / "pid").write_text(f"{os.getpid()}\n{machine()}\n", encoding="utf-8")
            for name in ("out", "tmp", "old"):
                (work / name).mkdir()
        except OSError as error:
            raise _failed_write(output, error) from error
        with plain_path(work) as plain:
            yield plain
    finally:
        if work is not None:
            owner = _owner(work)
            _remove_tree(work)
            _own.discard(os.path.realpath(work))
            # Of those that worked beside this one, some may have been killed meanwhile.
            remove_abandoned(output, owner=owner)
        for folder in reversed(created):
            with contextlib.suppress(OSError):
                folder.rmdir()


def _make_private(output: Path) -> Path:
    """Create and return a new folder inside `output`, whose name tells this process and machine. Except on Windows,
    only this user can open it."""
    prefix = f"{WORK_PREFIX}{os.getpid()}-{_machine_digest()}-"
    if sys.platform != "win32":
        return Path(tempfile.mkdtemp(prefix=prefix, dir=output))
    # There, files keep the rights of the folder that they were made in, also when they are moved out of it.
    work = output / f"{prefix}{secrets.token_hex(8)}"
    work.mkdir()
    return work


def _make_folders(folder: Path, created: list[Path]) -> None:
    """Make `folder` and its missing parents. Those that were made are appended to `created`, outermost first, also when
    it fails half-way. Raises BadInputError where something else has the name, and OSError."""
    # In this order: another run may make it between two looks.
    if os.path.lexists(folder):
        if folder.is_dir():
            return
        raise BadInputError(Words("{folder} is not a folder; choose another folder", folder=folder))
    if folder.parent != folder:
        _make_folders(folder.parent, created)
    try:
        folder.mkdir()
    except FileExistsError:
        # Somebody else made it in the meantime; then it is theirs.
        if not folder.is_dir():
            raise
    else:
        created.append(folder)
        # Its name, too, is to be there after a power cut.
        flush_folder(folder.parent)


def _check_names_free(output: Path, files: Sequence[str]) -> None:
    """Raise BadInputError if a folder in `output` has the name of one of the files to be written, or a file that of a
    folder for them."""
    for folder in _folders_of(output, files):
        if os.path.lexists(folder) and not folder.is_dir():
            raise BadInputError(Words("{folder} is not a folder; choose another folder", folder=folder))
    for name in files:
        if (output / name).is_dir():
            raise BadInputError(
                Words(
                    "{path} is a folder where a file is to be written; move it or choose another folder",
                    path=output / name,
                )
            )


def _folders_of(output: Path, files: Sequence[str]) -> list[Path]:
    """Return the folders that the files of these names in `output` lie in, `output` itself first."""
    return list(dict.fromkeys((output, *((output / name).parent for name in files))))


def _make_folders_for(output: Path, files: Sequence[str], created: list[Path]) -> None:
    """Make the missing folders of the files of these names in `output`; `created` is as for `_make_folders`."""
    for folder in _folders_of(output, files):
        _make_folders(folder, created)


def _flush_folders_of(output: Path, files: Sequence[str]) -> None:
    """Have the names of these files in `output` written to the disk itself. Raises OSError."""
    for folder in _folders_of(output, files):
        flush_folder(folder)


def _failed_write(output: Path, error: OSError) -> StereoReprojectError:
    """Return the error for the user for a failed write below `output`: it says that the disk is full, or the system's
    own reason."""
    if is_full_disk_error(error):
        return BadInputError(
            Words("{output}: the disk is full; free some space or choose another folder", output=output)
        )
    reason = error.strerror or str(error)
    return BadInputError(
        Words("{output} cannot be written ({reason}); choose another folder", output=output, reason=reason)
    )


def is_full_disk_error(error: OSError) -> bool:
    """Return True if the error says that the disk, or the user's share of it, is full."""
    return error.errno in (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC))


def _remove_tree(folder: Path, *, seconds: float = REMOVAL_SECONDS) -> None:
    """Remove a folder with all that is in it. Attempts are repeated for up to `seconds`, because a process that was
    just killed may hold a file; nothing is raised if it stays."""
    deadline = time.monotonic() + seconds
    # A process that was just killed may hold a file for a moment longer, on Windows and on network drives.
    while True:
        shutil.rmtree(folder, ignore_errors=True)
        if is_missing(folder) or time.monotonic() > deadline:
            return
        time.sleep(RETRY_SECONDS)


def remove_abandoned(output: Path, *, owner: int | None = None) -> None:
    """Remove the work folders in `output` of runs that were killed before they could do so themselves.

    owner is the user id whose folders are removed: by default this process's user, but some drives show one's own files
    as another user's. Folders of other users stay.
    """
    if owner is None and sys.platform != "win32":
        owner = os.geteuid()
    for folder in _work_folders(output):
        if _owner(folder) in (owner, None) and os.path.realpath(folder) not in _own and _is_abandoned(folder):
            # Its processes are long gone: what cannot be removed now cannot be in two seconds either.
            _remove_tree(folder, seconds=0.0)


def _work_folders(output: Path) -> list[Path]:
    """Return the work folders of all runs in `output`, alive or not; an empty list where it cannot be listed. Links are
    left out."""
    with contextlib.suppress(OSError):
        named_so = [path for path in output.iterdir() if path.name.startswith(WORK_PREFIX)]
        return [path for path in named_so if not leads_elsewhere(path) and path.is_dir()]
    return []


def _owner(folder: Path) -> int | None:
    """Return the user id of a file's owner; None where the system does not say, or the file is gone."""
    if sys.platform != "win32":
        with contextlib.suppress(OSError):
            return folder.lstat().st_uid
    return None


def _is_abandoned(folder: Path) -> bool:
    """Return True if the run of a work folder is certainly over, because its process on this machine is gone. False for
    a folder whose pid file names another machine. A folder without a readable pid file is judged by the process in its
    name, or else by its age (MAX_NAMELESS_SECONDS)."""
    try:
        pid, _, host = read_small(folder / "pid", PID_BYTES).decode("utf-8").partition("\n")
        # A shared drive: whether a process of another machine lives cannot be known here.
        if host.strip() not in ("", machine()):
            return False
        return not is_running(int(pid))
    except (OSError, ValueError):
        pid, _, rest = folder.name.removeprefix(WORK_PREFIX).partition("-")
        if pid.isdecimal() and rest.startswith(f"{_machine_digest()}-"):
            return not is_running(int(pid))
        # By the drive's clock, for this machine's may be another; what is made or removed there sets the folder's.
        with contextlib.suppress(OSError):
            return folder.parent.stat().st_mtime - folder.stat().st_mtime > MAX_NAMELESS_SECONDS
        return False


def _machine_digest() -> str:
    """Return eight characters that stand for `machine` in the names of work folders."""
    return hashlib.sha256(machine().encode()).hexdigest()[:8]


def machine() -> str:
    """Return an identifier of this machine within which process numbers are unique. Containers count as machines of
    their own, because two may have one host name, and each counts its processes anew."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        return f"{platform.node()} {boot} {Path('/proc/self/ns/pid').readlink()}"
    except OSError:
        # Where there is no such thing. It is drawn anew in each process that has no network, as containers may.
        return f"{platform.node()} {uuid.getnode():x}"


def is_running(pid: int) -> bool:
    """Return True if the process with this number lives on this machine. False for the number of this process itself: a
    dead run in a container may have had it before."""
    # In a container the number of a dead run is soon one's own.
    if not 0 < pid <= MAX_PID or pid == os.getpid():
        return False
    if sys.platform == "win32":
        import ctypes

        access_synchronize, access_denied, wait_timeout = 0x00100000, 5, 0x102
        kernel = ctypes.windll.kernel32
        handle = kernel.OpenProcess(access_synchronize, False, pid)
        if not handle:
            return kernel.GetLastError() == access_denied
        running = kernel.WaitForSingleObject(handle, 0) == wait_timeout
        kernel.CloseHandle(handle)
        return running
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True


def check_complete(made: Path, names: Any, files: Sequence[str] = FILES) -> None:
    """Raise StereoReprojectError unless each of `files` exists in the folder `made` and is in `names`, the list that
    the worker reported (which may be anything)."""
    for name in files:
        if not isinstance(names, list) or name not in names or not (made / name).is_file():
            raise StereoReprojectError(
                Words("the worker did not write {name}; this is a defect of stereo_reproject", name=name)
            )


def publish(
    work: Path,
    output: Path,
    files: Sequence[str] = FILES,
    *,
    superseded: Sequence[str] = (),
    between_steps: Callable[[], None],
) -> None:
    """Move the finished files from `work`/out into `output`, all of them or none. The last one, the report, is moved
    last, so that where it stands the others are complete. On return the files are on the disk.

    superseded are names of an earlier run's files that would not belong to the new ones; they are moved away, and with
    them their folders where nothing else is in these.
    between_steps is called after each move; if it raises, the moves are undone and its exception goes on. Raises
    BadInputError if `output` cannot be written; then it is as it was.
    """
    made, old = work / "out", work / "old"
    moved: list[tuple[Path, Path]] = []
    created: list[Path] = []
    try:
        for name in files:
            flush(made / name)
        _check_names_free(output, files)
        _make_folders_for(output, files, created)
        _make_folders_for(old, (*files, *superseded), [])
        # What an earlier run left goes first and its report before all else: at no moment does a report stand beside
        # files that are not its own.
        earlier = (*reversed(files), *superseded)
        steps = [(output / name, old / name) for name in earlier if os.path.lexists(output / name)]
        steps += [(made / name, output / name) for name in files]
        for source, destination in steps:
            if source == made / files[-1]:
                # After a power cut, too, it stands beside nothing but what it vouches for.
                _flush_folders_of(output, files)
            # Before it is done: whoever interrupts a slow drive may do so between the move and what comes after it.
            moved.append((source, destination))
            put_in_place(source, destination)
            between_steps()
        flush_folder(output)
    except BaseException as error:
        _undo(moved, created)
        if isinstance(error, OSError):
            raise _failed_write(output, error) from error
        raise
    for folder in _folders_of(output, superseded)[1:]:
        with contextlib.suppress(OSError):
            folder.rmdir()


def _undo(moved: Sequence[tuple[Path, Path]], created: Sequence[Path]) -> None:
    """Move files back, each from the second path to the first, the last one first, and then remove folders that were
    made for them. What cannot be undone is left."""
    for source, destination in reversed(moved):
        with contextlib.suppress(OSError):
            put_in_place(destination, source)
    for folder in reversed(created):
        with contextlib.suppress(OSError):
            folder.rmdir()
