"""Odd scenes: each is rendered, or refused in one line that says why."""

from collections.abc import Iterable
from itertools import chain

from tests.hostile.case import Case
from tests.hostile.odd_runs import cases_of

TITLE = "odd scenes"
SEEN_BEFORE = 88

MODULES = ("odd_cameras", "odd_geometry", "odd_materials", "odd_settings")


def cases() -> Iterable[Case]:
    return chain.from_iterable(map(cases_of, MODULES))
