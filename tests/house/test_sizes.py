"""Functions and classes stay small enough to be read at once; each exception has a reason, and goes when it can."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = ("stereo_reproject", "operators")

MAX_FUNCTION_LINES = 60
MAX_PARAMETERS = 7
MAX_CLASS_LINES = 150

FUNCTION, PARAMETERS, CLASS = "lines of the function", "parameters", "lines of the class"

EXCEPTIONS = {
    ("stereo_reproject/blender/api.py", "render_animation", PARAMETERS): "public: scripts call it by these keywords",
}
"""By file, qualified name and rule: why it may be larger. One that is no longer needed fails the test."""


@dataclass(frozen=True)
class Excess:
    """A function or class that breaks a rule: file relative to the root, qualified name, rule, and its size."""

    file: str
    name: str
    rule: str
    size: int

    @property
    def key(self) -> tuple[str, str, str]:
        return self.file, self.name, self.rule


Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


def definitions(node: ast.AST, within: str = "") -> Iterator[tuple[str, Definition]]:
    """All functions and classes with their qualified names, nested ones too."""
    for child in ast.iter_child_nodes(node):
        name = within
        if isinstance(child, Definition):
            name = f"{within}.{child.name}".lstrip(".")
            yield name, child
        yield from definitions(child, name)


def docstring_lines(node: Definition) -> int:
    """Lines of the docstrings of a function or class and of all within it."""
    found = [inner for inner in ast.walk(node) if isinstance(inner, Definition) and ast.get_docstring(inner)]
    texts = [inner.body[0] for inner in found]
    return sum((text.end_lineno or text.lineno) - text.lineno + 1 for text in texts)


def sizes(node: Definition) -> Iterator[tuple[str, int, int]]:
    """Rule, size and limit. Lines count without decorators and docstrings, for nobody shall leave out what a reader
    needs to fit in; parameters count without self and cls."""
    lines = (node.end_lineno or node.lineno) - node.lineno + 1 - docstring_lines(node)
    if isinstance(node, ast.ClassDef):
        yield CLASS, lines, MAX_CLASS_LINES
        return
    yield FUNCTION, lines, MAX_FUNCTION_LINES
    arguments = node.args
    named = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs, arguments.vararg, arguments.kwarg]
    count = sum(one is not None and one.arg not in ("self", "cls") for one in named)
    yield PARAMETERS, count, MAX_PARAMETERS


def excesses(root: Path) -> list[Excess]:
    return [
        Excess(str(file.relative_to(root)), name, rule, size)
        for folder in SHIPPED
        for file in sorted((root / folder).rglob("*.py"))
        for name, node in definitions(ast.parse(file.read_text(encoding="utf-8")))
        for rule, size, limit in sizes(node)
        if size > limit
    ]


def test_functions_and_classes_are_small():
    allowed = EXCEPTIONS.keys()
    assert [excess for excess in excesses(ROOT) if excess.key not in allowed] == []


def test_each_exception_is_needed():
    allowed = EXCEPTIONS.keys()
    assert allowed - {excess.key for excess in excesses(ROOT)} == set()


LONG_CLASS = "class A:\n" + "    x = 1\n" * MAX_CLASS_LINES
LONG_FUNCTION = "def f():\n" + "    pass\n" * MAX_FUNCTION_LINES


@pytest.mark.parametrize(
    ("source", "found"),
    [
        (LONG_CLASS, [("A", CLASS, MAX_CLASS_LINES + 1)]),
        (LONG_CLASS.replace("    x = 1\n", "", 1), []),
        (LONG_FUNCTION, [("f", FUNCTION, MAX_FUNCTION_LINES + 1)]),
        (LONG_FUNCTION.replace("    pass\n", "", 1), []),
        ("def f(a, b, c, d, e, f, g): pass", []),
        ("def f(a, /, b, c, *d, e, f, g, **h): pass", [("f", PARAMETERS, 8)]),
        ("class A:\n    def f(self, a, b, c, d, e, f, g): pass", []),
        ("class A:\n    async def f(self, a, b, c, d, e, f, *, g, h): pass", [("A.f", PARAMETERS, 8)]),
        ("def f():\n    if x:\n        def g(a, b, c, d, e, f, g, h): pass", [("f.g", PARAMETERS, 8)]),
    ],
)
def test_the_rules_can_fail(tmp_path, source, found):
    path = tmp_path / "operators" / "module.py"
    path.parent.mkdir()
    path.write_text(source, encoding="utf-8")
    assert [(excess.name, excess.rule, excess.size) for excess in excesses(tmp_path)] == found
