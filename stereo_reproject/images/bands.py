"""Bands: a picture is worked on a few rows at a time, so that temporaries fit a processor's cache, and on several cores
at once."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

BAND_PIXELS = 1 << 16
"""Pixels of a band, at most, if it has more than one row: a few temporaries of four bytes per pixel fit a megabyte."""

MAX_THREADS = 4
"""Bands that are worked on at once, at most: each has temporaries of its own, and what is Python's own work runs in one
thread at a time, so that more gain little."""


def bands(shape: tuple[int, ...]) -> Iterator[slice]:
    """Return slices of rows that cover an array of shape (H, W, ...) from top to bottom, so that it is worked on in
    parts.

    A slice has at most `BAND_PIXELS` pixels, or a single row where a row has more.
    """
    height, width = shape[:2]
    rows = max(BAND_PIXELS // max(width, 1), 1)
    return (slice(top, min(top + rows, height)) for top in range(0, height, rows))


def over_bands(shape: tuple[int, ...], work: Callable[[slice], None]) -> None:
    """Call `work` with each slice of `bands(shape)`, several at once where this process may use several cores.

    work must read nothing that its call for another slice writes: the result is then the same for any number of
    threads. An error of `work` is raised. All threads have ended when this returns, because Blender 4.5 may crash where
    one runs beside a render.
    """
    _work_on(list(bands(shape)), work)


def by_bands(function: Callable[..., NDArray], *images: NDArray) -> NDArray:
    """Return function(*images), computed on bands of the images (H, W, ...) as `over_bands` works on them.

    function must take each row by itself: its result for some rows of the images, (h, ...), is those rows of its result
    for all.
    """
    parts = list(bands(images[0].shape))
    if len(parts) < 2:
        return function(*images)
    first = function(*(image[parts[0]] for image in images))
    result = np.empty((len(images[0]), *first.shape[1:]), first.dtype)
    result[parts[0]] = first

    def work(rows: slice) -> None:
        result[rows] = function(*(image[rows] for image in images))

    _work_on(parts[1:], work)
    return result


def _work_on(parts: Sequence[slice], work: Callable[[slice], None]) -> None:
    """Call `work` with each of these slices, as `over_bands` says."""
    open_parts = iter(parts)

    def work_through() -> None:
        # All threads take from the one iterator, which gives each part once.
        for rows in open_parts:
            work(rows)

    others = min(len(parts), usable_cores(), MAX_THREADS) - 1
    if others < 1:
        work_through()
        return
    with ThreadPoolExecutor(others) as pool:
        started = [pool.submit(work_through) for _ in range(others)]
        work_through()
        for other in started:
            other.result()


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
