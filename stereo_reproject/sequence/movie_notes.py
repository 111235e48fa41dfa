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
    """A note about a movie: `frames` are the numbers of the frames that it was made of, None for a movie by an earlier
    version, which did not note them."""

    frames: frozenset[int] | None


class MovieNotes:
    """The notes about movies that were made of the frames of one name. They tell a later run which movies are its own
    to replace. Each is a JSON file in the journal, named by the movie's checksum."""

    def __init__(self, folder: JournalFolder) -> None:
        self._folder = folder

    @contextlib.contextmanager
    def noted(self, made: Path, place: Path, frames: Collection[int]) -> Iterator[None]:
        """Write the note about a finished movie, for the time of a `with` block whose body moves the movie from `made`
        to `place`. After the block, notes of movies that are gone or were replaced are removed.

        frames are the frames that the movie was made of. If the note cannot be written, that is no error, but later
        runs do not recognise the movie. Raises OSError where the movie cannot be read.
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
        """Return the note about the movie at `path`; None where it is no unchanged movie of these frames, or missing.
        Raises OSError."""
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
        """Return the path of the note about a movie with this checksum."""
        return self._folder.path / f"movie-{known['sha256'][:16]}.json"

    def _relative(self, path: Path) -> str:
        """Return a path relative to the frames' folder, because other machines may have the drive at another place. On
        another drive of Windows it stays absolute."""
        try:
            # Resolved first, because ".." after a link leads up from the link's target.
            place = os.path.relpath(path.parent.resolve() / path.name, self._folder.frames_folder.resolve())
            return Path(place).as_posix()
        except ValueError:
            # On another drive of Windows.
            return str(path)

    def _is_outdated(self, note: Path) -> bool:
        """Return True if the movie of a note is gone or is another by now. False where that is not certain, as for
        notes of earlier versions without a place."""
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
