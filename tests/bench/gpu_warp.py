"""How long the warp takes on the GPU, step by step, against numpy's.

    python tests/bench/gpu_warp.py [--runs 5] [--size 1920x1080] [--panoramas]

The picture is the synthetic room, seen by an off-axis and by a toed-in pair, or by pairs of panoramas. As a whole the
two are timed in turn. The steps are timed apart from that, each with a wait for the GPU after it; those that NumPy
does for the GPU are told so.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections import defaultdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import bpy

from stereo_reproject.blender.gpu import textures as gpu_textures
from stereo_reproject.blender.gpu import warp as gpu_warp
from tests.bench.warp.scenes import PANORAMAS, eyes, panoramic_eyes, room
from tests.bench.warp.settings import MODES
from tests.warp.pairs import warp_pair


def seconds(call) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def steps(call, runs: int) -> dict[str, float]:
    """Medians of the seconds that a call spends in each kind of step."""
    spent: dict[str, float] = defaultdict(float)
    waited_for = gpu_textures.ShaderRun({}).create("result", (1, 1))

    def timed(function, label):
        def step(*arguments, **options):
            start = time.perf_counter()
            result = function(*arguments, **options)
            waited_for.read()
            spent[label or arguments[1]] += time.perf_counter() - start
            return result

        return step

    places = (
        (gpu_warp, "build_grid", "grid (numpy)"),
        (gpu_warp, "lattice_corners", "corners (numpy)"),
        (gpu_warp, "empty_reasons", "empty (numpy)"),
        (gpu_warp, "target_depth", "depth (numpy)"),
        (gpu_warp, "uploaded", "upload"),
        (gpu_textures.ShaderRun, "create", "textures"),
        (gpu_textures.ShaderRun, "run", None),
        (gpu_warp, "downloaded", "readback"),
    )
    kept = [(owner, name, getattr(owner, name)) for owner, name, _ in places]
    for (owner, name, label), (*_, function) in zip(places, kept, strict=True):
        setattr(owner, name, timed(function, label))
    measured = []
    for _ in range(runs):
        spent.clear()
        call()
        measured.append(dict(spent))
    for owner, name, function in kept:
        setattr(owner, name, function)
    return {name: statistics.median(each[name] for each in measured) for name in measured[0]}


def measure(source: dict, pair: tuple, interpolation: str, runs: int) -> str:
    ours, numpys = [], []
    for _ in range(runs):
        ours.append(seconds(lambda: warp_pair(source, *pair, how=gpu_warp.warp_view, interpolation=interpolation)))
        numpys.append(seconds(lambda: warp_pair(source, *pair, interpolation=interpolation)))
    of_steps = steps(lambda: warp_pair(source, *pair, how=gpu_warp.warp_view, interpolation=interpolation), runs)
    ratio = statistics.median(a / b for a, b in zip(ours, numpys, strict=True))
    times = ", ".join(f"{name} {1e3 * spent:.0f}" for name, spent in of_steps.items())
    whole = f"GPU {1e3 * statistics.median(ours):.0f} ms, numpy {1e3 * statistics.median(numpys):.0f} ms"
    return f"{whole}, ratio {ratio:.2f}; {times}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--size", default="1920x1080", metavar="WxH")
    parser.add_argument("--panoramas", action="store_true")
    options = parser.parse_args()
    runs, name = options.runs, gpu_warp.usable()
    width, height = (int(part) for part in options.size.split("x"))
    source = room(width, height)
    if name is None:
        sys.exit(f"Blender {bpy.app.version_string} has no GPU here that warps")
    print(name)
    seen_by = panoramic_eyes if options.panoramas else eyes
    for kind in PANORAMAS if options.panoramas else MODES:
        pair = seen_by(width, height, kind)
        for interpolation in ("linear", "cubic"):
            print(f"{kind}, {interpolation}: {measure(source, pair, interpolation, runs)}")


if __name__ == "__main__":
    main()
