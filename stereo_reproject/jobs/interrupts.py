"""Signals that end a run: held back while something is half done, but not for longer than that takes."""

from __future__ import annotations

import os
import queue
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from ..errors import StereoReprojectError

HELD_SECONDS = 2.0
"""Longest time that a signal is held back. A process that has not come to `check` by then waits for something that does
not answer: a drive that is away, or a terminal that is stopped."""

CLEANING_SECONDS = 30.0
"""Longest time after that for removing the files of the run; then the process ends, and the next run removes them."""

RETRY_SECONDS = 0.2
"""Time between two attempts to interrupt a call: a signal may come just before the call begins."""

_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name))
_SIGNAL_WORDS: dict[int, str] = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}


class RunInterruptedError(StereoReprojectError):
    """A signal ended the run."""

    def __init__(self, signum: int, kept: str = "no result was written") -> None:
        super().__init__(f"{_SIGNAL_WORDS.get(signum, 'stopped')}; {kept}")
        self.signum = signum
        self.exit_status = 128 + signum


class Interrupts:
    """Holds back the signals that end a run until `check` is called, at a moment when nothing is half done.

    One that has been held back for HELD_SECONDS is raised wherever the main thread is: in a call that hangs, for it
    would have come to `check` otherwise. So whatever is half done is undone by those that it is raised through. When
    that hangs as well, the process ends after CLEANING_SECONDS. (Windows lets no one tear a thread out of a call: a run
    that hangs there in a drive ends when the drive answers.)
    """

    def __init__(self) -> None:
        self._received: int | None = None
        self._previous: dict[int, Any] = {}
        self._is_stuck = self._is_raised = self._is_cleaning = False
        # Of all ways to pass something to a thread, this one may be used in a signal handler.
        self._news: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._watcher: threading.Thread | None = None

    def __enter__(self) -> Interrupts:
        if threading.current_thread() is not threading.main_thread():
            return self
        for signum in _SIGNALS:
            previous = signal.getsignal(signum)
            # Under nohup a run is meant to outlive its terminal.
            if previous == signal.SIG_IGN and signum != signal.SIGINT:
                continue
            self._previous[signum] = signal.SIG_DFL if previous is None else previous
            signal.signal(signum, self._receive)
        self._watcher = threading.Thread(target=self._watch, daemon=True)
        self._watcher.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_cleaning = True
        if self._watcher is not None:
            self._news.put("left")
            self._watcher.join()
        for signum, previous in self._previous.items():
            signal.signal(signum, previous)

    def _receive(self, signum: int, _frame: FrameType | None) -> None:
        if self._received is None:
            self._received = signum
            self._news.put("received")
        elif self._is_stuck and not self._is_raised and not self._is_cleaning:
            self._is_raised = True
            raise RunInterruptedError(self._received)

    def check(self) -> None:
        """Raise RunInterruptedError if a signal has come."""
        if self._received is not None:
            self._is_raised = True
            self._news.put("raised")
            raise RunInterruptedError(self._received)

    @contextmanager
    def until_cleaning(self) -> Iterator[None]:
        """Interrupt calls in the body where a signal is held for too long; what follows the body removes a run's files,
        and is not interrupted."""
        self._is_cleaning = False
        try:
            yield
        finally:
            self._is_cleaning = True

    def _watch(self) -> None:
        news = self._news.get()
        if news == "received":
            news = self._next_news(HELD_SECONDS)
        self._is_stuck = news is None
        ends = time.monotonic() + CLEANING_SECONDS
        while news != "left":
            if time.monotonic() > ends:
                os._exit(128 + (self._received or 0))
            if self._is_stuck and not self._is_raised:
                self._tear()
            news = self._next_news(RETRY_SECONDS)

    def _next_news(self, seconds: float) -> str | None:
        try:
            return self._news.get(timeout=seconds)
        except queue.Empty:
            return None

    def _tear(self) -> None:
        main = threading.main_thread().ident
        if hasattr(signal, "pthread_kill") and main is not None and self._received is not None:
            # The handler comes up in the main thread, and out of the call that it hangs in.
            signal.pthread_kill(main, self._received)
