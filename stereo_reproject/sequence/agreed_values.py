"""Numbers on which all runs of an animation agree: those that the first of them found."""

from __future__ import annotations

import contextlib
import json
import math
import time
from collections.abc import Mapping
from pathlib import Path

from ..files import read_small, to_json, write_new
from .journal_folder import UNREADABLE_ERRORS, JournalFolder

VALUES_BYTES = 1 << 16
"""Greatest size of a file of agreed values."""

READ_ATTEMPTS = 20
"""Number of times that a file is read which another run has just made, until its content is there."""

READ_INTERVAL_SECONDS = 0.05
"""Time between two such attempts."""


class AgreedValues:
    """Named numbers, not negative, by key: one JSON file for each key. Frames of all names share them."""

    def __init__(self, folder: JournalFolder) -> None:
        self._folder = folder

    def read(self, key: str) -> dict[str, float] | None:
        """Return the values of a key; None where there are none that can be read."""
        with contextlib.suppress(OSError, *UNREADABLE_ERRORS):
            read = json.loads(read_small(self._path(key), VALUES_BYTES))
            if all(type(value) in (int, float) and 0 <= value < math.inf for value in read.values()):
                return {name: float(value) for name, value in read.items()}
        return None

    def agree_on(self, key: str, values: Mapping[str, float]) -> dict[str, float]:
        """Return the values that another run has written for a key, or write and return these. Raises OSError."""
        path = self._path(key)
        try:
            write_new(path, to_json(values))
        except FileExistsError:
            for _ in range(READ_ATTEMPTS):
                known = self.read(key)
                if known is not None:
                    return known
                # Made a moment ago, and not yet written.
                time.sleep(READ_INTERVAL_SECONDS)
            # Its run died before it was written.
            self._folder.write(path, values)
        return dict(values)

    def _path(self, key: str) -> Path:
        return self._folder.path / f"found-{key}.json"
