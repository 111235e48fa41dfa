"""Imports point one way, from room to room: a room is a folder, and each stands on those below it."""

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

FLOORS = (
    ("programs",),
    ("blender",),
    ("sequence",),
    ("jobs",),
    ("tradeoff",),
    ("report",),
    ("pipeline",),
    ("estimate",),
    ("holes",),
    ("warp", "matching"),
    ("trace",),
    ("images",),
    ("views",),
    ("settings",),
    ("delivery",),
    ("errors", "files"),
    ("words",),
)
"""Rooms from the uppermost to the lowest: a room imports those of the floors below its own, and no neighbour."""

FLOORS_OF_BLENDER = (("api",), ("commands",), ("output",), ("engines",), ("gpu",), ("scene",))

NUMERIC = ("estimate", "holes", "warp", "matching", "images", "trace", "views", "settings", "delivery")
"""Rooms that need numpy alone, and OpenEXR to read and write pictures."""

THIRD_PARTY = {"numpy", "OpenEXR"}


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


def floor_of(name: str, floors: tuple[tuple[str, ...], ...]) -> int | None:
    return next((number for number, rooms in enumerate(floors) if name in rooms), None)


def room_of(module: str) -> str:
    """The room below the engine; "" for the engine's own __init__, `__main__` stands with the programs."""
    room = module.removeprefix(ENGINE).removeprefix(".").partition(".")[0]
    return "programs" if room == "__main__" else room


def offence(entry: Import, importer: str) -> str | None:
    """The rule that this import breaks, in words, or None."""
    top = entry.module.partition(".")[0]
    own = is_in(entry.module, ENGINE) or is_in(entry.module, OPERATORS)
    if own and not entry.relative:
        return "absolute: inside Blender the package has another name"
    if is_in(importer, OPERATORS):
        return None
    if is_in(entry.module, OPERATORS):
        return "the engine does not know the operators"
    room = room_of(importer)
    if floor_of(room, FLOORS) is None and importer != ENGINE:
        return "the importing module is in no room"
    if not own:
        return outside_offence(top, room)
    # The package itself holds nothing but its name.
    target = room_of(entry.module)
    if not target or target == room:
        return blender_offence(entry.module, importer) if room == "blender" and target else None
    wanted = floor_of(target, FLOORS)
    if wanted is None:
        return f"{target} is no room"
    if room == "programs" and target == "blender" and not entry.lazy:
        return "the process that talks to the user must not load Blender: import it inside a function"
    if wanted > (floor_of(room, FLOORS) or 0):
        return None
    return f"{target} is not below {room}"


def outside_offence(top: str, room: str) -> str | None:
    if room == "blender":
        return None
    if top in BLENDER_MODULES:
        return f"only {BLENDER} and {OPERATORS} touch Blender"
    if room in NUMERIC and top not in THIRD_PARTY and top not in sys.stdlib_module_names:
        return "numeric rooms need numpy alone"
    return None


def blender_offence(module: str, importer: str) -> str | None:
    inner, target = (name.removeprefix(BLENDER).removeprefix(".").partition(".")[0] for name in (importer, module))
    if not target or inner == target:
        return None
    here, there = (floor_of(name, FLOORS_OF_BLENDER) for name in (inner, target))
    if here is None or there is None:
        return f"{inner if here is None else target} is no room of {BLENDER}"
    return None if there > here else f"blender.{target} is not below blender.{inner}"


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


def test_every_module_is_in_a_room():
    modules = [file.relative_to(ROOT / ENGINE) for file in (ROOT / ENGINE).rglob("*.py")]
    rooms = {path.parts[0].removesuffix(".py") for path in modules} - {"__init__", "__main__"}
    assert rooms == {room for floor in FLOORS for room in floor}
    inner = {path.parts[1].removesuffix(".py") for path in modules if path.parts[0] == "blender"} - {"__init__"}
    assert inner == {room for floor in FLOORS_OF_BLENDER for room in floor}


@pytest.mark.parametrize(
    ("file", "source", "fits"),
    [
        ("stereo_reproject/warp/grid.py", "from ..blender import api", False),
        ("stereo_reproject/warp/grid.py", "from .. import blender", False),
        ("stereo_reproject/warp/grid.py", "from ..pipeline.frame import render_stereo_frame", False),
        ("stereo_reproject/warp/grid.py", "from ..matching.membrane import spread", False),
        ("stereo_reproject/warp/grid.py", "def f():\n    from ..holes import thin", False),
        ("stereo_reproject/warp/grid.py", "import scipy.ndimage", False),
        (
            "stereo_reproject/warp/grid.py",
            "import numpy as np\nimport math\nfrom .quads import x\nfrom .. import errors",
            True,
        ),
        ("stereo_reproject/warp/grid.py", "from ..views.camera import Camera\nfrom ..files import whole_file", True),
        ("stereo_reproject/files.py", "from .settings.frame import x", False),
        ("stereo_reproject/errors.py", "from .words import Words", True),
        ("stereo_reproject/words.py", "from .errors import x", False),
        ("stereo_reproject/pipeline/frame.py", "import mathutils", False),
        ("stereo_reproject/pipeline/frame.py", "def f():\n    from ..blender.engines import render", False),
        ("stereo_reproject/pipeline/frame.py", "import stereo_reproject.warp", False),
        ("stereo_reproject/pipeline/frame.py", "from ..warp import grid", True),
        ("stereo_reproject/loose.py", "import math", False),
        ("stereo_reproject/cellar/wine.py", "import math", False),
        ("stereo_reproject/warp/grid.py", "from ..cellar import wine", False),
        ("stereo_reproject/programs/cli.py", "def f():\n    from ..blender.commands import frame", True),
        ("stereo_reproject/programs/cli.py", "from ..blender.commands import frame", False),
        ("stereo_reproject/programs/cli.py", "from ..jobs.supervisor import Job", True),
        ("stereo_reproject/jobs/supervisor.py", "def f():\n    from ..programs import worker", False),
        ("stereo_reproject/programs/cli.py", "def f():\n    import bpy", False),
        ("stereo_reproject/blender/engines/render.py", "import bpy\nfrom ...pipeline.frame import x", True),
        ("stereo_reproject/blender/engines/render.py", "from ..scene.working import x\nfrom .denoise import y", True),
        ("stereo_reproject/blender/engines/render.py", "from ..output.movie import x", False),
        ("stereo_reproject/blender/cellar/wine.py", "from ..scene import x", False),
        ("stereo_reproject/blender/engines/render.py", "from ....operators import x", False),
        ("stereo_reproject/delivery/mp4.py", "from ..errors import x\nfrom .splicing import y", True),
        ("stereo_reproject/delivery/mp4.py", "from ..settings.frame import x", False),
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
