"""Records of finished frames in the journal: read, written, listed, and doubted where they cannot be read."""

from __future__ import annotations

import contextlib
import json
import os
import re
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path

from ..files import UnusableFileError, read_small, remove
from ..settings.frame import MAX_FRAME
from .frame_record import RECORD_BYTES, Record, read_record
from .journal_folder import UNREADABLE_ERRORS, JournalFolder


class RecordStore:
    """The records of finished frames of one name: one JSON file for each in the journal. A file that cannot be read
    counts as missing and is remembered for `new_doubts`."""

    def __init__(self, folder: JournalFolder) -> None:
        self._folder = folder
        self._doubts: dict[str, None] = {}
        self._reported: set[str] = set()

    def read(self, frame: int) -> Record | None:
        """Return the record of a frame; None where there is none, or none that can be read (see `new_doubts`). Raises
        OSError where the drive fails."""
        path = self._path(frame)
        try:
            record = read_record(json.loads(read_small(path, RECORD_BYTES)))
            if record.frame == frame:
                return record
            if path.stem.endswith(f"{record.frame:04d}"):
                # It belongs to other frames, whose name ends in digits.
                return None
            why = f"it is of frame {record.frame}"
        except (FileNotFoundError, NotADirectoryError):
            return None
        except UnusableFileError as error:
            why = str(error.strerror)
        except UNREADABLE_ERRORS as error:
            # The messages of Python's JSON reader mean nothing to a user.
            why = "it is not whole" if isinstance(error, UnicodeError | json.JSONDecodeError) else str(error)
        self._doubt(f"{path} is no record that can be read ({why}): frame {frame} counts as not rendered")
        return None

    def has_file(self, frame: int) -> bool:
        """Return True if a file has the name of the frame's record, readable or not."""
        return os.path.lexists(self._path(frame))

    def read_all(self, frames: Iterable[int] | None = None) -> list[Record]:
        """Return the records of these frames, in their order; without `frames`, all records by rising frame. Frames
        without a record are left out. Raises OSError."""
        found = (self.read(frame) for frame in (self._frames() if frames is None else frames))
        return [record for record in found if record is not None]

    def times(self) -> dict[int, int]:
        """Return by frame when its record was written, in nanoseconds of the drive's clock; of a drive that fails, what
        could be read."""
        found: dict[int, int] = {}
        with contextlib.suppress(OSError):
            found.update((frame, self._path(frame).stat().st_mtime_ns) for frame in self._frames())
        return found

    def new_doubts(self) -> list[str]:
        """Return warnings about records that could not be used, each with its path and the reason; only those found
        since the last call."""
        new = [line for line in self._doubts if line not in self._reported]
        self._reported.update(new)
        return new

    def write(self, record: Record) -> None:
        """Write a frame's record; an earlier one is replaced. Raises OSError."""
        self._folder.write(self._path(record.frame), asdict(record))

    def remove(self, frame: int) -> None:
        """Remove a frame's record, if there is one. To be done before its files are replaced, which it would describe
        wrongly. Raises OSError."""
        remove(self._path(frame))

    def _doubt(self, line: str) -> None:
        """Remember a warning about a record, for `new_doubts`."""
        self._doubts[line] = None

    def _path(self, frame: int) -> Path:
        """Return the path of a frame's record."""
        return self._folder.path / f"{self._folder.stem(frame)}.json"

    def _frames(self) -> Iterator[int]:
        """Yield the frames that have a record, in rising order. A second file for the same frame, whose number is
        written with another count of zeros, is remembered as a doubt."""
        pattern = re.compile(re.escape(self._folder.name) + r"([0-9]{4,9})\.json")
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            found = [match for path in self._folder.path.iterdir() if (match := pattern.fullmatch(path.name))]
            for match in found:
                if not self._is_canonical(match):
                    self._doubt_twin(self._folder.path / match.string, int(match[1]))
            frames = (int(match[1]) for match in found if self._is_canonical(match))
            yield from sorted(frame for frame in frames if frame <= MAX_FRAME)

    def _is_canonical(self, match: re.Match[str]) -> bool:
        """Return True if the file name that matched is the one that a record of its frame has, with no zeros too
        many."""
        return match.string == self._path(int(match[1])).name

    def _doubt_twin(self, path: Path, frame: int) -> None:
        """Remember a doubt about `path`, a second record of a frame whose number has zeros too many. It may also be a
        record of frames of another name, which is no reason for a doubt; the names of its files decide."""
        with contextlib.suppress(OSError, *UNREADABLE_ERRORS):
            files = read_record(json.loads(read_small(path, RECORD_BYTES))).files
            if any(Path(name).name.startswith(self._folder.stem(frame)) for name in files):
                self._doubt(f"{path} is passed over: the record of frame {frame} is {self._path(frame).name}")
