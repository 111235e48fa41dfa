"""A stopwatch for the stages of a frame."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from .onlooker import NOBODY, Onlooker
from .stages import Stage


class Stopwatch:
    """Measures the seconds of stages, one after the other, and those of showing pictures beside them.

    `lap` ends the stage that runs and begins the next; `seconds` has those of the ended stages, by name. The onlooker
    is told each stage as it begins, and shown pictures.
    """

    def __init__(self, onlooker: Onlooker = NOBODY) -> None:
        self.seconds: dict[str, float] = {}
        self.onlooker = onlooker
        self._stage = ""
        self._start = time.perf_counter()

    @property
    def seconds_so_far(self) -> float:
        """Seconds since the running stage began."""
        return time.perf_counter() - self._start

    def lap(self, stage: str = "") -> None:
        """End the stage that runs, if one does, and begin this one; an empty name begins none.

        The ended stage's time is added to `seconds`; the onlooker is told the new one's name.
        """
        now = time.perf_counter()
        if self._stage:
            self.seconds[self._stage] = self.seconds.get(self._stage, 0.0) + now - self._start
        self._stage, self._start = str(stage), now
        if stage:
            self.onlooker.on_stage(stage)

    @contextmanager
    def aside(self, stage: str) -> Iterator[None]:
        """Add the time of a `with` block to this stage, and not to the one that runs and goes on afterwards; the
        onlooker is told nothing."""
        start = time.perf_counter()
        yield
        spent = time.perf_counter() - start
        self.seconds[str(stage)] = self.seconds.get(str(stage), 0.0) + spent
        self._start += spent

    def move(self, seconds: float, stage: str, into: str) -> None:
        """Count so many seconds of an ended stage as those of another."""
        self.seconds[str(stage)] -= seconds
        self.seconds[str(into)] = self.seconds.get(str(into), 0.0) + seconds

    def show(self, view: str, picture: Callable[[], NDArray[np.float32]]) -> None:
        """Show the onlooker a view as it is so far, if pictures are wanted: `picture` returns its colour (H, W, 4), and
        is called only then. The time counts as that of the stage `look`."""
        if self.onlooker.show is not None:
            with self.aside(Stage.LOOK):
                self.onlooker.show(view, picture())
