"""Traces beside the frames of a run that has finished none: removed where they are of no use to a later run."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterable
from pathlib import Path

from ..files import leads_elsewhere, remove
from .journal_folder import journal_path
from .runs import LiveRuns

AGREED = re.compile(r"found-[0-9a-f]{16}.*\.json")
"""Name of a file with numbers on which runs agree: without a frame that was made by them they are found again."""


def missing_folders(folders: Iterable[Path]) -> list[Path]:
    """Return those of the folders, and of the folders that they are to lie in, that do not exist; inner ones first."""
    found = {parent for folder in folders for parent in (folder, *folder.parents) if not parent.exists()}
    return sorted(found, key=lambda path: len(path.parts), reverse=True)


def remove_leftovers(frames_folder: Path) -> None:
    """Remove the journal beside the frames in this folder if it tells of no frame and no run is at work. Errors are
    ignored.
    """
    journal = journal_path(frames_folder)
    if leads_elsewhere(journal):
        return
    with contextlib.suppress(OSError):
        runs = LiveRuns(journal)
        runs.clear(own="")
        left = list(journal.iterdir())
        if all(AGREED.fullmatch(path.name) for path in left):
            for path in left:
                remove(path)
            journal.rmdir()


def remove_empty(folders: Iterable[Path]) -> None:
    """Remove those of the folders, inner ones first, that are empty. Errors are ignored."""
    for folder in folders:
        with contextlib.suppress(OSError):
            folder.rmdir()
