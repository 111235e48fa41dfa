"""Output of a run on a terminal or into a pipe, while it runs and at its end, whatever becomes of either."""

from __future__ import annotations

import contextlib
import io
import os
import select
import shutil
import sys
import time
from typing import Any, TextIO

from ..errors import StereoReprojectError
from ..pipeline.stages import label_of
from .progress import clock
from .supervisor import FRAME, Event

PROGRAM = "stereo_reproject"
BAR_LENGTH = 24
REDRAW_SECONDS = 0.1


class Console:
    """Output of a run: progress and summary on standard output, warnings and errors on standard error."""

    def __init__(self) -> None:
        self.quiet = False
        self._line: _StageLine | None = None
        self._output_error: OSError | None = None

    def show(self, text: str) -> None:
        """Print on standard output, unless quiet."""
        if self.quiet or sys.stdout is None:
            return
        try:
            for line in text.splitlines():
                sys.stdout.write(_encodable(_escape(line), sys.stdout) + "\n")
        except OSError as error:
            self._output_error = error

    def complain(self, message: str, *, kind: str | None) -> None:
        """Print one line on standard error."""
        if self._line is not None:
            self._line.erase()
        if sys.stderr is None:
            return
        with contextlib.suppress(OSError):
            text = ": ".join(filter(None, (PROGRAM, kind, one_line(message))))
            sys.stderr.write(_encodable(text, sys.stderr) + "\n")
            sys.stderr.flush()

    def on_event(self, event: Event) -> None:
        """Show an event of the worker."""
        match event["event"]:
            case "warning":
                self.complain(str(event.get("message")), kind="warning")
            case "note":
                self._note(one_line(str(event.get("message"))))
            case "frame":
                self._on_frame(event)
            case "stage" if not self.quiet and _is_terminal(sys.stdout):
                self._on_stage(event)

    def _note(self, text: str) -> None:
        if self._line is not None:
            self._line.erase()
        self.show(text)
        if sys.stdout is not None:
            with contextlib.suppress(OSError):
                sys.stdout.flush()

    def _on_frame(self, event: Event) -> None:
        """A frame is done: on a terminal the bar goes on, elsewhere there is a line for it, as logs want it."""
        if not _is_terminal(sys.stdout):
            self._note(_frame_text(event))
        elif not self.quiet:
            self._animation_line().advance(event)

    def _animation_line(self) -> _AnimationLine:
        if not isinstance(self._line, _AnimationLine):
            self.end_stage()
            self._line = _AnimationLine(sys.stdout)
        return self._line

    def _on_stage(self, event: Event) -> None:
        stage, detail = str(event.get("stage")), str(event.get("detail") or "")
        if detail.startswith(FRAME):
            self._animation_line().update(event.get("fraction"), f"{detail}: {label_of(stage)}")
            return
        if self._line is None or self._line.stage != stage:
            self.end_stage()
            self._line = _StageLine(stage, sys.stdout)
        self._line.update(event.get("fraction"), str(event.get("detail") or ""))

    def on_tick(self) -> None:
        """Let the seconds of the running stage count on."""
        if self._line is not None:
            self._line.draw()

    def end_stage(self) -> None:
        """Leave the line of the stage that is over, and go to the next."""
        if self._line is not None:
            self._line.close()
            self._line = None

    def let_go(self) -> None:
        """Say nothing any more to whoever does not read it: what waits for that would never end."""
        for stream in (sys.stdout, sys.stderr):
            if stream is not None and not _takes_more(stream):
                _discard_output(stream)

    def finish(self, status: int) -> int:
        """Write out what is held back and return the exit status: `status`, or 1 in place of 0 where that fails."""
        try:
            if sys.stdout is not None:
                sys.stdout.flush()
        except OSError as error:
            self._output_error = error
        if self._output_error is None:
            return status
        if sys.stdout is not None:
            _discard_output(sys.stdout)
        if isinstance(self._output_error, BrokenPipeError):
            # Whoever reads has seen enough.
            return status
        reason = self._output_error.strerror
        self.complain(f"standard output cannot be written ({reason}); redirect it elsewhere", kind="error")
        return status or StereoReprojectError.exit_status


