"""Errors that may be shown in Blender's window can be translated: their text is no f-string, which nobody could look
up."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = ("stereo_reproject", "operators")

ERRORS = {"StereoReprojectError", "BadInputError", "OutputError", "OtherRunError", "WorkerCrashedError"}

NOT_IN_A_WINDOW = (
    "stereo_reproject/programs",
    "stereo_reproject/tradeoff",
    "stereo_reproject/report/chart_canvas.py",
    "stereo_reproject/blender/commands/price_list.py",
    "stereo_reproject/blender/api.py",
)
"""The command line, price lists and scripts: their errors are English."""


def untranslatable(tree: ast.Module) -> Iterator[int]:
    """Lines of errors whose text is made of parts before anyone could look it up."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in {*ERRORS, "Words"}:
            text = node.args[0] if node.args else None
            parts = text.values if isinstance(text, ast.BoolOp) else [text]
            if any(isinstance(part, (ast.JoinedStr, ast.BinOp)) for part in parts):
                yield node.lineno


def untranslatable_errors(root: Path) -> list[str]:
    files = [file for folder in SHIPPED for file in sorted((root / folder).rglob("*.py"))]
    names = {file: str(file.relative_to(root)) for file in files}
    return [
        f"{name}:{line}"
        for file, name in names.items()
        if not name.startswith(NOT_IN_A_WINDOW)
        for line in untranslatable(ast.parse(file.read_text(encoding="utf-8")))
    ]


def test_errors_in_a_window_can_be_looked_up():
    assert untranslatable_errors(ROOT) == []


def test_what_needs_no_words_is_there():
    assert [name for name in NOT_IN_A_WINDOW if not (ROOT / name).exists()] == []


@pytest.mark.parametrize(
    ("file", "source", "found"),
    [
        ("operators/a.py", 'raise BadInputError(f"{path} is gone")', True),
        ("operators/a.py", 'raise BadInputError(path + " is gone")', True),
        ("operators/a.py", 'raise StereoReprojectError(last_words or f"no movie: {status}")', True),
        ("operators/a.py", 'raise BadInputError(Words(f"{path} is gone"))', True),
        ("operators/a.py", 'raise BadInputError(Words("{path} is gone", path=f"{path}"))', False),
        ("operators/a.py", 'raise BadInputError("it is gone")', False),
        ("stereo_reproject/jobs/a.py", 'def f():\n    return OutputError(f"{path} is gone")', True),
        ("stereo_reproject/programs/a.py", 'raise BadInputError(f"{path} is gone")', False),
    ],
)
def test_the_rule_can_fail(tmp_path, file, source, found):
    path = tmp_path / file
    path.parent.mkdir(parents=True)
    path.write_text(source, encoding="utf-8")
    assert bool(untranslatable_errors(tmp_path)) == found
