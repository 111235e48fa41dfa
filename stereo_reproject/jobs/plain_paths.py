"""Paths that Blender reads as they stand, for folders whose own path it would read otherwise.

On every system Blender takes a backslash for a separator, so that a file for `a\\b/` lands in `a/b/`; it keeps at most
1023 bytes of a path, and its Python wants UTF-8. Linux has another name for any folder that a process has open, without
any of these: it leads there whatever the folder is called, and is gone with the process, so that nothing stays behind.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import BadInputError
from ..words import Words

UNIT = "characters" if sys.platform == "win32" else "bytes"
"""Unit in which the system limits the length of names and paths."""

MAX_FOLDER_LENGTH = 199 if sys.platform == "win32" else 600
"""Greatest length of a folder's path in UNIT: Blender keeps 1023 bytes of a file's path, Windows 259 characters, and
our folders and names come on top."""

MAX_NAME_LENGTH, MAX_PATH_LENGTH, MAX_WINDOWS_PATH_LENGTH = 255, 1023, 259
"""Greatest length of a name, of a path, and of a path on Windows, in UNIT, for systems that do not say theirs."""

NOT_ON_WINDOWS = re.compile(
    r'[<>:"|?*\x00-\x1f]|[. ]$|^(con|prn|aux|nul|com[0-9\u00b9\u00b2\u00b3]|lpt[0-9\u00b9\u00b2\u00b3]) *(\.|$)',
    re.IGNORECASE,
)
"""Characters and names that no file may have there. After a colon, NTFS writes into a stream that hides behind a file.
"""

SHOWN_CHARACTERS = 40
"""Number of characters of a long name in a message."""

STAND_INS = "/proc/"
"""Beginning of the paths that stand in for others."""


def misread(path: str | os.PathLike[str]) -> Words | None:
    """Return in words why Blender would misread a path, such as one with a backslash in it; None where it reads it as
    it is written."""
    name = os.fspath(path)
    if os.sep != "\\" and "\\" in name:
        return Words("Blender takes the backslash in it for a separator")
    if not _is_utf8(name):
        return Words("Blender takes no names that are not UTF-8")
    length = _length(name)
    if length <= MAX_FOLDER_LENGTH:
        return None
    return Words("Blender takes no paths of {length} {unit}", length=length, unit=Words(UNIT))


def _is_utf8(name: str) -> bool:
    """Return True if a name can be written in UTF-8."""
    try:
        name.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True


def _length(name: str) -> int:
    """Return the length of a name or path in UNIT."""
    return len(name.encode("utf-16-le", "surrogatepass")) // 2 if sys.platform == "win32" else len(os.fsencode(name))


@contextmanager
def plain_path(folder: Path) -> Iterator[Path]:
    """Yield a path by which Blender finds an existing folder, for the time of a `with` block: the folder's own path
    where Blender reads that as it is written, else a stand-in below /proc.

    The stand-in is valid until the block is over, also in other processes of the same user. Raises BadInputError where
    there is no such path.
    """
    why = misread(folder)
    if why is None:
        yield folder
        return
    stand_ins = Path(f"{STAND_INS}{os.getpid()}/fd")
    if not stand_ins.is_dir():
        raise BadInputError(Words("{folder} cannot be used: {why}; name another folder", folder=folder, why=why))
    try:
        descriptor = os.open(folder, getattr(os, "O_PATH", os.O_RDONLY))
    except OSError as error:
        raise BadInputError(
            Words("{folder} cannot be read ({reason}); check its permissions", folder=folder, reason=error.strerror)
        ) from error
    try:
        plain = stand_ins / str(descriptor)
        # In a container it may be the machine's, where another process has this number.
        if not plain.exists() or not plain.samefile(folder):
            raise BadInputError(Words("{folder} cannot be used: {why}; name another folder", folder=folder, why=why))
        yield plain
    finally:
        os.close(descriptor)


@contextmanager
def plain_blend(blend: Path) -> Iterator[Path]:
    """Yield a path by which Blender finds a .blend and the files beside it, for the time of a `with` block: its own
    path, or one with a stand-in for the folder whose path Blender would misread (see `plain_path`).

    The files beside it and above, up to that folder, are found by the same path. Raises BadInputError where there is no
    such path.
    """
    if not _is_utf8(blend.name):
        # Another path of it would not do: what lies beside it is found by its own.
        name = os.fsencode(blend).decode("ascii", "backslashreplace")
        raise BadInputError(
            Words("{name} cannot be opened: Blender takes no names that are not UTF-8; rename it", name=name)
        )
    folder = next((parent for parent in blend.parents if misread(parent.name) is not None), None)
    if folder is None and misread(blend.parent) is not None:
        folder = blend.parent
    if folder is None:
        yield blend
        return
    with plain_path(folder) as plain:
        yield plain / blend.relative_to(folder)


def check_names(folder: Path, names: Iterable[str]) -> None:
    """Raise BadInputError unless files with these names can be made in a folder: their names and paths must not be too
    long, nor forbidden on Windows. The folder need not exist yet."""
    most_of_name, most_of_path = _limits(folder)
    for name in names:
        if sys.platform == "win32" and NOT_ON_WINDOWS.search(name):
            raise BadInputError(
                Words(
                    "{folder}: Windows has no files called {name}: change the name in the output path",
                    folder=folder,
                    name=repr(name),
                )
            )
        length, whole = _length(name), _length(str(folder / name))
        if length > most_of_name:
            raise BadInputError(
                Words(
                    "{folder}: a name of {length} {unit} is longer than the {most_of_name} that fit ({name}...):"
                    " shorten the name at the end of the output path",
                    folder=folder,
                    length=length,
                    unit=Words(UNIT),
                    most_of_name=most_of_name,
                    name=name[:SHOWN_CHARACTERS],
                )
            )
        if whole > most_of_path:
            raise BadInputError(
                Words(
                    "{folder}: a path of {whole} {unit} is longer than the {most_of_path} that fit: shorten it",
                    folder=folder,
                    whole=whole,
                    unit=Words(UNIT),
                    most_of_path=most_of_path,
                )
            )


def _limits(folder: Path) -> tuple[int, int]:
    """Return the greatest length of a name and of a whole path, in UNIT, that the drive of a folder takes."""
    there = next((parent for parent in (folder, *folder.parents) if parent.is_dir()), None)
    if there is None or not hasattr(os, "pathconf"):
        return MAX_NAME_LENGTH, MAX_WINDOWS_PATH_LENGTH
    try:
        # One byte of a path is for its end.
        name, path = os.pathconf(there, "PC_NAME_MAX"), os.pathconf(there, "PC_PATH_MAX") - 1
    except (OSError, ValueError):
        return MAX_NAME_LENGTH, MAX_PATH_LENGTH
    # Some shared folders say 0, and -1 is for no limit.
    return name if name > 0 else MAX_NAME_LENGTH, path if path > 0 else MAX_PATH_LENGTH
