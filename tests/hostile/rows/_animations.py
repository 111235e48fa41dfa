"""An animation that can be compared to the byte, and its uninterrupted run, made once for all cases of a suite."""

from __future__ import annotations

import fcntl
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from stereo_reproject.sequence.journal_folder import JOURNAL
from tests.hostile.program import (
    DEMO,
    SMALLEST,
    Run,
    assert_done,
    assert_nothing_left,
    names_in,
    run_program,
    start_program,
)

FRAMES = 8
OPTIONS = (*SMALLEST, "--frames", f"1-{FRAMES}")
REPORTS = {"animation.json", "animation.png", "animation.svg", JOURNAL}

# Two marks in Blender's files that are of the clock, and the only ones.
MAKE_SCENE = """
import sys, bpy
from stereo_reproject.sequence.journal_folder import JOURNAL
bpy.ops.wm.open_mainfile(filepath=sys.argv[1], load_ui=False)
render = bpy.context.scene.render
render.use_stamp_date = render.use_stamp_render_time = False
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[2], compress=False)
"""


def shared(folder: Path, name: str, make: Callable[[Path], None]) -> Path:
    """What all cases of a suite share, made by the first that asks for it: `folder` is a case's own."""
    place = folder.parent / f"shared-{name}"
    with (folder.parent / f"shared-{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not place.exists():
            making = folder.parent / f"making-{name}"
            making.mkdir()
            make(making)
            making.rename(place)
    return place


def run_blender(script: str, *arguments: str | Path) -> None:
    """Run a script in a Python of its own, that may import bpy."""
    command = [sys.executable, "-c", script, *map(str, arguments)]
    subprocess.run(command, check=True, capture_output=True, timeout=120)


def scene(folder: Path) -> Path:
    """The Cornell box, without the marks of the clock that Blender puts into pictures."""
    return shared(folder, "scene", lambda place: run_blender(MAKE_SCENE, DEMO, place / "demo.blend")) / "demo.blend"


def reference(folder: Path) -> Path:
    """The frames as an uninterrupted run makes them."""
    blend = scene(folder)

    def make(place: Path) -> None:
        assert_done(run_program("animate", blend, "--output", place / "out", *OPTIONS))

    return shared(folder, "reference", make) / "out"


def start(folder: Path, *options: str, output: Path | None = None, **how: Any) -> Run:
    arguments = ("animate", scene(folder), "--output", output or folder / "out", *OPTIONS, *options)
    return start_program(*arguments, **how)


def resume(folder: Path, output: Path | None = None) -> None:
    """Go on with what is missing, and compare the whole with an uninterrupted run."""
    output = output or folder / "out"
    whole = pictures(reference(folder)).items() & (pictures(output).items() if output.exists() else ())
    files = {name for name, _ in whole}
    before = {name: record for name, record in records(output).items() if record["files"].keys() <= files}
    arguments = ("animate", scene(folder), "--output", output, *OPTIONS, "--resume")
    assert_done(run_program(*arguments, timeout=240))
    assert_equal(output, reference(folder))
    after = records(output)
    assert all(after[name] == content for name, content in before.items()), "a finished frame was rendered again"


def records(output: Path) -> dict[str, dict[str, Any]]:
    """Frames' records by name, those that can be read."""
    found = {}
    for path in (output / JOURNAL).glob("[0-9]*.json"):
        try:
            found[path.name] = json.loads(path.read_bytes())
        except (OSError, ValueError):
            continue
    return found


def pictures(output: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in output.glob("[0-9]*.png")}


def assert_equal(output: Path, expected: Path) -> None:
    """Pictures to the byte, records in all that is not of the clock, and nothing else."""
    mine, theirs = pictures(output), pictures(expected)
    assert mine.keys() == theirs.keys(), f"other frames: {sorted(mine.keys() ^ theirs.keys())}"
    differ = [name for name in mine if mine[name] != theirs[name]]
    assert not differ, f"other bytes: {differ}"
    assert {name: lasting(record) for name, record in records(output).items()} == {
        name: lasting(record) for name, record in records(expected).items()
    }, "other records"
    assert_nothing_left(output, *mine, "animation.json", "animation.png", "animation.svg", f"{JOURNAL}/")
    half = [name for name in names_in(output / JOURNAL) if not name.endswith(".json") or name.startswith(".")]
    assert not half, f"half-made in the journal: {half}"


def lasting(record: dict[str, Any]) -> dict[str, Any]:
    """A record without what is of the clock."""
    return {key: record[key] for key in ("frame", "files", "settings", "scene")}


def claimed(output: Path, frame: int) -> bool:
    return any((output / JOURNAL).glob(f"{frame:04d}.claim.*"))


def recorded(output: Path, frame: int) -> bool:
    return (output / JOURNAL / f"{frame:04d}.json").exists()


def work_folders(output: Path) -> list[Path]:
    return list(output.glob(".stereo_reproject-*"))


def is_root() -> bool:
    return os.geteuid() == 0
