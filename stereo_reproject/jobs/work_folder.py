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
import os
import platform
import secrets
import shutil
import sys
import tempfile
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from ..errors import BadInputError, StereoReprojectError
from ..files import flush, flush_folder, is_missing, leads_elsewhere, put_in_place, read_small
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


def pair_files(*, compare: bool) -> tuple[str, ...]:
    """The files of a rendered pair."""
    return (*FILES[:-1], DIFFERENCE, FILES[-1]) if compare else FILES


def superseded_by(files: Sequence[str]) -> tuple[str, ...]:
    """Return names of files that an earlier pair may have left and that do not belong to a pair with these files."""
    return tuple(name for name in pair_files(compare=True) if name not in files)


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
    """A private folder inside `output`, which is made if need be and is to take these files.

    Its path is one that Blender reads as it stands. Afterwards the folder is gone, and `output` too if it was made here
    and is empty. Raises BadInputError if `output` cannot be used.
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
    prefix = f"{WORK_PREFIX}{os.getpid()}-{_machine_digest()}-"
    if sys.platform != "win32":
        return Path(tempfile.mkdtemp(prefix=prefix, dir=output))
    # There, files keep the rights of the folder that they were made in, also when they are moved out of it.
    work = output / f"{prefix}{secrets.token_hex(8)}"
    work.mkdir()
    return work


def _make_folders(folder: Path, created: list[Path]) -> None:
    """Make `folder` and its missing parents; what was made is added to `created`, also when it fails half-way."""
    # In this order: another run may make it between two looks.
    if os.path.lexists(folder):
        if folder.is_dir():
            return
        raise BadInputError(f"{folder} is not a folder; choose another folder")
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
    for name in files:
        if (output / name).is_dir():
            raise BadInputError(
                f"{output / name} is a folder where a file is to be written; move it or choose another folder"
            )


def _failed_write(output: Path, error: OSError) -> StereoReprojectError:
    if is_full_disk_error(error):
        return BadInputError(f"{output}: the disk is full; free some space or choose another folder")
    reason = error.strerror or str(error)
    return BadInputError(f"{output} cannot be written ({reason}); choose another folder")


def is_full_disk_error(error: OSError) -> bool:
    """Return whether something could not be written for lack of room."""
    return error.errno in (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC))


def _remove_tree(folder: Path, *, seconds: float = REMOVAL_SECONDS) -> None:
    deadline = time.monotonic() + seconds
    # A process that was just killed may hold a file for a moment longer, on Windows and on network drives.
    while True:
        shutil.rmtree(folder, ignore_errors=True)
        if is_missing(folder) or time.monotonic() > deadline:
            return
        time.sleep(RETRY_SECONDS)


def remove_abandoned(output: Path, *, owner: int | None = None) -> None:
    """Remove the work folders of runs that were killed before they could do it themselves.

    Those of other users stay, and cost nothing: a folder for temporary files is full of them. owner is whose folders
    are one's own, where the drive makes them another user's.
    """
    if owner is None and sys.platform != "win32":
        owner = os.geteuid()
    for folder in _work_folders(output):
        if _owner(folder) in (owner, None) and os.path.realpath(folder) not in _own and _is_abandoned(folder):
            # Its processes are long gone: what cannot be removed now cannot be in two seconds either.
            _remove_tree(folder, seconds=0.0)


def _work_folders(output: Path) -> list[Path]:
    with contextlib.suppress(OSError):
        named_so = [path for path in output.iterdir() if path.name.startswith(WORK_PREFIX)]
        return [path for path in named_so if not leads_elsewhere(path) and path.is_dir()]
    return []


def _owner(folder: Path) -> int | None:
    """Return the owner of a file; None where the system does not say, or the file is gone."""
    if sys.platform != "win32":
        with contextlib.suppress(OSError):
            return folder.lstat().st_uid
    return None


def _is_abandoned(folder: Path) -> bool:
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
    return hashlib.sha256(machine().encode()).hexdigest()[:8]


def machine() -> str:
    """Return an identifier of this machine, within which process numbers are unique. Two containers may have the same
    host name, and each counts its processes anew."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        return f"{platform.node()} {boot} {Path('/proc/self/ns/pid').readlink()}"
    except OSError:
        # Where there is no such thing. It is drawn anew in each process that has no network, as containers may.
        return f"{platform.node()} {uuid.getnode():x}"


def is_running(pid: int) -> bool:
    """Return whether a process of this machine lives; False for this process itself, whose number may have been a dead
    one's before."""
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
    """Raise StereoReprojectError unless all of `files` are in the folder `made` and in `names`, the worker's list."""
    for name in files:
        if not isinstance(names, list) or name not in names or not (made / name).is_file():
            raise StereoReprojectError(f"the worker did not write {name}; this is a defect of stereo_reproject")


def publish(
    work: Path,
    output: Path,
    files: Sequence[str] = FILES,
    *,
    superseded: Sequence[str] = (),
    between_steps: Callable[[], None],
) -> None:
    """Move the finished files from `work` into `output`, all of them or none; the last of them vouches for the others.
    When this is back they are on the disk.

    superseded are further files of an earlier run, which would not belong to these. between_steps is called after each
    move; if it raises, the moves are undone and the exception goes on. Raises BadInputError if `output` cannot be
    written.
    """
    made, old = work / "out", work / "old"
    moved: list[tuple[Path, Path]] = []
    try:
        for name in files:
            flush(made / name)
        _check_names_free(output, files)
        # What an earlier run left goes first and its report before all else: at no moment does a report stand beside
        # files that are not its own.
        earlier = (*reversed(files), *superseded)
        steps = [(output / name, old / name) for name in earlier if os.path.lexists(output / name)]
        steps += [(made / name, output / name) for name in files]
        for source, destination in steps:
            if source == made / files[-1]:
                # After a power cut, too, it stands beside nothing but what it vouches for.
                flush_folder(output)
            # Before it is done: whoever interrupts a slow drive may do so between the move and what comes after it.
            moved.append((source, destination))
            put_in_place(source, destination)
            between_steps()
        flush_folder(output)
    except BaseException as error:
        for source, destination in reversed(moved):
            with contextlib.suppress(OSError):
                put_in_place(destination, source)
        if isinstance(error, OSError):
            raise _failed_write(output, error) from error
        raise
