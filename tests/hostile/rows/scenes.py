"""Odd scenes: each is rendered, or refused in one line that says why."""

from collections.abc import Iterable

from tests.hostile.case import Case
from tests.hostile.odd_runs import cases_of

TITLE = "odd scenes"
SEEN_BEFORE = 88


def cases() -> Iterable[Case]:
    return cases_of("odd_scenes")
