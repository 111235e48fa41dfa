"""Notes on movies in the journal: the frames that a movie holds, so that a later run knows what it would replace."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import BadInputError
from ..files import UnusableFileError, read_small, remove
from ..settings.animation import read_frames, spelled
from .checksums import checksum
from .journal_folder import UNREADABLE_ERRORS, JournalFolder

MOVIE_NOTE_BYTES = 1 << 23
"""Greatest size of a movie's note: it names the frames."""


@dataclass(frozen=True)
class MovieNote:
    """The frames that a movie was made of; None where an earlier version made it, which did not note them."""

    frames: frozenset[int] | None


class MovieNotes:
    """The notes on movies that were made of the frames of one name: a JSON file each, named by the checksum."""

    def __init__(self, folder: JournalFolder) -> None:
        self._folder = folder

    @contextlib.contextmanager
    def noted(self, made: Path, place: Path, frames: Collection[int]) -> Iterator[None]:
        """Write the note on a movie, run the body, which moves it from made to place, then remove outdated notes.

        Notes are outdated when their movie is gone or was replaced. Where no note can be written, later runs do not
        recognise the movie. Raises OSError where the movie cannot be read.
        """
        known = checksum(made)
        note = self._path(known)
        values = {"of": self._folder.name, "frames": spelled(frames), "file": self._relative(place), **known}
        with contextlib.suppress(OSError):
            self._folder.write(note, values)
        yield
        with contextlib.suppress(OSError):
            for other in self._folder.path.glob("movie-*.json"):
                if self._is_outdated(other):
                    remove(other)
            if not note.exists() and checksum(place) == known:
                # Another run saw the note before the movie was in its place, and removed it.
                self._folder.write(note, values)

    def read(self, path: Path) -> MovieNote | None:
        """Return the note on a file that is an unchanged movie of these frames; None for any other. Raises OSError."""
        # Most folders have no note or one: without any, the file's checksum is not needed.
        if not any(self._folder.path.glob("movie-*.json")):
            return None
        try:
            known = checksum(path)
            noted = json.loads(read_small(self._path(known), MOVIE_NOTE_BYTES))
            if {**noted, "of": self._folder.name, **known} != noted:
                return None
            return MovieNote(frozenset(read_frames(noted["frames"])) if "frames" in noted else None)
        except (FileNotFoundError, UnusableFileError, BadInputError, *UNREADABLE_ERRORS):
            return None

    def _path(self, known: Mapping[str, Any]) -> Path:
        return self._folder.path / f"movie-{known['sha256'][:16]}.json"

    def _relative(self, path: Path) -> str:
        """The path from the frames' folder: other machines may have the drive elsewhere."""
        try:
            # Resolved first, because ".." after a link leads up from the link's target.
            place = os.path.relpath(path.parent.resolve() / path.name, self._folder.frames_folder.resolve())
            return Path(place).as_posix()
        except ValueError:
            # On another drive of Windows.
            return str(path)

    def _is_outdated(self, note: Path) -> bool:
        """Return whether a note's movie is gone or another; False where an earlier version did not note its place."""
        try:
            noted = json.loads(read_small(note, MOVIE_NOTE_BYTES))
            place = self._folder.frames_folder / noted["file"]
            if noted["of"] != self._folder.name or not place.parent.is_dir():
                return False
            if not place.exists():
                return True
            return place.stat().st_size != noted["bytes"] or checksum(place)["sha256"] != noted["sha256"]
        except (OSError, *UNREADABLE_ERRORS):
            return False
