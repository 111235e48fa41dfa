"""Output paths and environments: a folder is the folder of that very name, whatever the name holds; what is in its
place stays or is replaced, never followed; and what is set around the program changes no picture and no word."""

from __future__ import annotations

from collections.abc import Iterable

from tests.hostile.case import Case
from tests.hostile.rows import _environments, _in_place, _names

TITLE = "output paths and environments"
SEEN_BEFORE = 199


def cases() -> Iterable[Case]:
    yield from _names.cases()
    yield from _in_place.cases()
    yield from _environments.cases()
