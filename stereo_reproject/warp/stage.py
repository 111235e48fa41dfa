"""The choice between NumPy and a GPU for the warp."""

from __future__ import annotations

import time
from collections.abc import Callable

from .tuning import TUNING
from .warper import NUMPY, Warper


def choose_warper(
    asked: str, pixels: int, gpu: Callable[[], Warper | None], is_faster: Callable[[Warper], bool]
) -> Warper:
    """Return the warper that was asked for: "numpy", "gpu" or "auto", as in `settings.frame.WARPS`.

    NumPy's is returned, without an error, where no GPU works; for "auto", also where the picture has too few pixels or
    the GPU is not faster. gpu looks for a GPU and returns None where there is none, which takes a while; is_faster
    measures whether that one is.
    """
    if asked == "numpy" or (asked == "auto" and pixels < TUNING.least_gpu_pixels):
        return NUMPY
    found = gpu()
    return NUMPY if found is None or (asked == "auto" and not is_faster(found)) else found


def seconds_taken(run: Callable[[Warper], object], warper: Warper) -> float:
    """Return the seconds that one call of `run` takes with this warper."""
    start = time.perf_counter()
    run(warper)
    return time.perf_counter() - start
