"""From a click on Preview to the pair in the Render Result, and what of that is not the pair itself.

    python tests/bench/preview.py --scenes DIR [--runs 3] [SCENE ...]

DIR holds a folder with a .blend of the same name for each scene. The operator runs as in Blender: it saves a copy of
the open file, starts another process that loads and renders it, and hands the pair to Blender. `apart` is all of that
but the pair, as the report's seconds.total has it. The runs of a scene are made one after the other; medians are
printed.
What Blender prints goes to standard error.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
import time
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "stereo_reproject_extension"

SCENES = {"living-room": (0.065, 2.9), "classroom": (0.065, 6.5), "meadow": (0.065, 5.9)}
"""Interocular and convergence distance."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=Path, required=True)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("names", nargs="*", metavar="SCENE", default=[*SCENES])
    arguments = parser.parse_args()
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    _register()
    print(f"{'scene':<16}{'size':>10}{'samples':>9}{'click to result':>18}{'the pair':>10}{'apart':>8}", file=out)
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

    results = importlib.import_module(f"{PACKAGE}.operators.results")
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    scene.camera.data.stereo.interocular_distance, scene.camera.data.stereo.convergence_distance = eyes
    whole, pair = [], []
    for _ in range(runs):
        start = time.perf_counter()
        bpy.ops.render.stereo_reproject_image(preview=True)
        whole.append(time.perf_counter() - start)
        report = results.result_of(scene).report
        pair.append(report["seconds"]["total"])
    size = "x".join(map(str, report["size"]))
    apart = median(w - p for w, p in zip(whole, pair, strict=True))
    figures = f"{median(whole):>16.1f} s{median(pair):>8.1f} s{apart:>6.1f} s"
    return f"{blend.stem:<16}{size:>10}{report['samples']:>9}{figures}"


if __name__ == "__main__":
    main()
