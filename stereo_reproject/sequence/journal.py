"""What is known of an animation's frames, in a folder beside them, so that any process can go on with them.

0001.json       a finished frame: by what settings and of which scene, its files with their checksums, its figures
0001.claim.1    the frame is being rendered by the run that is named in it; of several, the highest number holds it
.NAME.tmp       a file that is being written and will be called NAME
run-TOKEN       a run at work: where, on which frames, by what settings and of which scene, and a number that counts up
                as long as it lives
movie-SHA.json  a movie that was made of the frames, by its checksum: of which frames, and where it was put
found-KEY.json  what one frame has found, and others go by: what its source eye has cost, for one

Each is a small file of its own, which appears whole or may be doubted by whoever reads it. So several processes, on
several machines with a shared drive, need no locks, which some drives do not have, and no clocks that agree: a file is
made by one of them alone (O_EXCL), and whether a run lives is told by whether its number still changes while one looks
on. A frame's record is written after its files, and its claim is removed after that. A run that was thought dead and
wakes up finds its claim gone or passed on, and leaves the frame alone. What dead runs have left is removed by the next.

Others may write into the folder, and a drive may damage it: only regular files of a size that ours have are read, and
no more is taken from them than what ours say.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import math
import os
import re
import time
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from io import BufferedReader
from pathlib import Path
from typing import Any

from ..errors import BadInputError
from ..files import (
    UnusableFileError,
    flush_folder,
    is_regular,
    leads_elsewhere,
    open_regular,
    read_small,
    remove,
    to_json,
    write_json,
    write_new,
)
from ..settings.animation import read_frames, spelled
from ..settings.frame import MAX_FRAME
from .frame_record import RECORD_BYTES, Record, read_record
from .runs import CLAIM, TOKEN, Runs

JOURNAL = "journal"
"""The folder, in the one that the frames are in."""

NOTE_BYTES = 1 << 16
"""What is found for others takes at most."""

MOVIE_NOTE_BYTES = 1 << 23
"""What is noted of a movie takes at most: its frames are named."""

ANNOUNCED_LENGTH = 1000
"""Characters in which a run announces its frames; of those that take more, only the first and the last."""

FOUND_LOOKS = 20
FOUND_SECONDS = 0.05
"""How often, and how far apart, a file is looked at that another run has just made."""
NO_RECORD = (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError)
"""What comes of reading something else as one."""


class FrameState(Enum):
    """What there is of a frame."""

    WHOLE = "there already"
    MISSING = "missing"
    DAMAGED = "damaged"
    UNKNOWN = "not in the journal"
    OTHER_SETTINGS = "of other settings"
    OTHER_SCENE = "of another scene"


@dataclass(frozen=True)
class Fingerprints:
    """What frames must have in common to belong together: settings as one digest, the scene by kind of datablock."""

    settings: str
    scene: Mapping[str, str]

    def state_of(self, record: Record | Fingerprints) -> FrameState:
        """What they say of a frame, whatever has become of its files; or of all frames of a run that has others."""
        if dict(record.scene) != dict(self.scene):
            return FrameState.OTHER_SCENE
        return FrameState.WHOLE if record.settings == self.settings else FrameState.OTHER_SETTINGS

    def changed(self, record: Record | Fingerprints) -> list[str]:
        """The kinds of datablocks in which the record's scene differs."""
        kinds = dict.fromkeys((*self.scene, *record.scene))
        return [kind for kind in kinds if self.scene.get(kind) != record.scene.get(kind)]


@dataclass(frozen=True)
class MovieNote:
    """What is known of a movie: the frames that it was made of; None if an earlier version has made it."""

    frames: frozenset[int] | None


@dataclass(frozen=True)
class OtherRun:
    """A run that may be at work: its token, the frames that it has announced, and what they have in common."""

    token: str
    frames: frozenset[int]
    wanted: Fingerprints


def digest(values: Any) -> str:
    """Of anything that is JSON."""
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()


def checksum(path: Path) -> dict[str, Any]:
    """A file's size and SHA-256, as records have them. Raises OSError."""
    with open_regular(path, follow=True) as file:
        return _checksum_of(file)


def _checksum_of(file: BufferedReader) -> dict[str, Any]:
    return {"bytes": os.fstat(file.fileno()).st_size, "sha256": hashlib.file_digest(file, "sha256").hexdigest()}


