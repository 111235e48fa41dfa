"""Names of the files in folders, each folder read once: of a million planned files, few exist as a rule."""

from __future__ import annotations

import os
import unicodedata
from pathlib import Path


class Listing:
    """A quick test if files exist, for very many paths: each folder is read once, when it is first asked about, and
    later changes are not seen."""

    def __init__(self) -> None:
        self._names: dict[str, set[str] | None] = {}

    def may_hold(self, path: Path) -> bool:
        """Return False if no file was at this path for certain; True if there may have been one.

        Names that differ only in capital letters or in how an accent is written count as one name here, because on some
        drives they are. The caller must look at the file itself to be sure.
        """
        folder, name = os.path.split(path)
        if folder not in self._names:
            self._names[folder] = _names_in(folder)
        names = self._names[folder]
        return names is None or _plain(name) in names


def _names_in(folder: str) -> set[str] | None:
    """Return the names in a folder, as `_plain` gives them; None where it cannot be read, and an empty set where it is
    missing."""
    try:
        with os.scandir(folder or os.curdir) as entries:
            return {_plain(entry.name) for entry in entries}
    except (FileNotFoundError, NotADirectoryError):
        return set()
    except OSError:
        return None


def _plain(name: str) -> str:
    """Return a name in a form that is the same for capital and small letters and for all ways to write an accent."""
    return name.lower() if name.isascii() else unicodedata.normalize("NFC", name).casefold()
