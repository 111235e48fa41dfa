"""The folder in which the parts of a journal lie, and how their files are called and written."""

from __future__ import annotations

import contextlib
import errno
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import BadInputError
from ..files import flush_folder, hide, leads_elsewhere, write_json
from ..words import Words
from .fingerprints import digest

JOURNAL = ".stereo_reproject"
"""Name of the journal's folder, which lies in the folder of the frames. File managers do not show it."""

EARLIER_JOURNAL = "journal"
"""Name of the folder in earlier versions. An animation that was begun there goes on there."""

FILES_OF_A_JOURNAL = re.compile(r".*\d{4,}(\.json|\.claim\.\d+)|(movie|found)-[0-9a-f]{16}.*\.json")
"""Names by which an earlier version's journal is told from a folder of the user's that is called alike."""

UNREADABLE_ERRORS = (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError)
"""Errors that reading a damaged or foreign file as one of the journal's may end in."""


def journal_path(frames_folder: Path) -> Path:
    """Return the path of the journal's folder for frames in this folder: an earlier version's if there is one and none
    of ours, else ours. It may not exist yet. A folder that cannot be looked into is none of ours.
    """
    path, earlier = frames_folder / JOURNAL, frames_folder / EARLIER_JOURNAL
    with contextlib.suppress(OSError):
        if not (os.path.lexists(path) or leads_elsewhere(earlier)):
            return earlier if any(FILES_OF_A_JOURNAL.fullmatch(file.name) for file in earlier.iterdir()) else path
    return path


class JournalFolder:
    """The journal's folder, which lies in the folder of the frames, and the names of the files in it.

    `name` is the common beginning of the frames' file names, from Blender's output path. It tells these frames from
    others in the same folder. As an attribute, characters that some drives do not allow are replaced in it.
    """

    def __init__(self, frames_folder: Path, name: str) -> None:
        self.frames_folder = frames_folder
        self.path = journal_path(frames_folder)
        plain = name.replace("#", "")
        self.name = re.sub(r"[^A-Za-z0-9._-]+", "_", plain)
        if self.name != plain:
            # Two names that differ only in replaced characters must still differ.
            self.name += f"{digest(plain)[:6]}_"

    def make(self) -> None:
        """Create the folder where it is missing.

        Raises OSError, and BadInputError where a link is in its place, because files of dead runs are removed in it.
        """
        self.path.mkdir(exist_ok=True)
        hide(self.path)
        flush_folder(self.frames_folder)
        if leads_elsewhere(self.path):
            raise BadInputError(
                Words("{path} is a link to another folder: remove it, or name another for the frames", path=self.path)
            )

    def remove_empty(self) -> None:
        """Remove the folder if it is empty; else do nothing."""
        with contextlib.suppress(OSError):
            self.path.rmdir()

    def stem(self, frame: int) -> str:
        """Return the beginning of the names of a frame's files in the journal, such as shot_0012."""
        return f"{self.name}{frame:04d}"

    def write(self, path: Path, values: Mapping[str, Any]) -> None:
        """Write values as the JSON file `path`, which appears whole or not at all. Raises OSError."""
        if path.is_dir() and not path.is_symlink():
            raise IsADirectoryError(errno.EISDIR, f"{path.name} in {path.parent.name} is a folder: move it", str(path))
        write_json(path, values)
