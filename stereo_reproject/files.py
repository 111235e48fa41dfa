"""Files onto the disk and into their places, as each system wants it."""

from __future__ import annotations

import contextlib
import os
import sys
import time
from pathlib import Path

HELD_SECONDS = 2.0
RETRY_SECONDS = 0.05

APPLE_DOUBLE = "._"
"""How the names of files begin that macOS puts beside others, on drives that cannot keep what it knows of them."""


def put_in_place(made: Path, place: Path) -> Path:
    """Give a file its final name, under which it takes the place of what was there. Raises OSError.

    On Windows a scanner, an indexer or a viewer may hold either file for a moment, and nobody can rename it meanwhile.
    """
    deadline = time.monotonic() + HELD_SECONDS
    while True:
        try:
            return made.replace(place)
        except PermissionError:
            if sys.platform != "win32" or time.monotonic() >= deadline:
                raise
            time.sleep(RETRY_SECONDS)


def sync(descriptor: int) -> None:
    """Have an open file on the disk. Raises OSError."""
    if sys.platform == "darwin":
        import fcntl

        # There, fsync hands a file over to the drive, which may keep it in its memory for long; and network drives
        # know nothing else.
        with contextlib.suppress(OSError):
            fcntl.fcntl(descriptor, fcntl.F_FULLFSYNC)
            return
    os.fsync(descriptor)


def made_in(folder: Path) -> list[Path]:
    """What a program has made in a folder, by name, and nothing that the system has put beside."""
    return sorted(path for path in folder.iterdir() if not path.name.startswith(APPLE_DOUBLE))
