"""From a click on Preview to the first picture and to the pair in the Render Result, beside what F12 takes.

    python tests/bench/preview.py --scenes DIR [--runs 3] [SCENE ...]

DIR holds a folder with a .blend of the same name for each scene. The operator runs as in Blender: it saves a copy of
the open file, starts another process that loads and renders it, and hands the pair to Blender. Pictures of the eyes are
asked for as a window does. The runs of a scene are made one after the other; medians are printed. Columns, in seconds:

    first picture   from the click to the first picture of an eye; a second Blender waits for it, as it does where a
                    panel with the buttons is open
    cold            the same where none waits
    source eye      rendering and denoising it, with the sync
    F12             a plain render of one sample of the same size, which is when F12 has something to show
    result          from the click to the Render Result
    pair            the pair alone, as the report's seconds.total has it
    look            what showing pictures adds
    apart           all of result but pair

What Blender prints goes to standard error.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import os
import sys
import time
from pathlib import Path
from statistics import median
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "stereo_reproject_extension"

SCENES = {"living-room": (0.065, 2.9), "classroom": (0.065, 6.5), "walking-man": (0.065, 5.0), "meadow": (0.065, 5.9)}
"""Interocular and convergence distance."""

START_SECONDS = 3.0
"""Seconds in which a second Blender has started on an idle machine."""

COLUMNS = ("first picture", "cold", "source eye", "F12", "result", "pair", "look", "apart")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=Path, required=True)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("names", nargs="*", metavar="SCENE", default=[*SCENES])
    arguments = parser.parse_args()
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    _register()
    print(f"{'scene':<14}{'size':>9}{'samples':>9}" + "".join(f"{name:>15}" for name in COLUMNS), file=out)
    for name in arguments.names:
        print(_measure(arguments.scenes / name / f"{name}.blend", SCENES[name], arguments.runs), file=out, flush=True)
    # Blender 4.5 as a module may not come to its end with an extension switched on.
    os._exit(0)


def _register() -> None:
    """The extension's root as the package that Blender makes of it."""
    spec = importlib.util.spec_from_file_location(PACKAGE, ROOT / "__init__.py", submodule_search_locations=[str(ROOT)])
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[PACKAGE] = module
    spec.loader.exec_module(module)
    module.register()


def _measure(blend: Path, eyes: tuple[float, float], runs: int) -> str:
    import bpy

    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    scene.camera.data.stereo.interocular_distance, scene.camera.data.stereo.convergence_distance = eyes
    rows, report = [], {}
    for _ in range(runs):
        cold = _previewed(scene)[0]["first picture"]
        second_blender = importlib.import_module(f"{PACKAGE}.operators.second_blender")
        second_blender.start()
        time.sleep(START_SECONDS)
        row, report = _previewed(scene)
        rows.append({**row, "cold": cold, "F12": _first_picture_of_f12(scene, report["size"])})
    size = "x".join(map(str, report["size"]))
    medians = "".join(f"{median(row[name] for row in rows):>13.1f} s" for name in COLUMNS)
    return f"{blend.stem:<14}{size:>9}{report['samples']:>9}{medians}"


def _previewed(scene: Any) -> tuple[dict[str, float], Any]:
    """The seconds of one preview, and its report."""
    import bpy

    results, run, under_way = (
        importlib.import_module(f"{PACKAGE}.operators.{name}") for name in ("results", "run", "under_way")
    )
    shown: list[float] = []
    told = run.BackgroundJob._on_event

    def note(job: Any, event: Any) -> None:
        told(job, event)
        if event["event"] == "picture":
            shown.append(time.perf_counter())

    # There is no window to ask for pictures.
    kept = under_way.wanted_pictures
    under_way.wanted_pictures = lambda **_: run.Pictures.FROM_THE_FIRST_SAMPLE
    run.BackgroundJob._on_event = note
    start = time.perf_counter()
    try:
        bpy.ops.render.stereo_reproject_image(preview=True)
    finally:
        under_way.wanted_pictures, run.BackgroundJob._on_event = kept, told
    whole = time.perf_counter() - start
    report = results.result_of(scene).report
    seconds = report["seconds"]
    source = seconds["source"] + seconds.get("denoise_source", 0.0)
    row = {"first picture": shown[0] - start, "source eye": source, "result": whole, "look": seconds["look"]}
    return {**row, "pair": seconds["total"], "apart": whole - seconds["total"]}, report


def _first_picture_of_f12(scene: Any, size: list[int]) -> float:
    """Seconds of a plain render of one sample of this size; the scene's own settings are put back."""
    import bpy

    render, cycles = scene.render, scene.cycles
    wanted = [(render, "resolution_x", size[0]), (render, "resolution_y", size[1])]
    wanted += [(render, "resolution_percentage", 100), (render, "use_persistent_data", False)]
    wanted += [(render, "use_multiview", False), (cycles, "samples", 1), (cycles, "use_denoising", False)]
    kept = [(owner, name, getattr(owner, name)) for owner, name, _ in wanted]
    try:
        for owner, name, value in wanted:
            setattr(owner, name, value)
        start = time.perf_counter()
        bpy.ops.render.render()
        return time.perf_counter() - start
    finally:
        for owner, name, value in kept:
            setattr(owner, name, value)


if __name__ == "__main__":
    main()
