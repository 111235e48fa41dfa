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
    """A signal, such as that of Ctrl-C, ended the run. signum is the signal's number, and kept says in words what
    became of the results."""

    def __init__(self, signum: int, kept: str = "no result was written") -> None:
        super().__init__(f"{_SIGNAL_WORDS.get(signum, 'stopped')}; {kept}")
        self.signum = signum
        self.exit_status = 128 + signum


class Interrupts:
    """A guard that holds back the signals that end a run, for the time of a `with` block: they take effect when `check`
    is called, at a moment when nothing is half done. Afterwards the earlier signal handlers are restored, also after an
    error.

    If `check` is not called within HELD_SECONDS of a signal, the main thread probably hangs in a call. Then
    RunInterruptedError is raised inside that call, and the code that it passes through has to undo what is half done.
    If the clean-up hangs as well, the process ends after CLEANING_SECONDS. (On Windows nothing can interrupt a call: a
    run that hangs in a drive ends when the drive answers.) Outside the main thread the block changes nothing.
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
        """Take a signal; the handler of all signals that are held back. The first one is remembered. A later one, of
        the user's or from `_tear`, raises RunInterruptedError if the main thread hangs."""
        if self._received is None:
            self._received = signum
            self._news.put("received")
        elif self._is_stuck and not self._is_raised and not self._is_cleaning:
            self._is_raised = True
            raise RunInterruptedError(self._received)

    def check(self) -> None:
        """Raise RunInterruptedError if a signal has come. To be called often, whenever nothing is half done."""
        if self._received is not None:
            self._is_raised = True
            self._news.put("raised")
            raise RunInterruptedError(self._received)

    @contextmanager
    def until_cleaning(self) -> Iterator[None]:
        """Let signals interrupt hanging calls for the time of a `with` block. Code after the block, which removes the
        run's files, is not interrupted any more."""
        self._is_cleaning = False
        try:
            yield
        finally:
            self._is_cleaning = True

    def _watch(self) -> None:
        """Wait for a signal and see that it takes effect; runs in a thread of its own. If the main thread does not come
        to `check` within HELD_SECONDS, its call is interrupted again and again, and after CLEANING_SECONDS more the
        process is ended."""
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
        """Return the next message from the main thread: "received" (a signal came), "raised" (its exception was raised)
        or "left" (the `with` block is over). None if no message comes within `seconds`."""
        try:
            return self._news.get(timeout=seconds)
        except queue.Empty:
            return None

    def _tear(self) -> None:
        """Send the signal to the main thread once more, so that it leaves the call that it hangs in. Does nothing on
        Windows, which has no such means."""
        main = threading.main_thread().ident
        if hasattr(signal, "pthread_kill") and main is not None and self._received is not None:
            # The handler comes up in the main thread, and out of the call that it hangs in.
            signal.pthread_kill(main, self._received)
