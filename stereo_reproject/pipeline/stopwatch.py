"""A stopwatch for the stages of a frame."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Stopwatch:
    """Measures the seconds of stages, one after the other.

    `lap` ends the stage that runs and begins the next; `seconds` has those of the ended stages, by name. on_stage is
    called with the name of each stage as it begins.
    """

    def __init__(self, on_stage: Callable[[str], None] = lambda _: None) -> None:
        self.seconds: dict[str, float] = {}
        self._on_stage = on_stage
        self._stage = ""
        self._start = time.perf_counter()

    @property
    def seconds_so_far(self) -> float:
        """Seconds since the running stage began."""
        return time.perf_counter() - self._start

    def lap(self, stage: str = "") -> None:
        """End the stage that runs, if one does, and begin this one; an empty name begins none.

        The ended stage's time is added to `seconds`; on_stage is called with the new one's name.
        """
        now = time.perf_counter()
        if self._stage:
            self.seconds[self._stage] = self.seconds.get(self._stage, 0.0) + now - self._start
        self._stage, self._start = str(stage), now
        if stage:
            self._on_stage(stage)

    @contextmanager
    def aside(self, stage: str) -> Iterator[None]:
        """Add the time of a `with` block to this stage, and not to the one that runs and goes on afterwards; on_stage
        is not called."""
        start = time.perf_counter()
        yield
        spent = time.perf_counter() - start
        self.seconds[str(stage)] = self.seconds.get(str(stage), 0.0) + spent
        self._start += spent
