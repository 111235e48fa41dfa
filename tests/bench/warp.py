"""How long the warp stage takes, against SciPy's bare bilinear lookup of three channels at the same size.

    python tests/bench/warp.py [--runs 5]

Both run on one core, in turn, and the medians of several runs are compared. The scene is a made-up room full of
posts, at two sizes; nearly all of its cells are subdivided at the smaller one.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
import tracemalloc
from pathlib import Path

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
from scipy.ndimage import map_coordinates

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from stereo_reproject.accuracy import SETTINGS
from stereo_reproject.camera import PerspectiveCamera, ViewPlane
from stereo_reproject.reprojection import reproject

SIZES = ((960, 540), (3840, 2160))
INTEROCULAR, CONVERGENCE = 0.065, 3.0


def cameras(width: int, height: int) -> tuple[PerspectiveCamera, PerspectiveCamera]:
    """An off-axis pair with a horizontal field of view of 60 degrees."""
    half_x = np.tan(np.radians(30.0))
    half_y = half_x * height / width
    shift = -INTEROCULAR / CONVERGENCE
    right = np.eye(4)
    right[0, 3] = INTEROCULAR
    return (
        PerspectiveCamera(width, height, np.eye(4), ViewPlane(-half_x, half_x, -half_y, half_y)),
        PerspectiveCamera(width, height, right, ViewPlane(-half_x + shift, half_x + shift, -half_y, half_y)),
    )


def room(width: int, height: int) -> dict[str, np.ndarray]:
    """A wavy back wall, a floor, two dozen posts of different depth, and noisy colours."""
    rng = np.random.default_rng(5)
    y, x = np.mgrid[0:height, 0:width]
    u, v = x / width, y / height
    depth = 5.0 + 0.3 * np.sin(9.0 * u) + 0.3 * np.cos(7.0 * v)
    depth = np.where(v > 0.55, np.minimum(depth, 0.45 / np.maximum(v - 0.5, 1e-3)), depth)
    for _ in range(24):
        left, wide, high, near = rng.uniform(0, 1), rng.uniform(0.004, 0.05), rng.uniform(0.2, 0.8), rng.uniform(1.5, 4)
        depth = np.where((u > left) & (u < left + wide) & (v > high), np.minimum(depth, near), depth)
    colour = rng.random((height, width, 4), np.float32)
    return {"Combined": colour, "Depth": depth.astype(np.float32)[..., None]}


def seconds(call) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def measure(width: int, height: int, runs: int) -> None:
    source, (left, right) = room(width, height), cameras(width, height)
    invalid = np.zeros((height, width), bool)

    def warp():
        return reproject(source, left, right, accuracy=SETTINGS["balanced"], invalid=invalid)

    result = warp().warp
    where = [np.nan_to_num(result.y - 0.5), np.nan_to_num(result.x - 0.5)]
    channels = [np.ascontiguousarray(source["Combined"][..., k]) for k in range(3)]

    def peer():
        return [map_coordinates(channel, where, order=1, output=np.float32) for channel in channels]

    ours, theirs = [], []
    for _ in range(runs):
        ours.append(seconds(warp))
        theirs.append(seconds(peer))
    ratio = statistics.median(a / b for a, b in zip(ours, theirs, strict=True))
    tracemalloc.start()
    warp()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    print(
        f"{width} x {height}: warp stage {statistics.median(ours):.3f} s, lookup {statistics.median(theirs):.3f} s,"
        f" ratio {ratio:.2f} (mark: 8); peak memory {peak / 2**20:.0f} MB (mark: 1536)"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=5)
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    runs = parser.parse_args().runs
    for width, height in SIZES:
        measure(width, height, runs)


if __name__ == "__main__":
    main()
