"""How long the warp stage takes and how much memory, against SciPy's bare bilinear lookup at the same size.

The stage is all that lies between the rendered source and the mask of what is to be traced: steps, grid, forward warp,
depth test, lookup of the passes, holes and silhouettes.
"""

from __future__ import annotations

import statistics
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stereo_reproject.errors import BadInputError
from stereo_reproject.holes.reprojection import Reprojection, reproject
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.views.view import View
from stereo_reproject.warp.discontinuities import disparity_of, disparity_steps
from stereo_reproject.warp.forward import forward_warp
from stereo_reproject.warp.grid import build_grid
from stereo_reproject.warp.options import WarpOptions
from stereo_reproject.warp.rendered_view import RenderedView
from stereo_reproject.warp.tuning import TUNING as WARP_TUNING
from stereo_reproject.warp.warper import NUMPY, Warper
from tests.bench.warp.profile import profiled
from tests.bench.warp.scenes import CONVERGENCE, INTEROCULAR, SCENES, eyes
from tests.bench.warp.settings import BENCH_SCHEMA, BenchSettings, cpu_name, machine_facts, versions

ACCURACY = "balanced"
RATIO = "median of the ratios of each turn"
NEEDS_SCIPY = "the warp stage is compared with SciPy's lookup, and SciPy is missing ({}); run `pip install scipy`"

LEFT_TO_NUMPY = "has left a picture of this size to numpy"

FindGpu = Callable[[], tuple[Warper | None, str]]
"""The GPU that can warp, or None and why there is none."""


@dataclass(frozen=True)
class Turn:
    """Seconds of one run: of `reproject`, of the reasons after it, and of the bare lookup; and, once more and alone, of
    what numpy does in the first of them for the map."""

    warp_view: float
    reasons: float
    lookup: float
    map: float | None

    @property
    def stage(self) -> float:
        return self.warp_view + self.reasons


class Stage:
    """The warp stage on a made-up scene: `warp_view`, and `reasons` of what that returns, are all of it."""

    def __init__(self, settings: BenchSettings, grid_threshold: float) -> None:
        width, height = settings.size
        self.source = SCENES[settings.scene](width, height)
        self._eyes = eyes(width, height, settings.mode)
        self._invalid = np.zeros((height, width), bool)
        self._threshold = grid_threshold
        self._cuts = disparity_steps(disparity_of(self.source[DEPTH_PASS][..., 0], *self._eyes))

    def map(self) -> None:
        """The grid, and where each target pixel comes from, without steps in depth: none of these scenes' cells that
        are coarse has one."""
        depth = self.source[DEPTH_PASS][..., 0]
        grid = build_grid(depth, *self._eyes, threshold=self._threshold, most=WARP_TUNING.tear_pixels)
        cut_right, cut_down = self._cuts.torn()
        forward_warp(depth, *self._eyes, grid, cut_right=cut_right, cut_down=cut_down)

    def warp_view(self, warp: Warper) -> Reprojection:
        """Raises BadInputError where a GPU has left it to numpy, in the first run or in a later one."""
        source, target = self._eyes
        carried = reproject(
            [RenderedView(View("source", source), self.source, self._invalid)],
            View("target", target),
            SETTINGS[ACCURACY],
            options=WarpOptions(self._threshold),
            warper=warp,
        )
        if warp.device is not None and carried.warped_by != "gpu":
            raise BadInputError(f"--warp gpu: {warp.device} {LEFT_TO_NUMPY}; take a smaller --size, or --warp numpy")
        return carried

    def whole(self, warp: Warper) -> tuple[Reprojection, NDArray[np.uint16]]:
        carried = self.warp_view(warp)
        return carried, carried.reasons


def measure(
    settings: BenchSettings,
    grid_threshold: float,
    *,
    core: int | None,
    find_gpu: FindGpu,
    on_part: Callable[[str, str], None] = lambda *_: None,
) -> dict[str, Any]:
    """The report; core is the one that this process is pinned to. Raises BadInputError.

    on_part is told of each part of the work as it begins, and of its detail.
    """
    lookup_of = _scipy_lookup()
    warp = _carrier(settings, find_gpu)
    on_part("scene", settings.scene)
    stage = Stage(settings, grid_threshold)
    # The first run pays for what is loaded on the way, and is not timed.
    carried, reasons = stage.whole(warp)
    lookup = lookup_of(stage.source[COLOUR_PASS], carried.warp.x, carried.warp.y)
    turns = []
    for number in range(1, settings.runs + 1):
        on_part("timing", f"{number} of {settings.runs}")
        turns.append(_turn(stage, warp, lookup))
    on_part("profile", "")
    profile = profiled(lambda: stage.whole(NUMPY)) if warp is NUMPY else None
    on_part("memory", "")
    peak = _peak_bytes(lambda: stage.whole(warp))
    on_part("agreement", "")
    grid = carried.grid
    return {
        "schema": BENCH_SCHEMA,
        "size": list(settings.size),
        "runs": settings.runs,
        "warp": settings.warp,
        "device": warp.device or cpu_name(),
        **_times(turns),
        "profile": profile,
        "peak_bytes_per_pixel": peak / reasons.size,
        "agreement": _agreement(stage, find_gpu),
        "holes": float(np.mean(reasons != 0)),
        "subdivided": float(grid.subdivided.mean()),
        "grid": {"cells": grid.cells, "subdivided": int(grid.subdivided.sum()), "triangles": grid.triangles},
        "scene": _scene_facts(settings, grid_threshold),
        "pinned_to_core": core,
        "machine": machine_facts(),
        "versions": versions("numpy", "scipy", "bpy"),
    }


