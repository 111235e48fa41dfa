"""Safe reading and writing of files: files that others may have made or damaged are read only where they have the form
of ours, and new files are put in their places so that they are whole there, whatever else holds them and after a
power cut."""

from __future__ import annotations

import contextlib
import errno
import json
import math
import os
import secrets
import stat
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from io import BufferedReader
from numbers import Integral, Real
from pathlib import Path
from typing import Any, TypeVar

Result = TypeVar("Result")

KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFLNK: "a link",
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}

FILE_ATTRIBUTE_HIDDEN = 0x2
"""Mark of a hidden folder, as Windows' SetFileAttributesW takes it."""

JUNCTION_TAG = 0xA0000003
"""IO_REPARSE_TAG_MOUNT_POINT of the Windows API."""

CANNOT_FLUSH = {errno.EINVAL, errno.EBADF, errno.EACCES, errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS}
"""Errors of drives that flush no folders, and of folders that may not be opened for it."""

HELD_BY_OTHERS_SECONDS = 2.0
RETRY_SECONDS = 0.05

APPLE_DOUBLE = "._"
"""Beginning of the names of files that macOS puts beside others, on drives that cannot keep its own facts about them.
"""


class UnusableFileError(OSError):
    """The path leads to no regular file, or to one larger than any that this package writes, so it is not read.
    `strerror` says which of these it is."""


def is_missing(path: Path) -> bool:
    """Return True if nothing is at this path. A file that cannot be looked at for another reason, such as a closed
    folder, is not missing."""
    try:
        path.lstat()
    except OSError as error:
        return isinstance(error, (FileNotFoundError, NotADirectoryError))
    return False


def open_regular(path: Path, *, follow: bool = False) -> BufferedReader:
    """Open a regular file for reading as bytes. With `follow`, the path may be a link to one.

    Anything else at the path is not opened, because that may wait forever (a named pipe) or do something (a device).
    Raises UnusableFileError for such a thing, and other OSErrors.
    """
    try:
        _check_regular(path.stat() if follow else path.lstat(), path)
    except OSError as error:
        if error.errno != errno.ELOOP:
            raise
        raise UnusableFileError(errno.ELOOP, "it is a link in a circle", str(path)) from error
    not_through_links = 0 if follow else getattr(os, "O_NOFOLLOW", 0)
    # It may have become something else since.
    more = not_through_links | getattr(os, "O_NONBLOCK", 0)
    file = open(path, "rb", opener=lambda name, flags: os.open(name, flags | more))  # noqa: SIM115
    try:
        _check_regular(os.fstat(file.fileno()), path)
    except BaseException:
        file.close()
        raise
    return file


def _check_regular(found: os.stat_result, path: Path) -> None:
    """Raise UnusableFileError unless `found`, the result of a stat call for `path`, is that of a regular file. The
    message names the kind of thing that it is."""
    if not stat.S_ISREG(found.st_mode):
        kind = KINDS.get(stat.S_IFMT(found.st_mode), "no regular file")
        raise UnusableFileError(errno.EINVAL, f"it is {kind}", str(path))


def read_small(path: Path, most: int) -> bytes:
    """Return the content of a regular file that has at most `most` bytes. Raises UnusableFileError where it is larger
    or no regular file, and other OSErrors."""
    with open_regular(path) as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise UnusableFileError(errno.EFBIG, f"it is larger than {most} bytes", str(path))
    return content


def is_regular(path: Path) -> bool:
    """Return True if a regular file is at this path; False for anything else, for a link to a regular file, and for
    nothing."""
    with contextlib.suppress(OSError):
        return stat.S_ISREG(path.lstat().st_mode)
    return False


def leads_elsewhere(path: Path) -> bool:
    """Return True if the path itself is a link to another folder or file, or a junction of Windows; False if it is
    neither or missing."""
    with contextlib.suppress(OSError):
        found = path.lstat()
        return stat.S_ISLNK(found.st_mode) or getattr(found, "st_reparse_tag", 0) == JUNCTION_TAG
    return False


def hide(folder: Path) -> None:
    """Have Windows show a folder no longer, unless the user wants to see hidden ones. Elsewhere a name that begins with
    a dot does that. Does nothing where the drive has no such mark."""
    if sys.platform == "win32":
        import ctypes

        ctypes.windll.kernel32.SetFileAttributesW(str(folder), FILE_ATTRIBUTE_HIDDEN)


def flush(path: Path) -> None:
    """Have a file's content written to the disk itself, so that it survives a power cut. Raises OSError."""
    with path.open("r+b") as file:
        sync(file.fileno())


def flush_folder(folder: Path) -> None:
    """Have the names of a folder's files written to the disk itself, so that new and renamed files survive a power cut.
    Does nothing where the system or the drive does not offer this. Raises OSError."""
    if sys.platform == "win32":
        return
    try:
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as error:
        if error.errno not in CANNOT_FLUSH:
            raise