class Journal:
    """The journal of the frames in a folder; name is what their files' names have in common, as Blender's output path
    has it, and tells them from other frames there. The attribute is so as every drive can have it."""

    def __init__(self, frames_folder: Path, name: str = "") -> None:
        self.frames_folder = frames_folder
        self.folder = frames_folder / JOURNAL
        self.runs = Runs(self.folder)
        plain = name.replace("#", "")
        self.name = re.sub(r"[^A-Za-z0-9._-]+", "_", plain)
        if self.name != plain:
            # Two that differ only in what not every drive can have are two all the same.
            self.name += f"{digest(plain)[:6]}_"
        self._doubts: dict[str, None] = {}
        self._told: set[str] = set()

    def make(self) -> None:
        """Raises OSError, and BadInputError where a link is in its place: what dead runs have left is removed there."""
        self.folder.mkdir(exist_ok=True)
        flush_folder(self.frames_folder)
        if leads_elsewhere(self.folder):
            raise BadInputError(f"{self.folder} is a link to another folder: remove it, or name another for the frames")

    def remove_empty(self) -> None:
        """Leave no folder behind in which there is nothing."""
        with contextlib.suppress(OSError):
            self.folder.rmdir()

    def record(self, frame: int) -> Record | None:
        """What is recorded of a frame; None where there is nothing, or nothing that can be read. Raises OSError."""
        path = self._record_path(frame)
        try:
            record = read_record(json.loads(read_small(path, RECORD_BYTES)))
            if record.frame == frame:
                return record
            if path.stem.endswith(f"{record.frame:04d}"):
                # It is of other frames, whose name goes on with digits.
                return None
            why = f"it is of frame {record.frame}"
        except (FileNotFoundError, NotADirectoryError):
            return None
        except UnusableFileError as error:
            why = str(error.strerror)
        except NO_RECORD as error:
            # What Python's own reader of JSON says is of no use to anybody.
            why = "it is not whole" if isinstance(error, UnicodeError | json.JSONDecodeError) else str(error)
        self._doubt(f"{path} is no record that can be read ({why}): frame {frame} counts as not rendered")
        return None

    def has_record(self, frame: int) -> bool:
        """Whether there is one, readable or not."""
        return os.path.lexists(self._record_path(frame))

    def records(self, frames: Iterable[int] | None = None) -> list[Record]:
        """Those of these frames, or all that are there, in order."""
        found = (self.record(frame) for frame in (self._recorded() if frames is None else frames))
        return [record for record in found if record is not None]

    def known_frames(self) -> set[int]:
        """Frames of which there is a record, or a claim, by one look at the folder. Raises OSError."""
        pattern = re.compile(re.escape(self.name) + r"(\d{4,})(?:\.json|\.claim\..*)", re.IGNORECASE)
        try:
            found = (pattern.fullmatch(path.name) for path in self.folder.iterdir())
            return {int(match[1]) for match in found if match}
        except (FileNotFoundError, NotADirectoryError):
            return set()

    def doubts(self) -> list[str]:
        """Return a line for each record that was passed over since the last call: which, and why."""
        new = [line for line in self._doubts if line not in self._told]
        self._told.update(new)
        return new

    def _doubt(self, line: str) -> None:
        self._doubts[line] = None

    def forget(self, frame: int) -> None:
        """Remove a frame's record: its files are about to be replaced. Raises OSError."""
        remove(self._record_path(frame))

    def write(self, record: Record) -> None:
        """Raises OSError."""
        self._write_whole(self._record_path(record.frame), asdict(record))

    def state(self, frame: int, files: Collection[Path], wanted: Fingerprints) -> FrameState:
        """What there is of a frame that is to be written to these files. Raises OSError."""
        state = self._state(frame, files, wanted)
        if state not in (FrameState.UNKNOWN, FrameState.DAMAGED):
            return state
        # Another run may be putting it in its place right now, one file after the other and its record last.
        return FrameState.MISSING if self._is_claimed(frame) else self._state(frame, files, wanted)

    def _state(self, frame: int, files: Collection[Path], wanted: Fingerprints) -> FrameState:
        record = self.record(frame)
        if record is None:
            there = any(_has_content(path) for path in files)
            return FrameState.UNKNOWN if there or self.has_record(frame) else FrameState.MISSING
        state = wanted.state_of(record)
        if state is not FrameState.WHOLE:
            return state
        # By another output path, the same frame is called otherwise.
        asked = {path.relative_to(self.frames_folder).as_posix() for path in files}
        return self._state_of_files(record) if asked <= record.files.keys() else FrameState.MISSING

    def _state_of_files(self, record: Record) -> FrameState:
        worst = FrameState.WHOLE
        for name, known in record.files.items():
            try:
                if not self._is_still(name, known):
                    worst = FrameState.DAMAGED
            except UnusableFileError:
                worst = FrameState.DAMAGED
            except (FileNotFoundError, NotADirectoryError):
                return FrameState.MISSING
        return worst

    def _is_still(self, name: str, known: Mapping[str, Any]) -> bool:
        """Whether a file is as it was recorded. Not one that a link leads to elsewhere, whatever that holds."""
        place = Path(os.path.realpath(self.frames_folder / name))
        if not place.is_relative_to(os.path.realpath(self.frames_folder)):
            return False
        with open_regular(place) as file:
            # The size is told at once, the checksum takes a look at every byte.
            return os.fstat(file.fileno()).st_size == known["bytes"] and _checksum_of(file) == known

    def take(self, frame: int, token: str) -> int | None:
        """Claim a frame for a run: the claim's number, or None where a run that lives has it. Raises OSError."""
        held = self._claims(frame)
        if self._is_held(held):
            return None
        number = held[-1][0] + 1 if held else 1
        path = self.folder / f"{self._stem(frame)}{CLAIM}{number}"
        try:
            write_new(path, token)
        except FileExistsError:
            return None
        if any(self.runs.lives(self._holder(other)) for _, other in self._claims(frame) if other != path):
            # What was there when we looked had been given free since, and was claimed anew under another number.
            remove(path)
            return None
        return number

    def holder(self, frame: int) -> str | None:
        """The token of the run that has claimed a frame, dead or alive; None where none has. Raises OSError."""
        held = self._claims(frame)
        return self._holder(held[-1][1]) if held else None

    def holds(self, frame: int, number: int, token: str) -> bool:
        """Whether a run still has the claim that it took: nobody has thought it dead meanwhile. Raises OSError."""
        held = self._claims(frame)
        return bool(held) and held[-1][0] == number and self.holder(frame) == token

    def release(self, frame: int, number: int, token: str) -> None:
        """Give a frame free, with all earlier claims to it, if the run still has it. Raises OSError."""
        if self.holds(frame, number, token):
            for _, path in self._claims(frame):
                # What else is called so is not ours to remove.
                if is_regular(path):
                    remove(path)

    @contextlib.contextmanager
    def movie_noted(self, made: Path, place: Path, frames: Collection[int]) -> Iterator[None]:
        """Note what a movie was made of before it is put in its place, which is done within; afterwards remove the
        notes of movies that are gone, or are others by now. Where nothing can be noted, later runs do not know the
        movie. Raises OSError where it cannot be read.
        """
        known = checksum(made)
        note = self._movie_note_path(known)
        values = {"of": self.name, "frames": spelled(frames), "file": self._told_place(place), **known}
        with contextlib.suppress(OSError):
            self._write_whole(note, values)
        yield
        with contextlib.suppress(OSError):
            for other in self.folder.glob("movie-*.json"):
                if self._is_outlived(other):
                    remove(other)
            if not note.exists() and checksum(place) == known:
                # Another run has found the note and no such movie.
                self._write_whole(note, values)

    def movie_note(self, path: Path) -> MovieNote | None:
        """What is known of a file if it is a movie that was made of the frames, and still as it was then; None where it
        is not. Raises OSError."""
        # As a rule there is one, or none: what is to be read twice is not read at all.
        if not any(self.folder.glob("movie-*.json")):
            return None
        try:
            known = checksum(path)
            noted = json.loads(read_small(self._movie_note_path(known), MOVIE_NOTE_BYTES))
            if {**noted, "of": self.name, **known} != noted:
                return None
            return MovieNote(frozenset(read_frames(noted["frames"])) if "frames" in noted else None)
        except (FileNotFoundError, UnusableFileError, BadInputError, *NO_RECORD):
            return None

    def _movie_note_path(self, known: Mapping[str, Any]) -> Path:
        return self.folder / f"movie-{known['sha256'][:16]}.json"

    def _told_place(self, path: Path) -> str:
        """A path as other machines may find it, too, which have the drive elsewhere."""
        try:
            # Folders as they are: a way up from a link is one from where it leads.
            place = os.path.relpath(path.parent.resolve() / path.name, self.frames_folder.resolve())
            return Path(place).as_posix()
        except ValueError:
            # On another drive of Windows.
            return str(path)

    def _is_outlived(self, note: Path) -> bool:
        """Whether a movie is no longer where it was put. Earlier versions did not note where."""
        try:
            noted = json.loads(read_small(note, MOVIE_NOTE_BYTES))
            place = self.frames_folder / noted["file"]
            if noted["of"] != self.name or not place.parent.is_dir():
                return False
            if not place.exists():
                return True
            return place.stat().st_size != noted["bytes"] or checksum(place)["sha256"] != noted["sha256"]
        except (OSError, *NO_RECORD):
            return False

    def announcement(self, frames: Collection[int], wanted: Fingerprints) -> dict[str, Any]:
        """What a run lets others know before its first frame: see `run_at_work`."""
        text = spelled(frames)
        if len(text) > ANNOUNCED_LENGTH:
            text = f"{min(frames)}-{max(frames)}"
        return {"of": self.name, "frames": text, **asdict(wanted)}

    def other_runs(self, own: str) -> list[OtherRun]:
        """The other runs that may be at work on frames of this name, as far as they can be read. Raises OSError."""
        found = []
        for token, facts in self.runs.announced(but=own).items():
            with contextlib.suppress(BadInputError, *NO_RECORD):
                wanted = Fingerprints(str(facts["settings"]), dict(facts["scene"]))
                if facts["of"] == self.name:
                    found.append(OtherRun(token, frozenset(read_frames(facts["frames"])), wanted))
        return found

    def found(self, key: str) -> dict[str, float] | None:
        """What is there already under a key; None where there is nothing, or nothing that can be read."""
        with contextlib.suppress(OSError, *NO_RECORD):
            read = json.loads(read_small(self.folder / f"found-{key}.json", NOTE_BYTES))
            if all(type(value) in (int, float) and 0 <= value < math.inf for value in read.values()):
                return {name: float(value) for name, value in read.items()}
        return None

    def agree_on(self, key: str, values: Mapping[str, float]) -> dict[str, float]:
        """These, unless others were there before: of several runs that begin at once, one is heard. Raises OSError."""
        path = self.folder / f"found-{key}.json"
        try:
            write_new(path, to_json(values))
        except FileExistsError:
            for _ in range(FOUND_LOOKS):
                known = self.found(key)
                if known is not None:
                    return known
                # Made a moment ago, and not yet written.
                time.sleep(FOUND_SECONDS)
            # By a run that died just then.
            self._write_whole(path, values)
        return dict(values)

    def _write_whole(self, path: Path, values: Mapping[str, Any]) -> None:
        if path.is_dir() and not path.is_symlink():
            raise IsADirectoryError(errno.EISDIR, f"{path.name} in {JOURNAL} is a folder: move it", str(path))
        write_json(path, values)

    def _is_claimed(self, frame: int) -> bool:
        return self._is_held(self._claims(frame))

    def _is_held(self, claims: Sequence[tuple[int, Path]]) -> bool:
        return bool(claims) and self.runs.lives(self._holder(claims[-1][1]))

    def _record_path(self, frame: int) -> Path:
        return self.folder / f"{self._stem(frame)}.json"

    def _stem(self, frame: int) -> str:
        return f"{self.name}{frame:04d}"

    def _recorded(self) -> Iterator[int]:
        pattern = re.compile(re.escape(self.name) + r"([0-9]{4,9})\.json")
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            found = [match for path in self.folder.iterdir() if (match := pattern.fullmatch(path.name))]
            for match in found:
                if not self._is_canonical(match):
                    self._doubt_twin(self.folder / match.string, int(match[1]))
            frames = (int(match[1]) for match in found if self._is_canonical(match))
            yield from sorted(frame for frame in frames if frame <= MAX_FRAME)

    def _is_canonical(self, match: re.Match[str]) -> bool:
        return match.string == self._record_path(int(match[1])).name

    def _doubt_twin(self, path: Path, frame: int) -> None:
        """Name a second record of a frame. With another zero it may also be one of other frames, whose files tell."""
        with contextlib.suppress(OSError, *NO_RECORD):
            files = read_record(json.loads(read_small(path, RECORD_BYTES))).files
            if any(Path(name).name.startswith(self._stem(frame)) for name in files):
                self._doubt(f"{path} is passed over: the record of frame {frame} is {self._record_path(frame).name}")

    def _claims(self, frame: int) -> list[tuple[int, Path]]:
        """A frame's claims by their numbers, the one that holds it last."""
        pattern = re.compile(re.escape(f"{self._stem(frame)}{CLAIM}") + r"([1-9][0-9]{0,17})")
        found = ((pattern.fullmatch(path.name), path) for path in self.folder.glob(f"{self._stem(frame)}{CLAIM}*"))
        return sorted((int(match[1]), path) for match, path in found if match)

    def _holder(self, claim: Path) -> str:
        try:
            token = read_small(claim, len("0123456789abcdef")).decode("ascii", "replace")
        except (FileNotFoundError, UnusableFileError):
            # Given free, or nothing that a run has made.
            return ""
        # Without a name in it, it was made a moment ago, or by a run that died just then, or its drive lost power.
        return token if TOKEN.fullmatch(token) else claim.name


def _has_content(path: Path) -> bool:
    try:
        return path.stat().st_size > 0
    except (FileNotFoundError, NotADirectoryError):
        return False
