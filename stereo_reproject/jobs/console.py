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
from .supervisor import FRAME, VIEW, Event

PROGRAM = "stereo_reproject"
BAR_LENGTH = 24
REDRAW_SECONDS = 0.1


class Console:
    """The output of a run to the user: progress and the summary go to standard output, warnings and errors to standard
    error. With `quiet` set, only warnings and errors are printed."""

    def __init__(self) -> None:
        self.quiet = False
        self._line: _StageLine | None = None
        self._output_error: OSError | None = None

    def show(self, text: str) -> None:
        """Print a text of one or several lines on standard output, unless `quiet` is set. An error of writing is kept
        for `finish`."""
        if self.quiet or sys.stdout is None:
            return
        try:
            for line in text.splitlines():
                sys.stdout.write(_encodable(_escape(line), sys.stdout) + "\n")
        except OSError as error:
            self._output_error = error

    def complain(self, message: str, *, kind: str | None) -> None:
        """Print a message as one line on standard error, with the program's name before it and `kind` ("warning",
        "error", or None for neither) between the two. A progress line on the terminal is cleared first."""
        if self._line is not None:
            self._line.erase()
        if sys.stderr is None:
            return
        with contextlib.suppress(OSError):
            text = ": ".join(filter(None, (PROGRAM, kind, one_line(message))))
            sys.stderr.write(_encodable(text, sys.stderr) + "\n")
            sys.stderr.flush()

    def on_event(self, event: Event) -> None:
        """Show one event that the worker has sent: a warning, a note, a finished frame, or a stage. Stages are shown on
        a terminal only."""
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
        """Print a text on standard output at once, in place of any progress line, which is drawn again later."""
        if self._line is not None:
            self._line.erase()
        self.show(text)
        if sys.stdout is not None:
            with contextlib.suppress(OSError):
                sys.stdout.flush()

    def _on_frame(self, event: Event) -> None:
        """Show that a frame of an animation is finished: on a terminal the bar advances; elsewhere a line is printed,
        as it suits a log file."""
        if not _is_terminal(sys.stdout):
            self._note(_frame_text(event))
        elif not self.quiet:
            self._animation_line().advance(event)

    def _animation_line(self) -> _AnimationLine:
        """Return the progress line of the animation. If another line is shown, or none, that one is ended and a new one
        begun."""
        if not isinstance(self._line, _AnimationLine):
            self.end_stage()
            self._line = _AnimationLine(sys.stdout)
        return self._line

    def _on_stage(self, event: Event) -> None:
        """Show the stage that the worker is in, and how much of it is done. In an animation the stage is shown in the
        line of all frames, and while many views are made in theirs."""
        stage, detail = str(event.get("stage")), str(event.get("detail") or "")
        if detail.startswith(FRAME):
            self._animation_line().update(event.get("fraction"), f"{detail}: {label_of(stage)}")
            return
        view, fraction = VIEW.fullmatch(detail), event.get("fraction")
        if view is not None:
            # One line for all views, whatever stages each of them goes through.
            stage, fraction, detail = "views", (int(view[1]) - 1) / max(int(view[2]), 1), f"{detail}: {label_of(stage)}"
        if self._line is None or self._line.stage != stage:
            self.end_stage()
            self._line = _StageLine(stage, sys.stdout)
        self._line.update(fraction, detail)

    def on_tick(self) -> None:
        """Draw the progress line anew, so that its seconds go on. To be called several times a second."""
        if self._line is not None:
            self._line.draw()

    def end_stage(self) -> None:
        """Finish the progress line, if there is one: it stays on the terminal as it is, and output goes on below it."""
        if self._line is not None:
            self._line.close()
            self._line = None

    def let_go(self) -> None:
        """Discard all further output to each output stream whose reader takes nothing now, because writing to it might
        wait forever. Used when the run was interrupted."""
        for stream in (sys.stdout, sys.stderr):
            if stream is not None and not _takes_more(stream):
                _discard_output(stream)

    def finish(self, status: int) -> int:
        """Flush standard output and return the exit status of the program: `status`, or 1 in its place where that is 0
        and the output could not be written. A reader that closed the pipe is no such failure."""
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
    """The progress line of one stage on a terminal, rewritten in place: the stage's name, a bar, the seconds so far,
    and a detail. `stage` is the stage's name."""

    def __init__(self, stage: str, stream: TextIO) -> None:
        self.stage = stage
        self._stream = stream
        self._started = time.monotonic()
        self._drawn = self._started - REDRAW_SECONDS
        self._fraction: float | None = None
        self._detail = ""
        self._length = 0

    def update(self, fraction: Any, detail: str) -> None:
        """Take over a new state of the stage and draw the line. fraction is the part that is done, from 0 to 1, or
        anything that is not a number where it is not known; detail is a text for the end of the line."""
        self._fraction = min(max(fraction, 0.0), 1.0) if isinstance(fraction, (int, float)) else None
        self._detail = detail
        self.draw()

    def draw(self) -> None:
        """Draw the line, unless it was drawn less than REDRAW_SECONDS ago."""
        now = time.monotonic()
        if now - self._drawn >= REDRAW_SECONDS:
            self._drawn = now
            self._write(self._text())

    def erase(self) -> None:
        """Clear the line on the terminal, so that something else can be printed there. The next `draw` shows the line
        again."""
        self._write("")
        self._write("")
        self._drawn -= REDRAW_SECONDS

    def close(self) -> None:
        """Draw the line a last time and go to a new line of the terminal; the drawn one stays visible. A bar is shown
        full, and the detail is left out."""
        self._fraction = None if self._fraction is None else 1.0
        self._detail = ""
        self._write(self._text(), end="\n")

    def _text(self) -> str:
        """Return the text of the line, with a bar only where the fraction is known."""
        bar = ""
        if self._fraction is not None:
            filled = round(BAR_LENGTH * self._fraction)
            bar = f"[{'#' * filled}{'-' * (BAR_LENGTH - filled)}] {100 * self._fraction:3.0f} %"
        seconds = time.monotonic() - self._started
        return f"{self.stage:<10} {bar:<{BAR_LENGTH + 8}} {seconds:7.1f} s  {self._detail}".rstrip()

    def _write(self, text: str, end: str = "") -> None:
        """Write a text over the line on the terminal, cut to the terminal's width; `end` follows it. A terminal that is
        gone is no error."""
        # A line that wraps cannot be rewritten.
        text = _encodable(_escape(text)[: shutil.get_terminal_size().columns - 1], self._stream)
        # A terminal that has gone away is no reason to stop.
        with contextlib.suppress(OSError):
            self._stream.write("\r" + text.ljust(self._length) + end)
            self._stream.flush()
        self._length = len(text)


