"""Kills: each is resumed, and what comes of it is compared with what an uninterrupted run makes."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from ..case import Case
from ..program import DEMO, PAIR, SMALLEST, assert_done, assert_nothing_left, run_program

TITLE = "kills, each resumed and compared"
SEEN_BEFORE = 39


def _unkilled(folder: Path) -> None:
    output = folder / "out"
    assert_done(run_program("render", DEMO, "--output", output, *SMALLEST))
    assert_nothing_left(folder, "out", *(f"out/{name}" for name in PAIR))


def cases() -> Iterable[Case]:
    yield Case("a run that nobody kills", _unkilled)