def _carrier(settings: BenchSettings, find_gpu: FindGpu) -> Warper:
    if settings.warp == "numpy":
        return NUMPY
    found, why = find_gpu()
    if found is None:
        raise BadInputError(f"--warp gpu: {why}; --warp numpy needs none")
    return found


def _times(turns: list[Turn]) -> dict[str, Any]:
    stages, lookups = [turn.stage for turn in turns], [turn.lookup for turn in turns]
    return {
        "seconds": statistics.median(stages),
        "carry_seconds": statistics.median(turn.warp_view for turn in turns),
        "map_seconds": None if turns[0].map is None else statistics.median(turn.map or 0.0 for turn in turns),
        "reasons_seconds": statistics.median(turn.reasons for turn in turns),
        "all_seconds": stages,
        "lookup_seconds": statistics.median(lookups),
        "all_lookup_seconds": lookups,
        "lookup_ratio": statistics.median(turn.stage / turn.lookup for turn in turns),
        "lookup_ratio_is": RATIO,
    }


def _scene_facts(settings: BenchSettings, grid_threshold: float) -> dict[str, Any]:
    return {
        "name": settings.scene,
        "mode": settings.mode,
        "interocular_distance": INTEROCULAR,
        "convergence_distance": CONVERGENCE,
        "grid_threshold": grid_threshold,
        "accuracy": ACCURACY,
    }


def _scipy_lookup() -> Callable[[NDArray, NDArray, NDArray], Callable[[], object]]:
    """What makes the bare lookup: colours (H, W, >= 3), and x, y (H, W) in pixels as a `Warp` has them."""
    try:
        from scipy.ndimage import map_coordinates
    except ImportError as error:
        raise BadInputError(NEEDS_SCIPY.format(error)) from error

    def lookup_of(colours: NDArray, x: NDArray, y: NDArray) -> Callable[[], object]:
        # As one array: a list of two would be made into one by each call.
        where = np.nan_to_num(np.stack([y, x]) - np.float32(0.5))
        channels = [np.ascontiguousarray(colours[..., k]) for k in range(3)]
        return lambda: [map_coordinates(channel, where, order=1, output=np.float32) for channel in channels]

    return lookup_of


def _turn(stage: Stage, warp: Warper, lookup: Callable[[], object]) -> Turn:
    start = time.perf_counter()
    carried = stage.warp_view(warp)
    half = time.perf_counter()
    _ = carried.reasons
    done = time.perf_counter()
    del carried
    begun = time.perf_counter()
    lookup()
    looked_up = time.perf_counter()
    if warp is not NUMPY:
        return Turn(half - start, done - half, looked_up - begun, None)
    stage.map()
    return Turn(half - start, done - half, looked_up - begun, time.perf_counter() - looked_up)


def _peak_bytes(call: Callable[[], object]) -> int:
    """The most that Python and numpy hold at once while it runs, over what they held before."""
    tracemalloc.start()
    try:
        call()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def _agreement(stage: Stage, find_gpu: FindGpu) -> dict[str, Any]:
    """How far numpy and the GPU differ: in the share of pixels that are holes in one of them alone, and in the largest
    difference of a colour where neither has one."""
    gpu, why = find_gpu()
    if gpu is None:
        return {"holes": None, "colour": None, "why_none": why}
    a, reasons = stage.whole(NUMPY)
    try:
        b, others = stage.whole(gpu)
    except BadInputError:
        return {"holes": None, "colour": None, "why_none": f"{gpu.device} {LEFT_TO_NUMPY}"}
    answered = (reasons == 0) & (others == 0)
    apart = np.abs(a.passes[COLOUR_PASS][answered] - b.passes[COLOUR_PASS][answered])
    differ = float(np.mean((reasons != 0) != (others != 0)))
    return {"holes": differ, "colour": float(apart.max(initial=0.0)), "why_none": None}
