"""One attempt to break a promise: its name, and the check that raises AssertionError where that succeeds."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

PROMISED = {
    "options": 299,
    "files": 279,
    "paths": 299,
    "names": 158,
    "kills": 39,
    "faults": 19,
    "claims": 88,
    "scenes": 88,
    "scripts": 1,
}
"""How many cases a row has at least: those of the first round, and 100 more in each of the first four."""

ROWS_FOLDER = Path(__file__).with_name("rows")


@dataclass(frozen=True)
class Case:
    """check gets a fresh private folder, and raises AssertionError with a message that says which promise is broken."""

    name: str
    check: Callable[[Path], None]


@dataclass(frozen=True)
class Row:
    """Cases of one kind. seen_before is how many of the kind were tried by hand in the first round."""

    name: str
    title: str
    seen_before: int
    cases: tuple[Case, ...]


def row_names() -> list[str]:
    return sorted(path.stem for path in ROWS_FOLDER.glob("*.py") if not path.stem.startswith("_"))


def load_row(name: str) -> Row:
    """The row of a module in `rows`: its TITLE, SEEN_BEFORE and cases(). Raises ValueError where two cases share a
    name, for then a failure would not say which it is, and where there are fewer than promised."""
    module = importlib.import_module(f"tests.hostile.rows.{name}")
    found: Iterable[Case] = module.cases()
    cases = tuple(found)
    names = [case.name for case in cases]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"row {name} has several cases called {', '.join(map(repr, twice))}")
    if len(cases) < PROMISED[name]:
        raise ValueError(f"row {name} has {len(cases)} cases, and {PROMISED[name]} are promised")
    return Row(name, module.TITLE, module.SEEN_BEFORE, cases)
