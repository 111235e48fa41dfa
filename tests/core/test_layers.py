"""Imports point one way: operators → stereo_reproject.blender → pipeline → numeric files → numpy."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ENGINE = "stereo_reproject"
BLENDER = f"{ENGINE}.blender"
OPERATORS = "operators"
BLENDER_MODULES = {"bpy", "bpy_extras", "bmesh", "mathutils", "gpu", "blf", "imbuf", "_cycles", "oslquery"}
# They need numpy alone, and of the engine nothing but each other and the words that all share.
NUMERIC = {
    "camera",
    "parallax",
    "grid",
    "warp",
    "rectified",
    "quads",
    "bands",
    "carrying",
    "holes",
    "lookup",
    "masks",
    "mirrors",
    "packing",
    "silhouettes",
    "reprojection",
    "pixel_filter",
    "composite",
    "fill",
    "accuracy",
    "metrics",
    "motion",
    "ranges",
    "effects",
    "effects_pass",
    "frustum",
    "probes",
    "risk",
    "refinement",
    "shown_materials",
    "heuristic",
    "defocus",
    "refracted",
    "thin",
    "label_places",
    "made_up",
    "animation_series",
    "delivery.anaglyph",
    "delivery.layouts",
    "delivery.matroska",
    "delivery.mp4",
    "delivery.splicing",
    "delivery.stereo_mode",
}
SHARED_WORDS = {"settings", "errors", "files", "passes"}
# Programs start there: they may reach for the layer above, inside the function that needs it.
ENTRIES = {f"{ENGINE}.cli", f"{ENGINE}.worker", f"{ENGINE}.writer"}


@dataclass(frozen=True)
class Import:
    file: str  # relative to the root of the checkout
    line: int
    module: str  # absolute, as seen from the root of the checkout
    relative: bool
    lazy: bool  # inside a function

    def __str__(self) -> str:
        return f"{self.file}:{self.line} imports {self.module}"


def module_of(file: Path, root: Path) -> str:
    parts = file.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported_modules(node: ast.Import | ast.ImportFrom, package: str) -> Iterator[str]:
    """`from a import b` may mean the module a.b, so it counts as both."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
        return
    base = node.module or ""
    if node.level:
        parents = package.split(".")
        parents = parents[: len(parents) - (node.level - 1)]
        base = ".".join([*parents, *filter(None, [node.module])])
    yield base
    yield from (f"{base}.{alias.name}" for alias in node.names)


def imports_of(file: Path, root: Path) -> Iterator[Import]:
    module = module_of(file, root)
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    tree = ast.parse(file.read_text(encoding="utf-8"))
    functions = (node for node in ast.walk(tree) if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)))
    in_functions = {child for function in functions for child in ast.walk(function)}
    for node in ast.walk(tree):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            relative = isinstance(node, ast.ImportFrom) and node.level > 0
            for name in imported_modules(node, package):
                yield Import(str(file.relative_to(root)), node.lineno, name, relative, node in in_functions)


def is_in(module: str, package: str) -> bool:
    return module == package or module.startswith(f"{package}.")


def offence(entry: Import, importer: str) -> str | None:
    """Which rule this import breaks, or None."""
    top = entry.module.partition(".")[0]
    own = is_in(entry.module, ENGINE) or is_in(entry.module, OPERATORS)
    if own and not entry.relative:
        return "absolute: inside Blender the package has another name"
    if is_in(importer, OPERATORS):
        return None
    if is_in(entry.module, OPERATORS):
        return "the engine does not know the operators"
    if is_in(importer, BLENDER):
        return None
    if top in BLENDER_MODULES:
        return f"only {BLENDER} and {OPERATORS} touch Blender"
    if is_in(entry.module, BLENDER) and not (importer in ENTRIES and entry.lazy):
        return f"{BLENDER} is above it"
    if importer.removeprefix(f"{ENGINE}.") in NUMERIC:
        return numeric_offence(entry.module, top)
    return None


