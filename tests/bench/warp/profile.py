"""Where the time of numpy's warp stage goes: by its functions, as Python's own profiler times them."""

from __future__ import annotations

import cProfile
import statistics
from collections.abc import Callable
from types import CodeType

from stereo_reproject.holes.classifier import HoleClassifier
from stereo_reproject.warp.composite import warp_passes
from stereo_reproject.warp.discontinuities import disparity_of, disparity_steps
from stereo_reproject.warp.empty import empty_reasons
from stereo_reproject.warp.forward import forward_warp
from stereo_reproject.warp.grid import build_grid
from stereo_reproject.warp.warper import warp_view

RUNS = 3

CARRY_STEPS = {
    "grid": (build_grid,),
    "steps": (disparity_of, disparity_steps),
    "map": (forward_warp,),
    "lookup": (warp_passes,),
    "holes": (empty_reasons,),
}
"""What `warp_view` calls, by step. The depth test is in the map: a row's nearest is kept as it is drawn."""

REASONS_STEPS = (HoleClassifier.source_edges, HoleClassifier.without_unusable, HoleClassifier.reasons)
"""What judges the pixels that are warped; the first two are called before `reproject` returns."""

REASONS, REST = "reasons", "rest"
STEPS = (*CARRY_STEPS, REASONS, REST)


def profiled(stage: Callable[[], object]) -> dict[str, float]:
    """Seconds of each of `STEPS`, medians of `RUNS` runs of the whole stage; the profiler's own time is in them."""
    runs = [_profile(stage) for _ in range(RUNS)]
    return {step: statistics.median(run[step] for run in runs) for step in STEPS}


def _profile(stage: Callable[[], object]) -> dict[str, float]:
    profiler = cProfile.Profile()
    profiler.runcall(stage)
    entries = {entry.code: entry for entry in profiler.getstats() if isinstance(entry.code, CodeType)}
    carried = {called.code: called.totaltime for called in entries[warp_view.__code__].calls or ()}
    seconds = {
        step: sum(carried[function.__code__] for function in functions) for step, functions in CARRY_STEPS.items()
    }
    seconds[REASONS] = sum(entries[function.__code__].totaltime for function in REASONS_STEPS)
    whole = max(entry.totaltime for entry in entries.values())
    return {**seconds, REST: whole - sum(seconds.values())}
