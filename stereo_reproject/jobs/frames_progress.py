"""Progress of an animation, and the time that remains: from the frames that are finished, and within the one that is
rendered."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from .progress import Progress
from .supervisor import frame_of

MIN_TELLING_FRACTION = 0.2
"""Fraction of the first frame from which on it tells how long all others take: its beginning is slower than the rest,
and an error counts as often as there are frames."""


class FramesProgress:
    """An estimate of how much of an animation of `total` frames is done and how long it still takes; used as `Progress`
    is, with each finished frame reported to `finish` besides.

    of_frame returns the progress of a frame that begins at the time that it is given, in seconds.
    """

    def __init__(self, now: float, total: int, of_frame: Callable[[float], Progress]) -> None:
        self._total, self._of_frame = max(total, 1), of_frame
        self._frame, self._started = of_frame(now), now
        self._begun: list[int] = []
        self._done, self._each = 0, 0.0
        self._shown = 0.0

    def begin(self, stage: str, now: float, detail: str = "") -> None:
        """Report that a stage has begun; a `detail` that names another frame than before begins that."""
        number = frame_of(detail)
        if number is not None and number not in self._begun[-1:]:
            self._frame, self._started = self._of_frame(now), now
            self._begun.append(number)
        self._frame.begin(stage, now)

    def advance(self, fraction: float | None, now: float) -> None:
        """Report how much of the current stage is done, from 0 to 1; None where that is not known."""
        self._frame.advance(fraction, now)

    def finish(self, event: Mapping[str, Any]) -> None:
        """Report a finished frame by its "frame" event, see `jobs/supervisor`.

        It may be later than the start of the next frame, which is rendered while the one before is written; and the
        frame may be another run's.
        """
        frame = event["frame"]
        if frame in self._begun:
            # Those before it have failed, or are counted by the event too.
            del self._begun[: self._begun.index(frame) + 1]
        self._done, self._total, self._each = event["done"], max(event["total"], 1), event["each"]

    @property
    def _before(self) -> int:
        """Number of frames that are rendered, before the one that is under way."""
        return self._done + max(len(self._begun) - 1, 0)

    @property
    def _is_between(self) -> bool:
        """True where the last frame is finished and the next has not begun."""
        return self._done > 0 and not self._begun

    def fraction(self, now: float) -> float:
        """Return the fraction of all frames that is done, from 0 to 1, and never less than before."""
        own = 0.0 if self._is_between else self._frame.fraction(now)
        self._shown = max(self._shown, min((self._before + own) / self._total, 1.0))
        return self._shown

    def remaining(self, now: float) -> float | None:
        """Return the seconds that the animation still takes by estimate; None as long as they cannot be estimated."""
        if self._is_between:
            return max(self._total - self._done, 0) * self._each
        taken, left = now - self._started, self._frame.remaining(now)
        later = max(self._total - self._before - 1, 0)
        if not self._each:
            if left is None or (later and self._frame.fraction(now) < MIN_TELLING_FRACTION):
                return None
            return left + later * (taken + left)
        return max(self._each - taken if left is None else left, 0.0) + later * self._each
