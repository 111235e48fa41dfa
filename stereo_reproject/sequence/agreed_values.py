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
    """Numbers that the first run to find them writes into the journal, so that all runs use the same: one JSON file
    with named, non-negative numbers for each key. Animations of different names in one folder share them."""

    def __init__(self, folder: JournalFolder) -> None:
        self._folder = folder

    def read(self, key: str) -> dict[str, float] | None:
        """Return the numbers of a key by name; None where there are none yet or the file cannot be read."""
        with contextlib.suppress(OSError, *UNREADABLE_ERRORS):
            read = json.loads(read_small(self._path(key), VALUES_BYTES))
            if all(type(value) in (int, float) and 0 <= value < math.inf for value in read.values()):
                return {name: float(value) for name, value in read.items()}
        return None

    def agree_on(self, key: str, values: Mapping[str, float]) -> dict[str, float]:
        """Return the numbers that all runs are to use for a key: those that another run has written already, else
        `values`, which are written then. Waits a moment for a file that is just being written. Raises OSError."""
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
        """Return the path of the file with the values of a key."""
        return self._folder.path / f"found-{key}.json"
