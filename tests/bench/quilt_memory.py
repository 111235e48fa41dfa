"""Memory and time that the pictures of many views take, from their files to the quilt, over what Blender holds anyway.

    python -m tests.bench.quilt_memory [--grid 8x8] [--size 1024x1024]

Each picture is written in a process of its own, whose peak is that of its resident memory.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

PICTURES = ("nothing", "quilt.png", "quilt.exr", "contact.png", "sweep.mp4", "views.exr")


def peak_mb() -> float:
    """Return the greatest resident memory of this process so far, in MiB."""
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def write_views(folder: Path, count: int, width: int, height: int) -> None:
    """Write files of noisy views, with colour and depth."""
    from stereo_reproject.images.exr import write_eye
    from stereo_reproject.settings.views import view_names

    folder.mkdir(parents=True, exist_ok=True)
    values = np.random.default_rng(1)
    for number, name in enumerate(view_names(count)):
        colour = values.random((height, width, 4), np.float32)
        colour[..., 3] = 1.0
        depth = np.full((height, width, 1), 1.0 + number, np.float32)
        path = folder / f"{name}.exr"
        write_eye(path, {"ViewLayer": {"Combined": colour, "Depth": depth}}, view=name, compressed=False)


def write(what: str, folder: Path, columns: int, rows: int) -> None:
    """Write one of PICTURES of the views in a folder, and print the seconds and the memory that it took."""
    import bpy

    from stereo_reproject.blender.output.quilt_files import write_contact_sheet, write_quilt, write_sweep
    from stereo_reproject.blender.output.view_files import ViewFiles
    from stereo_reproject.images.multi_view import write_multi_view
    from stereo_reproject.settings.views import view_names

    scene, names = bpy.context.scene, view_names(columns * rows)
    pictures, path = ViewFiles(folder, names), folder.parent / what
    writers = {
        "nothing": lambda: None,
        "quilt.png": lambda: write_quilt(scene, pictures, columns, rows, path),
        "quilt.exr": lambda: write_quilt(scene, pictures, columns, rows, path),
        "contact.png": lambda: write_contact_sheet(scene, pictures, names, path),
        "sweep.mp4": lambda: write_sweep(scene, pictures, path),
        "views.exr": lambda: write_multi_view(path, {name: folder / f"{name}.exr" for name in names}),
    }
    before, start = peak_mb(), time.perf_counter()
    writers[what]()
    seconds = time.perf_counter() - start
    print(f"{what:<12}{seconds:8.1f} s {peak_mb() - before:8.0f} MB more than {before:.0f} MB", flush=True)


def main() -> None:
    """Measure all pictures, one after the other."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--grid", default="8x8")
    parser.add_argument("--size", default="1024x1024")
    parser.add_argument("--only", choices=PICTURES)
    parser.add_argument("--folder", type=Path)
    options = parser.parse_args()
    (columns, rows), (width, height) = (tuple(map(int, text.split("x"))) for text in (options.grid, options.size))
    if options.only:
        write(options.only, options.folder, columns, rows)
        return
    with tempfile.TemporaryDirectory() as folder:
        views = Path(folder) / "views"
        write_views(views, columns * rows, width, height)
        for what in PICTURES:
            same = ["--grid", options.grid, "--size", options.size, "--folder", str(views)]
            subprocess.run([sys.executable, "-m", "tests.bench.quilt_memory", "--only", what, *same], check=True)


if __name__ == "__main__":
    main()
