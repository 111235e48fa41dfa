"""Names of the files in folders, each folder read once: of a million planned files, few exist as a rule."""

from __future__ import annotations

import os
import unicodedata
from pathlib import Path


class Listing:
    """Folders as they are when they are first asked about."""

    def __init__(self) -> None:
        self._names: dict[str, set[str] | None] = {}

    def may_hold(self, path: Path) -> bool:
        """Tell whether something may have been under this path; False is certain.

        Drives differ in whether capital letters and the ways to write an accent make two names of one; here they make
        none, and whoever has to know looks at the file.
        """
        folder, name = os.path.split(path)
        if folder not in self._names:
            self._names[folder] = _names_in(folder)
        names = self._names[folder]
        return names is None or _plain(name) in names


def _names_in(folder: str) -> set[str] | None:
    """Return what lies in a folder by its plain names; None where it cannot be looked at."""
    try:
        with os.scandir(folder or os.curdir) as entries:
            return {_plain(entry.name) for entry in entries}
    except (FileNotFoundError, NotADirectoryError):
        return set()
    except OSError:
        return None


def _plain(name: str) -> str:
    return name.lower() if name.isascii() else unicodedata.normalize("NFC", name).casefold()
