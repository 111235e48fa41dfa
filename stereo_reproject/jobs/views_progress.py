"""Progress of many views, and the time that remains: by how many of them are finished."""

from __future__ import annotations

from ..pipeline.stages import Stage
from .supervisor import VIEW

SHARE_OF_VIEWS = 0.95
"""Share of the run that the views take; the rest is what comes after them: the quilt and the other pictures."""

LEAST_TELLING_SHARE = 0.25
"""Share of the views that must be finished before their pace tells how long the others take: the first ones are
rendered whole, and most others are not."""


class ViewsProgress:
    """An estimate of how much of a run of `count` views is done and how long it still takes. It is told and asked as
    `Progress` is; the detail of a stage names the view, see `VIEW`.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._finished = 0
        self._stage, self._part = "", 0.0
        self._started: float | None = None
        """Time at which the first view was begun; None before."""
        self._pace: float | None = None
        """Seconds for each view that is finished; None before the first."""
        self._counted = 0.0
        """Time at which the last view was finished."""
        self._after = False

    def begin(self, stage: str, now: float, detail: str = "") -> None:
        """Report that a stage has begun; detail is the view that is made in it, or empty."""
        view = VIEW.fullmatch(detail)
        self._stage, self._part = stage, 0.0
        if view is None:
            self._after = self._started is not None
            return
        if self._started is None:
            self._started = self._counted = now
        finished = int(view[1]) - 1
        if finished > self._finished:
            self._finished, self._counted = finished, now
            self._pace = (now - self._started) / finished

    def advance(self, fraction: float | None, _now: float) -> None:
        """Report how much of the present stage is done, from 0 to 1; it counts where a view is rendered whole."""
        self._part = fraction or 0.0 if self._stage == Stage.SOURCE else 0.0

    def fraction(self, _now: float) -> float:
        """Return the fraction of the run that is done, from 0 to 1."""
        done = self._count if self._after else self._finished + self._part
        return SHARE_OF_VIEWS * min(done / self._count, 1.0)

    def remaining(self, now: float) -> float | None:
        """Return the seconds that the views still take by estimate; None as long as they cannot be estimated."""
        if self._after or self._pace is None or self._finished < LEAST_TELLING_SHARE * self._count:
            return None
        return max(self._pace * (self._count - self._finished) - (now - self._counted), 0.0)
