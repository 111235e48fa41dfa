"""Small .blend files for hostile cases: one Blender process makes many of them, each from a scene of its own.

A module of makers (`odd_cameras`, `odd_names`) imports bpy and calls `odd` on each of its makers. The rows import no
bpy: they have a process make all files of such a module, and read from its standard output how each run must end.
"""

from __future__ import annotations

import atexit
import functools
import importlib
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]

MAKING_SECONDS = 300.0
"""Far more than a process takes for all files of a module."""

OUTSIDE = "/tmp/hostile-outside"
"""A place outside of all folders, in which nothing may appear."""

DONE = (0,)
REFUSED = (2,)
EITHER = (0, 1, 2)
"""Exit statuses: nothing stands in the way; bad input, in one line; whatever Blender makes of it, in one line."""


@dataclass(frozen=True)
class OddBlend:
    """A .blend that was made for a case, or the reason why it could not be made.

    options are added to the command (`render` or `animate`); statuses are those that the run may end with; words must
    be found in what it says, in any case of letters.
    """

    name: str
    command: str = "render"
    options: tuple[str, ...] = ()
    statuses: tuple[int, ...] = DONE
    words: tuple[str, ...] = ()
    path: str = ""
    unmade: str = ""


class NotInThisBlenderError(Exception):
    """A maker's words for: this version has no such thing."""


Maker = Callable[[Any], dict[bytes, bytes] | None]
MAKERS: dict[str, tuple[OddBlend, Maker]] = {}
"""By the case's name; filled while a module of makers is imported."""


def odd(name: str, statuses: tuple[int, ...] = DONE, *words: str, **more: Any) -> Callable[[Maker], Maker]:
    """Register a maker: it gets a small scene that renders, and makes something odd of it. What it returns are bytes of
    the saved file, and others in their place, as long: Blender itself would not take them."""

    def register(maker: Maker) -> Maker:
        if name in MAKERS:
            raise ValueError(f"two cases are called {name!r}")
        MAKERS[name] = OddBlend(name, statuses=statuses, words=words, **more), maker
        return maker

    return register


def several(
    name: str, values: Iterable[Any], statuses: tuple[int, ...] = DONE, *words: str, **more: Any
) -> Callable[..., Any]:
    """Cases that differ in a value alone: the maker gets the scene and a value."""

    def register(maker: Callable[[Any, Any], dict[bytes, bytes] | None]) -> Any:
        for value in values:
            odd(f"{name}: {value}", statuses, *words, **more)(lambda scene, value=value: maker(scene, value))
        return maker

    return register


@functools.cache
def private_folder(purpose: str) -> Path:
    """A folder for this process, which goes when it ends."""
    folder = Path(tempfile.mkdtemp(prefix=f"hostile-{purpose}-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


@functools.cache
def blends_of(module: str) -> tuple[OddBlend, ...]:
    """The .blend files that a module of makers makes, in its order. A file that ends Blender stops no others."""
    folder = private_folder(module)
    found: dict[str, OddBlend] = {}
    while True:
        ended = _make(module, folder, skip=len(found))
        lines = [json.loads(line) for line in ended.stdout.splitlines() if line.startswith("{")]
        for line in lines:
            blend = OddBlend(**{key: tuple(v) if isinstance(v, list) else v for key, v in line.items()})
            found[blend.name] = blend
        if ended.returncode == 0:
            return tuple(blend for blend in found.values() if blend.unmade != "skip")
        if not lines:
            raise AssertionError(f"{module} makes nothing: {ended.stderr[-2000:]}")


def _make(module: str, folder: Path, *, skip: int) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "tests.hostile.blends", module, str(folder), str(skip)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=MAKING_SECONDS, check=False)


def _make_all(module: str, folder: Path, skip: int) -> None:
    """Make all files of a module but the first ones, with a line of JSON for each: before, and when it is there."""
    # Run as a program this file is another module than the one that makers import.
    makers = importlib.import_module("tests.hostile.blends").MAKERS
    importlib.import_module(f"tests.hostile.{module}")
    for number, (blend, maker) in enumerate(list(makers.values())[skip:], skip):
        fields = asdict(blend)
        path = folder / f"{number:03d}.blend"
        _say({**fields, "unmade": "Blender ended while it was made"})
        try:
            _make_one(maker, path)
        except Exception as error:  # noqa: BLE001 - the case fails with it
            why = f"{type(error).__name__}: {error}"
            _say({**fields, "unmade": "skip" if type(error).__name__ == "NotInThisBlenderError" else why})
        else:
            _say({**fields, "path": str(path)})


def _say(fields: dict[str, Any]) -> None:
    # Blender's own words have no line end of their own at times.
    print(f"\n{json.dumps(fields)}", flush=True)


def _make_one(maker: Maker, path: Path) -> None:
    small_scenes = importlib.import_module("tests.hostile.small_scenes")
    scene = small_scenes.small_scene()
    changes = maker(scene) or {}
    small_scenes.save(path)
    content = path.read_bytes()
    for old, new in changes.items():
        if len(old) != len(new) or old not in content:
            raise ValueError(f"{old!r} cannot be replaced")
        content = content.replace(old, new)
    path.write_bytes(content)


def main(arguments: Sequence[str]) -> None:
    module, folder, skip = arguments
    _make_all(module, Path(folder), int(skip))


if __name__ == "__main__":
    main(sys.argv[1:])