def numeric_offence(module: str, top: str) -> str | None:
    if is_in(module, ENGINE):
        inner = module.removeprefix(ENGINE).removeprefix(".")
        fits = not inner or any(is_in(inner, allowed) for allowed in (*NUMERIC, *SHARED_WORDS))
        return None if fits else "above the numeric files"
    return None if top == "numpy" or top in sys.stdlib_module_names else "numeric files need numpy alone"


def offences(root: Path) -> list[str]:
    shipped = sorted(file for folder in (ENGINE, OPERATORS) for file in (root / folder).rglob("*.py"))
    found = {}  # one line per statement: `from a import b` was counted as a and as a.b
    for file in shipped:
        for entry in imports_of(file, root):
            reason = offence(entry, module_of(file, root))
            if reason:
                found.setdefault((entry.file, entry.line), f"{entry}: {reason}")
    return list(found.values())


def test_imports_point_one_way():
    assert offences(ROOT) == []


@pytest.mark.parametrize(
    ("file", "source", "fits"),
    [
        ("stereo_reproject/warp.py", "from .blender import render", False),
        ("stereo_reproject/warp.py", "from . import blender", False),
        ("stereo_reproject/warp.py", "from .pipeline import render_stereo_frame", False),
        ("stereo_reproject/warp.py", "import scipy.ndimage", False),
        (
            "stereo_reproject/warp.py",
            "import numpy as np\nimport math\nfrom .grid import Grid\nfrom . import errors",
            True,
        ),
        ("stereo_reproject/pipeline.py", "import mathutils", False),
        ("stereo_reproject/pipeline.py", "def f():\n    from .blender import cycles", False),
        ("stereo_reproject/pipeline.py", "import stereo_reproject.warp", False),
        ("stereo_reproject/pipeline.py", "from . import warp", True),
        ("stereo_reproject/cli.py", "def f():\n    from .blender import cycles", True),
        ("stereo_reproject/cli.py", "from .blender import cycles", False),
        ("stereo_reproject/cli.py", "def f():\n    import bpy", False),
        ("stereo_reproject/blender/cycles.py", "import bpy\nfrom ..pipeline import x", True),
        ("stereo_reproject/blender/cycles.py", "from ...operators import x", False),
        ("stereo_reproject/delivery/tags.py", "from ..blender import x", False),
        ("stereo_reproject/delivery/mp4.py", "from ..errors import x\nfrom .splicing import y", True),
        ("stereo_reproject/delivery/mp4.py", "from .movies import x", False),
        ("operators/render.py", "import bpy\nfrom ..stereo_reproject.blender import x", True),
        ("operators/render.py", "from stereo_reproject import pipeline", False),
    ],
)
def test_the_rule_can_fail(tmp_path, file, source, fits):
    path = tmp_path / file
    path.parent.mkdir(parents=True)
    path.write_text(source, encoding="utf-8")
    assert (offences(tmp_path) == []) == fits


def test_root_imports_nothing_at_module_level():
    assert [str(entry) for entry in imports_of(ROOT / "__init__.py", ROOT) if not entry.lazy] == []


def test_engine_loads_nothing_beyond_numpy():
    # sys.modules before and after, in an interpreter of its own; numpy first, since what it loads is its own business.
    program = f"""
import sys, numpy
before = set(sys.modules)
sys.path.insert(0, {str(ROOT)!r})
import {ENGINE}
assert {ENGINE}.__path__[0] == {str(ROOT / ENGINE)!r}, {ENGINE}.__path__
tops = {{name.partition(".")[0] for name in set(sys.modules) - before}}
print(*sorted(tops - set(sys.stdlib_module_names) - {{"numpy", {ENGINE!r}}}))
"""
    result = subprocess.run([sys.executable, "-I", "-c", program], capture_output=True, text=True, check=False)
    assert (result.returncode, result.stdout.split()) == (0, []), result.stderr
