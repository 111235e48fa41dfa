"""Progress of an animation, and the time that its remaining frames will take."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..pipeline.onlooker import NOBODY, Onlooker
from ..settings.animation import spelled
from .figures import figures_of
from .frame_record import Record
from .frames import FrameListener, FramePlan


@dataclass(frozen=True)
class Listener:
    """Functions that are called as an animation goes on. on_stage gets a stage's name and a detail that names the
    frame; on_frame gets the "frame" event of each finished frame (see `jobs/supervisor`); note and warn get texts for
    the user. An onlooker is shown the eyes of each frame as they are made."""

    on_stage: Callable[[str, str], None] = lambda _stage, _detail: None
    on_frame: Callable[[Mapping[str, Any]], None] = lambda _event: None
    note: Callable[[str], None] = lambda _text: None
    warn: Callable[[str], None] = lambda _text: None
    onlooker: Onlooker = NOBODY


def saved_by_frame(figures: Mapping[str, Any]) -> float | None:
    """Return the seconds that a frame has saved over Blender's multiview, from the figures of its record; negative
    where it took longer, None where they do not say."""
    multiview, taken = figures.get("multiview_seconds"), figures.get("wall_seconds")
    return None if multiview is None or taken is None else multiview - taken


class AnimationProgress:
    """The progress of an animation. Each finished frame of `total` is reported to `listener`, with the time that the
    others will take; frames that fail are added to the dict `failed` with the reason.

    Its `frame_listener` is the one to pass to `render_frames`. clock returns seconds. The time per frame is measured
    from the end of the first frame on, so that what comes before does not count.
    """

    def __init__(
        self,
        plan: FramePlan,
        total: int,
        listener: Listener,
        failed: dict[int, str],
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._total, self._left = total, len(plan.todo)
        self._failed, self._out = failed, listener
        self._clock, self._done = clock, 0
        self._since: float | None = None
        self._each = 0.0
        self._waited = False
        self.frame_listener = FrameListener(self._on_done, self._on_failed, self._on_wait)

    def _on_done(self, frame: int, record: Record) -> None:
        """Report a finished frame and the warnings in its record."""
        # Another run's record is as trustworthy as the drive that it lies on.
        figures, _ = figures_of(record)
        self._step(figures.get("wall_seconds"))
        self._out.on_frame(
            {
                "frame": frame,
                "seconds": figures.get("wall_seconds"),
                "saved": saved_by_frame(figures),
                "traced": figures.get("fractions", {}).get("rerendered"),
                **self._far(),
            }
        )
        for warning in figures.get("warnings", ()):
            self._out.warn(warning)

    def _on_failed(self, frame: int, why: str) -> None:
        """Report a frame that could not be rendered, and note it in `failed`."""
        self._failed[frame] = why
        self._step(None)
        self._out.warn(f"frame {frame} failed and is left out: {why}")

    def _step(self, seconds: Any) -> None:
        """Count a frame that is done or has failed, and update the time per frame. `seconds` are the frame's own, used
        for the first frame only; None if they are not known."""
        self._left -= 1
        self._done += 1
        now = self._clock()
        if self._since is None:
            self._since = now
            self._each = float(seconds) if isinstance(seconds, (int, float)) else 0.0
        else:
            # From one end to the next: what is written beside, and what other runs take over, is in there.
            self._each = (now - self._since) / (self._done - 1)

    def _far(self) -> dict[str, Any]:
        """Return the fields of a "frame" event about the whole animation: frames done and in total, seconds per frame,
        and seconds that remain."""
        done, each = self._total - self._left, self._each
        return {"done": done, "total": self._total, "each": each, "remaining": each * self._left}

    def _on_wait(self, frames: Sequence[int]) -> None:
        """Tell the user, once, that this run waits for frames of other runs."""
        if not self._waited:
            self._waited = True
            self._out.note(f"waits for what other runs are rendering: {spelled(frames)}")