def write_new(path: Path, text: str) -> None:
    """Create a file with this ASCII text. On return, its name and its content are on the disk.

    Raises FileExistsError where something is at the path already, and leaves that alone. Raises other OSErrors where
    the file cannot be written; the unfinished file is removed then.
    """
    file = path.open("x", encoding="ascii")
    try:
        with file:
            file.write(text)
            file.flush()
            sync(file.fileno())
        flush_folder(path.parent)
    except OSError:
        # On a full disk there is room for a name, but not for what the file holds.
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)
        raise


def put_in_place(made: Path, place: Path) -> Path:
    """Rename the file `made` to `place`, where it replaces any earlier file, and return `place`. Raises OSError.

    On Windows a scanner, an indexer or a viewer may hold either file for a moment, and nobody can rename it meanwhile.
    There the attempt is repeated for up to HELD_BY_OTHERS_SECONDS before the error is raised.
    """
    return _once_let_go(lambda: made.replace(place))


def remove(path: Path) -> None:
    """Remove a file; do nothing if it is missing. Raises OSError.

    On Windows this fails while another process reads the file, as other runs read claims. There the attempt is repeated
    for up to HELD_BY_OTHERS_SECONDS before the error is raised.
    """
    _once_let_go(lambda: path.unlink(missing_ok=True))


def _once_let_go(act: Callable[[], Result]) -> Result:
    """Call `act` and return its result. On Windows, repeat it after a PermissionError for up to HELD_BY_OTHERS_SECONDS,
    because another process may hold the file for a moment; then raise the error. Elsewhere the error is raised at
    once."""
    deadline = time.monotonic() + HELD_BY_OTHERS_SECONDS
    while True:
        try:
            return act()
        except PermissionError:
            if sys.platform != "win32" or time.monotonic() >= deadline:
                raise
            time.sleep(RETRY_SECONDS)


def sync(descriptor: int) -> None:
    """Have the content of an open file, given by its descriptor, written to the disk itself. Raises OSError."""
    if sys.platform == "darwin":
        import fcntl

        # There, fsync hands a file over to the drive, which may keep it in its memory for long; and network drives
        # know nothing else.
        with contextlib.suppress(OSError):
            fcntl.fcntl(descriptor, fcntl.F_FULLFSYNC)
            return
    os.fsync(descriptor)


def made_in(folder: Path) -> list[Path]:
    """Return the paths in a folder, sorted by name, without the `._` files that macOS puts beside others."""
    return sorted(path for path in folder.iterdir() if not path.name.startswith(APPLE_DOUBLE))


def strict(value: Any) -> Any:
    """Return `value` in types that strict JSON has: numpy scalars become Python numbers, tuples become lists, NaN and
    infinities become None. Works through dicts and lists. Raises TypeError for anything else."""
    if isinstance(value, Mapping):
        return {str(name): strict(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [strict(item) for item in value]
    if isinstance(value, (str, bool)) or value is None:
        return value
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        return float(value) if math.isfinite(value) else None
    if hasattr(value, "item"):
        return strict(value.item())
    raise TypeError(f"{type(value).__name__} has no place in JSON")


def to_json(data: Mapping[str, Any]) -> str:
    """Return `data` as strict JSON text, indented over several lines; see `strict`."""
    return json.dumps(strict(data), indent=2, allow_nan=False)


def write_json(path: Path | str, data: Mapping[str, Any], *, until_whole: Path | None = None) -> None:
    """Write `data` as strict JSON to the file `path`, which appears whole or not at all. until_whole is the folder that
    holds it until it is whole, see `whole_file`. Raises OSError."""
    text = to_json(data) + "\n"
    with whole_file(Path(path), until_whole=until_whole) as beside:
        beside.write_text(text, encoding="utf-8", newline="\n")


def beside_name(name: str) -> str:
    """Return a temporary name for the file `name` while it is being written. It contains a random part, so that no two
    are alike."""
    return f".{name}.{secrets.token_hex(8)}.tmp"


@contextlib.contextmanager
def whole_file(path: Path, *, until_whole: Path | None = None) -> Iterator[Path]:
    """Yield a temporary path to write a file to, for the time of a `with` block. When the block is over, the file is
    renamed to `path`, so that it appears there whole or, after an error, not at all.

    On return from the block the file is on the disk. until_whole is the folder for the temporary file, on the same
    drive as `path`; by default it is the folder of `path`. Raises OSError.
    """
    # A process of another machine, on a shared drive, may have the same number.
    beside = (until_whole or path.parent) / beside_name(path.name)
    try:
        yield beside
        flush(beside)
        put_in_place(beside, path)
        flush_folder(path.parent)
    except BaseException:
        with contextlib.suppress(OSError):
            beside.unlink()
        raise
