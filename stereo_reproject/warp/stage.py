"""Which part of the machine warps pixels from one eye to the other: numpy on a core, or a GPU."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from .warper import Warper, warp_view

LEAST_PIXELS = 4_000_000
"""From which a GPU is thought of unasked; for fewer, numpy takes too little time to be worth it."""


@dataclass(frozen=True)
class WarpStage:
    """Who warps; device is the GPU's name."""

    warp_view: Warper
    device: str | None = None


NUMPY = WarpStage(warp_view)


def choose_stage(
    asked: str, pixels: int, gpu: Callable[[], WarpStage | None], is_faster: Callable[[WarpStage], bool]
) -> WarpStage:
    """Of `settings.frame.WARPS` what was asked for; numpy, without a word, where there is no GPU that works.

    gpu finds one, which takes a while; is_faster measures whether one is, for pictures of so many pixels.
    """
    if asked == "numpy" or (asked == "auto" and pixels < LEAST_PIXELS):
        return NUMPY
    found = gpu()
    return NUMPY if found is None or (asked == "auto" and not is_faster(found)) else found


def takes(run: Callable[[Warper], object], stage: WarpStage) -> float:
    """Seconds that `run` takes with it."""
    start = time.perf_counter()
    run(stage.warp_view)
    return time.perf_counter() - start
