"""The journal: facts about an animation's frames in a hidden folder beside them, so that any process can continue
them.

0001.json       a finished frame: its settings, its scene, its files with their checksums, its figures (`record_store`)
0001.claim.1    a run that renders the frame now; of several, the highest number holds it (`claims`)
.NAME.tmp       a file that is being written and will be called NAME
run-TOKEN       a live run: where, on which frames, by which settings and of which scene, and a number that counts up
                as long as it lives (`runs`, `other_runs`)
movie-SHA.json  a movie that was made of the frames, by its checksum: of which frames, and its place (`movie_notes`)
found-KEY.json  numbers that one frame has found and others use: the cost of its source eye, for one (`agreed_values`)

Each is a small file of its own, which appears whole or may be doubted by whoever reads it. So several processes, on
several machines with a shared drive, need no locks, which some drives do not have, and no clocks that agree: a file is
made by one process alone (O_EXCL), and a run lives as long as its number changes under the eyes of others. A frame's
record is written after its files, and its claim is removed after that. A run that was thought dead and wakes up finds
its claim gone or passed on, and leaves the frame alone. Files of dead runs are removed by the next run.

Others may write into the folder, and a drive may damage it: only regular files of a limited size are read, and nothing
is believed that does not have the form of ours.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from ..files import UnusableFileError
from .agreed_values import AgreedValues
from .checksums import is_unchanged
from .claims import Claims
from .fingerprints import Fingerprints, FrameState
from .frame_record import Record
from .journal_folder import JournalFolder
from .movie_notes import MovieNotes
from .record_store import RecordStore
from .runs import LiveRuns


class Journal:
    """The journal of the frames in a folder: its parts, and the state of each frame as it follows from them.

    name is the common beginning of the frames' file names, from Blender's output path. runs are the live runs of this
    journal, by default new ones with the usual clock.
    """

    def __init__(self, frames_folder: Path, name: str = "", *, runs: LiveRuns | None = None) -> None:
        self.place = JournalFolder(frames_folder, name)
        self.runs = runs or LiveRuns(self.place.path)
        self.records = RecordStore(self.place)
        self.claims = Claims(self.place, self.runs)
        self.movies = MovieNotes(self.place)
        self.agreed = AgreedValues(self.place)

    @property
    def frames_folder(self) -> Path:
        """The folder of the frames."""
        return self.place.frames_folder

    @property
    def folder(self) -> Path:
        """The journal's own folder."""
        return self.place.path

    @property
    def name(self) -> str:
        """The common beginning of the frames' file names, in characters that every drive allows."""
        return self.place.name

    def known_frames(self) -> set[int]:
        """Return the numbers of the frames that have a record or a claim. Reads only the names in the folder. Raises
        OSError."""
        pattern = re.compile(re.escape(self.name) + r"(\d{4,})(?:\.json|\.claim\..*)", re.IGNORECASE)
        try:
            found = (pattern.fullmatch(path.name) for path in self.folder.iterdir())
            return {int(match[1]) for match in found if match}
        except (FileNotFoundError, NotADirectoryError):
            return set()

    def state(self, frame: int, files: Collection[Path], wanted: Fingerprints) -> FrameState:
        """Return the state of a frame that is to have these files, compared with the fingerprints that are wanted. A
        frame whose files another live run is writing counts as missing. Raises OSError."""
        state = self._state(frame, files, wanted)
        if state not in (FrameState.UNKNOWN, FrameState.DAMAGED):
            return state
        # Another run may be writing the frame at this moment, one file after the other and its record last.
        return FrameState.MISSING if self.claims.is_held(frame) else self._state(frame, files, wanted)

    def _state(self, frame: int, files: Collection[Path], wanted: Fingerprints) -> FrameState:
        """Return the state of a frame by its record and its files alone, without a look at claims. Raises OSError."""
        record = self.records.read(frame)
        if record is None:
            there = any(_has_content(path) for path in files)
            return FrameState.UNKNOWN if there or self.records.has_file(frame) else FrameState.MISSING
        state = wanted.state_of(record)
        if state is not FrameState.WHOLE:
            return state
        # With another output path, the files of the same frame have other names.
        asked = {path.relative_to(self.frames_folder).as_posix() for path in files}
        return self._state_of_files(record) if asked <= record.files.keys() else FrameState.MISSING

    def _state_of_files(self, record: Record) -> FrameState:
        """Return WHOLE if all files of a record are unchanged, MISSING if one is missing, else DAMAGED. Raises
        OSError."""
        worst = FrameState.WHOLE
        for name, known in record.files.items():
            try:
                if not self._is_as_recorded(name, known):
                    worst = FrameState.DAMAGED
            except UnusableFileError:
                worst = FrameState.DAMAGED
            except (FileNotFoundError, NotADirectoryError):
                return FrameState.MISSING
        return worst

    def _is_as_recorded(self, name: str, known: Mapping[str, Any]) -> bool:
        """Return True if the file `name` has its recorded checksum; False also where a link leads it out of the frames'
        folder. Raises OSError."""
        place = Path(os.path.realpath(self.frames_folder / name))
        return place.is_relative_to(os.path.realpath(self.frames_folder)) and is_unchanged(place, known)


def _has_content(path: Path) -> bool:
    """Return True if a file exists and is not empty. Raises OSError where that cannot be found out."""
    try:
        return path.stat().st_size > 0
    except (FileNotFoundError, NotADirectoryError):
        return False
