"""How long the map of an equirectangular pair takes, along rows and quad by quad, and how far each is off.

    python -m tests.bench.panorama_rows SCENE.blend --panorama vr180 --size 1024x1024

Both eyes are rendered for their depth. Where a point of the target's own depth is seen by the source, and no edge is
beside it, the place of the source that shows it is known from the cameras alone: errors are differences from that.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stereo_reproject.images.passes import DEPTH_PASS, known_depth
from stereo_reproject.settings.frame import SceneOverrides
from stereo_reproject.views.camera import Camera, disparity_per_nearness, target_px_from_source_px
from stereo_reproject.warp.discontinuities import disparity_of, disparity_steps
from stereo_reproject.warp.forward import tear_sides, torn_quads
from stereo_reproject.warp.grid import build_grid
from stereo_reproject.warp.quads import draw_quads
from stereo_reproject.warp.scanline import row_law_of, warp_rows
from stereo_reproject.warp.tuning import TUNING

GRID_THRESHOLD_ARC_MINUTES = 0.25
"""That of frames as they are asked for by default."""

SAME_POINT_PIXELS = 0.5
"""Difference in disparity up to which a depth of the source is that of the point looked for."""

PERCENTILES = (50.0, 90.0, 99.0, 99.9)

Depths = dict[str, NDArray[np.float32]]


def main() -> None:
    """Render the eyes, and print a line for each way to draw the map."""
    options = options_of(__doc__)
    cameras, depths = rendered(options)
    source, target = cameras["left"], cameras["right"]
    depth = depths["left"]
    law = row_law_of(source, target)
    assert law is not None
    grid = build_grid(depth, source, target, threshold=GRID_THRESHOLD_ARC_MINUTES, most=TUNING.tear_pixels)
    torn = torn_quads(*disparity_steps(disparity_of(depth, source, target)).torn(), depth)
    if law.wraps:
        tear_sides(torn, depth, source, target)
    true, known = true_places(source, target, depths)
    ways: dict[str, Callable[[], NDArray[np.float32]]] = {
        "rows": lambda: warp_rows(depth, source, target.width, law, grid, torn)[0],
        "quads": lambda: draw_quads(depth, source, target, grid, torn)[0],
    }
    seconds: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(options.runs):
        for name, draw in ways.items():
            start = time.perf_counter()
            draw()
            seconds[name].append(time.perf_counter() - start)
    print(f"{depth.shape[1]} x {depth.shape[0]}, {grid.subdivided.mean():.0%} of the cells subdivided")
    for name, draw in ways.items():
        x = draw()
        off = np.abs(within_half_a_turn(x - true, source))[known & np.isfinite(x)]
        errors = ", ".join(
            f"{percent:g} %: {error:.1e}"
            for percent, error in zip(PERCENTILES, np.percentile(off, PERCENTILES), strict=True)
        )
        per_megapixel = 1e6 * statistics.median(seconds[name]) / depth.size
        print(
            f"{name:6} {per_megapixel:.3f} s per megapixel; {np.isfinite(x).mean():.2%} covered; pixels off: {errors}"
        )


def rendered(options: argparse.Namespace) -> tuple[dict[str, Camera], Depths]:
    """Return the cameras of both eyes of the scene that was asked for, and the depth (H, W) of each."""
    from stereo_reproject.blender.engines.renderer import BlenderRenderer
    from stereo_reproject.blender.scene.working import open_blend, working_scene

    scene = open_blend(options.scene)
    size = tuple(int(part) for part in options.size.split("x"))
    overrides = SceneOverrides(
        panorama=options.panorama, size=(size[0], size[1]), samples=1, interocular_distance=options.interocular
    )
    with working_scene(scene, overrides) as working, tempfile.TemporaryDirectory() as folder:
        renderer = BlenderRenderer(working, Path(folder))
        depths = {view: known_depth(renderer.render_source(view)[0][DEPTH_PASS])[..., 0] for view in renderer.cameras}
        return dict(renderer.cameras), depths


def true_places(source: Camera, target: Camera, depths: Depths) -> tuple[NDArray, NDArray[np.bool_]]:
    """Return the source x (H, W) of what each target pixel's centre shows, and the pixels (H, W) where the source shows
    that too, far from edges of depth."""
    seen, there = depths["left"], depths["right"].astype(np.float64)
    x, y = np.arange(target.width) + 0.5, np.arange(target.height)[:, None] + 0.5
    true, row, away = target_px_from_source_px(target, source, x, y, there)
    per_nearness = disparity_per_nearness(source, target)
    column, row = (
        np.clip(np.nan_to_num(place), 0, size - 1).astype(np.intp)
        for place, size in ((true, source.width), (row, source.height))
    )
    known = (true > 0.0) & (true < source.width)
    for right, down in ((0, 0), (-1, 0), (1, 0), (0, -1), (0, 1)):
        beside = seen[np.clip(row + down, 0, source.height - 1), np.clip(column + right, 0, source.width - 1)]
        known &= per_nearness * np.abs(1.0 / beside - 1.0 / away) < SAME_POINT_PIXELS
    return true, known


def within_half_a_turn(difference: NDArray, camera: Camera) -> NDArray:
    """Return differences of columns with whole turns taken off."""
    if not np.isfinite(camera.period_px):
        return difference
    return difference - camera.period_px * np.round(difference / camera.period_px)


def options_of(description: str | None) -> argparse.Namespace:
    """Return what the command line asks for; description is what its help says of the program."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--panorama", choices=("vr180", "vr360"), default="vr180")
    parser.add_argument("--size", default="1024x1024", metavar="WxH")
    parser.add_argument("--interocular", type=float, default=0.065)
    parser.add_argument("--runs", type=int, default=3)
    return parser.parse_args()


if __name__ == "__main__":
    main()
