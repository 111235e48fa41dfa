"""Paths that Blender reads as they stand, for folders whose own path it would read otherwise.

On every system Blender takes a backslash for a separator, so that a file for `a\\b/` lands in `a/b/`; it keeps at most
1023 bytes of a path, and its Python wants UTF-8. Linux has another name for any folder that a process has open, without
any of these: it leads there whatever the folder is called, and is gone with the process, so that nothing stays behind.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import BadInputError

MOST_BYTES = 600
"""Of a folder's path: Blender keeps 1023 of a file's, and ours add work folders and a name of up to 255 to it."""

MOST_OF_NAME, MOST_OF_PATH, WINDOWS_MOST = 255, 1023, 259
"""Where the system does not say: bytes of a name, of a path, and of one on Windows."""

SHOWN = 40
"""Characters of a long name."""

STAND_INS = "/proc/"
"""How the paths begin that stand in for others."""


def misread(path: str | os.PathLike[str]) -> str | None:
    """Why Blender would read a path otherwise, in words; None where it takes it as it stands."""
    name = os.fspath(path)
    if os.sep != "\\" and "\\" in name:
        return "Blender takes the backslash in it for a separator"
    try:
        name.encode("utf-8")
    except UnicodeEncodeError:
        return "Blender takes no names that are not UTF-8"
    return f"Blender takes no paths of {len(name.encode())} bytes" if len(name.encode()) > MOST_BYTES else None


@contextmanager
def plain_path(folder: Path) -> Iterator[Path]:
    """A path of a folder that Blender reads as it stands, in this process and in others of this user: its own where
    that will do, else one that is valid meanwhile. Raises BadInputError where there is none, and OSError."""
    why = misread(folder)
    if why is None:
        yield folder
        return
    descriptor = os.open(folder, getattr(os, "O_PATH", os.O_RDONLY))
    try:
        plain = Path(f"{STAND_INS}{os.getpid()}/fd/{descriptor}")
        if not plain.is_dir() or not plain.samefile(folder):
            raise BadInputError(f"{folder} cannot be used: {why}; name another folder")
        yield plain
    finally:
        os.close(descriptor)


@contextmanager
def plain_blend(blend: Path) -> Iterator[Path]:
    """The path of a .blend by which Blender finds what lies beside it and above, as far as up to the folder that is to
    blame. Raises BadInputError and OSError."""
    folder = next((parent for parent in blend.parents if misread(parent.name) is not None), None)
    if folder is None and misread(blend.parent) is not None:
        folder = blend.parent
    if folder is None:
        yield blend
        return
    with plain_path(folder) as plain:
        yield plain / blend.relative_to(folder)


def check_names(folder: Path, names: Iterable[str]) -> None:
    """Raise BadInputError unless a folder, which may be still to be made, takes files with these names."""
    most_of_name, most_of_path = _limits(folder)
    for name in names:
        length, whole = len(os.fsencode(name)), len(os.fsencode(folder / name))
        if length > most_of_name:
            raise BadInputError(
                f"{folder}: a name of {length} bytes is longer than the {most_of_name} that fit ({name[:SHOWN]}...):"
                " shorten the name at the end of the output path"
            )
        if whole > most_of_path:
            raise BadInputError(
                f"{folder}: a path of {whole} bytes is longer than the {most_of_path} that fit: shorten it"
            )


def _limits(folder: Path) -> tuple[int, int]:
    """The most bytes of a name, and of a path, that the drive of a folder takes."""
    there = next((parent for parent in (folder, *folder.parents) if parent.is_dir()), None)
    if there is None or not hasattr(os, "pathconf"):
        return MOST_OF_NAME, WINDOWS_MOST
    try:
        # One byte of a path is for its end.
        return os.pathconf(there, "PC_NAME_MAX"), os.pathconf(there, "PC_PATH_MAX") - 1
    except (OSError, ValueError):
        return MOST_OF_NAME, MOST_OF_PATH