class _AnimationLine(_StageLine):
    """The progress line of a whole animation: a bar over all frames, with the figures of the last finished frame and
    the running stage."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__("frames", stream)
        self._event: Event = {"done": 0, "total": 0}

    def advance(self, event: Event) -> None:
        """Take over the "frame" event of a frame that was just finished, and draw the line."""
        self._event = event
        self.draw()

    def close(self) -> None:
        """Draw the line a last time, without the running stage, and go to a new line of the terminal. The bar stays
        where it is."""
        self._detail = ""
        self._write(self._text(), end="\n")

    def _text(self) -> str:
        """Return the text of the line: the bar, the seconds per frame, the figures of the last frame, and the running
        stage. Before the first frame is finished there are no figures."""
        done, total = self._event["done"], self._event["total"]
        filled = BAR_LENGTH * done // max(total, 1)
        bar = f"[{'#' * filled}{'-' * (BAR_LENGTH - filled)}]"
        each = self._event.get("each")
        pace = [f"{each:.1f} s per frame"] if isinstance(each, (int, float)) else []
        figures = [*pace, *_frame_figures({**self._event, "seconds": None})] if total else []
        return "  ".join(filter(None, (bar, *figures, self._detail)))


def _frame_text(event: Event) -> str:
    """Return the line that is printed for a finished frame where the output is no terminal, from its "frame" event."""
    return "  ".join([f"frame {event.get('frame')}", *_frame_figures(event)])


def _frame_figures(event: Event) -> list[str]:
    """Return the parts of the text about a finished frame, from its "frame" event: its seconds, the share that was
    traced, the number of frames that are done, and the time that is left. What the event does not know is left out."""
    seconds, traced = event.get("seconds"), event.get("traced")
    return [
        *([f"{seconds:.1f} s"] if isinstance(seconds, (int, float)) else []),
        *([f"{100 * traced:.0f} % traced"] if isinstance(traced, (int, float)) else []),
        f"{event.get('done')} of {event.get('total')}",
        f"{clock(float(event.get('remaining') or 0.0))} left",
    ]


def one_line(text: str) -> str:
    """Return `text` on one line, with characters that a terminal might take as commands written as escapes."""
    return _escape(" ".join(text.split()))


def _escape(text: str) -> str:
    """Return `text` with every character that is not printable written as an escape, such as \\x1b for the character
    that begins terminal commands."""
    return "".join(char if char.isprintable() else char.encode("unicode_escape").decode() for char in text)


def _encodable(text: str, stream: TextIO) -> str:
    """Return `text` with every character that the stream's encoding lacks written as an escape."""
    encoding = stream.encoding or "ascii"
    return text.encode(encoding, "backslashreplace").decode(encoding)


def _is_terminal(stream: TextIO | None) -> bool:
    """Return True if the stream is open and leads to a terminal."""
    return stream is not None and not stream.closed and stream.isatty()


def _takes_more(stream: TextIO) -> bool:
    """Return True if a stream can be written to without waiting for its reader. Where that cannot be found out, as on
    Windows, the answer is True."""
    if sys.platform == "win32":
        return True
    with contextlib.suppress(OSError, ValueError):
        return bool(select.select([], [stream], [], 0.0)[1])
    return True


def _discard_output(stream: TextIO) -> None:
    """Make an output stream lead to nowhere. Python flushes standard output once more at exit, and that must not fail
    or wait."""
    with contextlib.suppress(OSError, io.UnsupportedOperation):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