class _StageLine:
    """The progress line of one stage, rewritten in place."""

    def __init__(self, stage: str, stream: TextIO) -> None:
        self.stage = stage
        self._stream = stream
        self._started = time.monotonic()
        self._drawn = self._started - REDRAW_SECONDS
        self._fraction: float | None = None
        self._detail = ""
        self._length = 0

    def update(self, fraction: Any, detail: str) -> None:
        self._fraction = min(max(fraction, 0.0), 1.0) if isinstance(fraction, (int, float)) else None
        self._detail = detail
        self.draw()

    def draw(self) -> None:
        now = time.monotonic()
        if now - self._drawn >= REDRAW_SECONDS:
            self._drawn = now
            self._write(self._text())

    def erase(self) -> None:
        self._write("")
        self._write("")
        self._drawn -= REDRAW_SECONDS

    def close(self) -> None:
        self._fraction = None if self._fraction is None else 1.0
        self._detail = ""
        self._write(self._text(), end="\n")

    def _text(self) -> str:
        bar = ""
        if self._fraction is not None:
            filled = round(BAR_LENGTH * self._fraction)
            bar = f"[{'#' * filled}{'-' * (BAR_LENGTH - filled)}] {100 * self._fraction:3.0f} %"
        seconds = time.monotonic() - self._started
        return f"{self.stage:<10} {bar:<{BAR_LENGTH + 8}} {seconds:7.1f} s  {self._detail}".rstrip()

    def _write(self, text: str, end: str = "") -> None:
        # A line that wraps cannot be rewritten.
        text = _encodable(_escape(text)[: shutil.get_terminal_size().columns - 1], self._stream)
        # A terminal that has gone away is no reason to stop.
        with contextlib.suppress(OSError):
            self._stream.write("\r" + text.ljust(self._length) + end)
            self._stream.flush()
        self._length = len(text)


class _AnimationLine(_StageLine):
    """The progress line of all frames."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__("frames", stream)
        self._event: Event = {"done": 0, "total": 0}

    def advance(self, event: Event) -> None:
        self._event = event
        self.draw()

    def close(self) -> None:
        self._detail = ""
        self._write(self._text(), end="\n")

    def _text(self) -> str:
        done, total = self._event["done"], self._event["total"]
        filled = BAR_LENGTH * done // max(total, 1)
        bar = f"[{'#' * filled}{'-' * (BAR_LENGTH - filled)}]"
        each = self._event.get("each")
        pace = [f"{each:.1f} s per frame"] if isinstance(each, (int, float)) else []
        figures = [*pace, *_frame_figures({**self._event, "seconds": None})] if total else []
        return "  ".join(filter(None, (bar, *figures, self._detail)))


def _frame_text(event: Event) -> str:
    return "  ".join([f"frame {event.get('frame')}", *_frame_figures(event)])


def _frame_figures(event: Event) -> list[str]:
    """Return the time and the traced fraction of a finished frame, and the progress of the animation, in words."""
    seconds, traced = event.get("seconds"), event.get("traced")
    return [
        *([f"{seconds:.1f} s"] if isinstance(seconds, (int, float)) else []),
        *([f"{100 * traced:.0f} % traced"] if isinstance(traced, (int, float)) else []),
        f"{event.get('done')} of {event.get('total')}",
        f"{clock(float(event.get('remaining') or 0.0))} left",
    ]


def one_line(text: str) -> str:
    """`text` on one line, with nothing in it that a terminal would take as a command."""
    return _escape(" ".join(text.split()))


def _escape(text: str) -> str:
    return "".join(char if char.isprintable() else char.encode("unicode_escape").decode() for char in text)


def _encodable(text: str, stream: TextIO) -> str:
    encoding = stream.encoding or "ascii"
    return text.encode(encoding, "backslashreplace").decode(encoding)


def _is_terminal(stream: TextIO | None) -> bool:
    return stream is not None and not stream.closed and stream.isatty()


def _takes_more(stream: TextIO) -> bool:
    """Return whether a stream can be written to without waiting for whoever reads it."""
    if sys.platform == "win32":
        return True
    with contextlib.suppress(OSError, ValueError):
        return bool(select.select([], [stream], [], 0.0)[1])
    return True


def _discard_output(stream: TextIO) -> None:
    """Python flushes standard output once more at exit; let that succeed."""
    with contextlib.suppress(OSError, io.UnsupportedOperation):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
