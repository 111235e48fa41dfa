"""Odd names inside a .blend: all are rendered, and nothing is written outside of the output folder."""

from collections.abc import Iterable

from tests.hostile.case import Case
from tests.hostile.odd_runs import cases_of

TITLE = "names inside a .blend"
SEEN_BEFORE = 58


def cases() -> Iterable[Case]:
    return cases_of("odd_names")
