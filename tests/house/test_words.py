"""Docstrings begin with what a thing is or does: a noun phrase, or a verb such as "Return"."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = ("stereo_reproject", "operators")

UNCLEAR = re.compile(r"(What|Whether|Where|How|The same|Of|As|Which|Who|When|Why|In|By|For|None|Nothing|Raises)\b")
"""First words that leave open what the thing itself is."""


def docstrings(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line and text of each docstring: of modules, classes, functions, and those below a constant or a field."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        for statement in body if isinstance(body, list) else ():
            if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
                text = statement.value.value
                if isinstance(text, str):
                    yield statement.lineno, text.strip()


def unclear_docstrings(root: Path) -> list[str]:
    return [
        f"{file.relative_to(root)}:{line} {text.splitlines()[0]}"
        for folder in SHIPPED
        for file in sorted((root / folder).rglob("*.py"))
        for line, text in docstrings(ast.parse(file.read_text(encoding="utf-8")))
        if UNCLEAR.match(text)
    ]


def test_docstrings_begin_with_the_thing_itself():
    assert unclear_docstrings(ROOT) == []


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ('"""What is done."""', True),
        ('"""Whole frames."""', False),
        ('def f():\n    """Whether it is so."""', True),
        ('def f():\n    """Return whether it is so."""', False),
        ('A = 1\n"""Of a tile."""', True),
        ('class A:\n    x: int\n    """Pixels of a tile."""', False),
        ('class A:\n    x: int\n    """The same for a tile."""', True),
    ],
)
def test_what_it_takes_for_unclear(tmp_path, source, found):
    (tmp_path / "operators").mkdir()
    (tmp_path / "operators" / "a.py").write_text(source, encoding="utf-8")
    assert bool(unclear_docstrings(tmp_path)) is found
