"""The record of a finished frame, and its reading from JSON that may be anything."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import PurePath, PurePosixPath, PureWindowsPath
from typing import Any

RECORD_SCHEMA = 1

RECORD_BYTES = 1 << 22
"""Greatest size of a record's file; ours have some thousand bytes."""


NAME_BYTES, NAMES_BYTES = 255, 1023
"""Greatest length of one file's or folder's name, and of a whole path: no path of Blender's is longer."""


@dataclass(frozen=True)
class Record:
    """The facts about one finished frame, as the journal keeps them.

    files has the size in bytes and the SHA-256 of each file, by its path from the frames' folder. settings and scene
    are those of `Fingerprints`. run is the token of the run that rendered the frame. figures are the measurements for
    the animation's report.
    """

    frame: int
    files: Mapping[str, Mapping[str, Any]]
    settings: str
    scene: Mapping[str, str]
    run: str
    figures: Mapping[str, Any]
    schema: int = RECORD_SCHEMA


def read_record(read: Any) -> Record:
    """Return a record from the content of a JSON file, which may be anything. Raises ValueError, with the reason in
    words, where a field is missing or of the wrong form.

    Only the names of the figures are checked here; `figures` checks their values when they are used.
    """
    if not isinstance(read, dict) or read.keys() != {field.name for field in fields(Record)}:
        raise ValueError("it has not the fields of a record")
    for name, is_as_it_should_be in _KINDS.items():
        if not is_as_it_should_be(read[name]):
            raise ValueError(f"its field {name!r} is not as it should be")
    outside = next((name for name in read["files"] if not is_confined(name)), None)
    if outside is not None:
        raise ValueError(f"it names {outside!r}, which is no file in its folder")
    return Record(**read)


def is_confined(name: str, *, windows: bool = os.name == "nt") -> bool:
    """Return True if a relative path, written with / between folders, leads to something below the folder that it
    starts from.

    windows says if the rules of Windows apply, where a backslash separates folders as well. A part ".." between
    backslashes is refused on every system, because the same journal may be read on Windows.
    """
    path: PurePath = PureWindowsPath(name) if windows else PurePosixPath(name)
    parts = re.split(r"[/\\]", name)
    in_place = not path.is_absolute() and not path.drive and not path.root
    return in_place and _can_be_there(name) and not {"", ".", ".."} & set(parts) and not (windows and ":" in name)


def _can_be_there(name: str) -> bool:
    """Return True if a drive can have a file of this name: not too long, and with no characters that cannot be in a
    name."""
    try:
        encoded = os.fsencode(name)
    except UnicodeEncodeError:
        return False
    longest = max(map(len, encoded.split(b"/")))
    return b"\0" not in encoded and longest <= NAME_BYTES and len(encoded) <= NAMES_BYTES


def _is_count(value: Any) -> bool:
    """Return True for a whole number that is not negative; True and False are none."""
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _is_text(value: Any) -> bool:
    """Return True for a text."""
    return isinstance(value, str)


def _are_texts(value: Any) -> bool:
    """Return True for a dict whose values are texts."""
    return isinstance(value, dict) and all(map(_is_text, value.values()))


def _are_files(value: Any) -> bool:
    """Return True for a dict, not empty, whose values are checksums."""
    return isinstance(value, dict) and bool(value) and all(map(_is_checksum, value.values()))


def _is_checksum(value: Any) -> bool:
    """Return True for a dict of the form that `checksum` returns."""
    known = isinstance(value, dict) and value.keys() == {"bytes", "sha256"}
    return known and _is_count(value["bytes"]) and _is_text(value["sha256"])


_KINDS: dict[str, Callable[[Any], bool]] = {
    "schema": lambda value: _is_count(value) and value == RECORD_SCHEMA,
    "frame": _is_count,
    "files": _are_files,
    "settings": _is_text,
    "scene": _are_texts,
    "run": _is_text,
    "figures": lambda value: isinstance(value, dict),
}
