"""Progress of a run, and the time that remains: from the usual times of its stages, and their times so far."""

from __future__ import annotations

from collections.abc import Mapping

from ..pipeline.stages import Stage
from ..words import Words

_PAIR = {
    Stage.PLAN: 1.0,
    Stage.LOOK: 0.0,
    Stage.SOURCE: 75.0,
    Stage.DENOISE_SOURCE: 0.0,
    Stage.WARP: 2.0,
    Stage.PILOT: 0.0,
    Stage.FILL: 10.0,
    Stage.REFINE: 6.0,
    Stage.COMPOSITE: 1.0,
    Stage.DENOISE_TARGET: 0.0,
    Stage.ACCOUNT: 1.0,
    Stage.WRITE: 3.0,
}
USUAL: Mapping[str, Mapping[str, float]] = {
    "render": {Stage.LOAD: 0.0, **_PAIR, Stage.COMPARE: 0.0},
    "animate": {Stage.LOAD: 0.0, Stage.PREPARE: 0.0, **_PAIR},
    "inspect": {Stage.LOAD: 0.0, Stage.PLAN: 0.0, Stage.SKETCH: 1.0},
}
"""Shares of a run's time by what is done, in the order of its stages. What loading has taken tells nothing of the rest.
"""

LOOK_SHARE = 10.0
"""Share of a first look, which the source then takes less: most of it is the scene's sync, which the source would pay
otherwise. It was 10 to 27 % of the source's time in previews of living-room, classroom and walking-man."""

MIN_TELLING_SHARE = 0.2
"""Share of a run that must be done before its pace tells how long the rest takes: more than what comes before the
source's own samples. A first look tells little, as most of it is the scene's sync."""

MIN_TELLING_FRACTION = 0.05
"""Fraction of a stage between two counts of its samples from which on they tell how long the stage takes. What comes
before the first count, such as the scene's sync, would tell far too much: in a small picture it takes longer than all
samples."""

MIN_FRACTION_ALONE = 0.2
"""Fraction of a stage from which on a first count of its samples tells so too, since what comes before is then a part
of it that matters little."""

RENDERS: Mapping[str, int] = {Stage.COMPARE: 3}
"""Renders of a stage that has several, each of which counts its own samples: multiview's two eyes, and one again."""

MAX_SHOWN_FRACTION = 0.97
"""A stage that takes longer than expected is nearly over, and stays so."""


def with_look(stages: Mapping[str, float]) -> dict[str, float]:
    """Return the usual shares of a pair's stages, for one that begins with a first look."""
    return {**stages, Stage.LOOK: LOOK_SHARE, Stage.SOURCE: stages[Stage.SOURCE] - LOOK_SHARE}


class Progress:
    """An estimate of how much of a run is done and how long it still takes. Report stages to it by `begin` and the part
    of a stage that is done by `advance`; then ask `fraction` and `remaining`.

    `now` is the time in seconds on any clock, the same clock in all calls. stages has the expected time of each stage,
    in order: seconds with in_seconds, else shares of the whole. A run of several `frames` goes through the stages that
    many times. A stage that is not among them counts as taking no time.
    """

    def __init__(self, now: float, stages: Mapping[str, float], *, in_seconds: bool = False, frames: int = 1) -> None:
        self._expected = dict(stages)
        self._pace = 1.0 if in_seconds else None
        self._tells = in_seconds
        """True where the pace tells how long the rest takes."""
        self._frames = max(frames, 1)
        self._started = self._since = now
        self._stage = next(iter(self._expected))
        self._stage_fraction: float | None = None
        self._render_fraction = 0.0
        """Fraction that was reported last of the present render of the current stage."""
        self._renders_done = 0
        """Renders of the current stage before that one."""
        self._advanced = now
        self._first: tuple[float, float] | None = None
        """First fraction of the current stage that was reported, with its time."""
        self._stage_pace: float | None = None
        """Seconds that all samples of the current stage take; None where its counts do not tell."""
        self._shown = 0.0
        self._frame = 0

    def begin(self, stage: str, now: float, _detail: str = "") -> None:
        """Report that a stage has begun. A stage that is earlier in the order than the current one begins the next
        frame."""
        if stage == self._stage:
            return
        order = self._expected
        names = list(order)
        if stage in order and self._stage in order and names.index(stage) < names.index(self._stage):
            self._frame = min(self._frame + 1, self._frames - 1)
        if stage in order and self._expected.get(self._stage, 0.0) == 0.0 and not self._done_before():
            # What a stage takes that counts nothing tells nothing of the others.
            self._started += now - self._since
        self._stage, self._since, self._stage_fraction = stage, now, None
        self._render_fraction, self._renders_done = 0.0, 0
        self._first = self._stage_pace = None
        done = self._done_before()
        if done > 0.0:
            self._pace = (now - self._started) / done
            self._tells = self._tells or done >= MIN_TELLING_SHARE * sum(order.values())

    def advance(self, fraction: float | None, now: float) -> None:
        """Report how much of the current stage is done, from 0 to 1; None where that is not known. Where it is less
        than before, the stage has begun another render."""
        if fraction is not None:
            fraction = self._of_renders(fraction)
        self._stage_fraction, self._advanced = fraction, now
        expected = self._expected.get(self._stage, 0.0)
        if fraction is None or expected == 0.0:
            return
        if self._first is None:
            self._first = fraction, now
        first, then = self._first
        if fraction - first > MIN_TELLING_FRACTION:
            self._stage_pace = (now - then) / (fraction - first)
        elif fraction >= MIN_FRACTION_ALONE and self._stage_pace is None:
            self._stage_pace = (now - self._since) / fraction
        if self._stage_pace is not None:
            # As it will be when the stage is over, with what came before its samples.
            done, seconds = self._done_before() + expected, now - self._started + (1.0 - fraction) * self._stage_pace
            self._pace = seconds / done
            self._tells = self._tells or done >= MIN_TELLING_SHARE * sum(self._expected.values())

    def _of_renders(self, fraction: float) -> float:
        """Return how much of the current stage is done, from 0 to 1, when this fraction of its present render is."""
        if 0.0 < fraction < self._render_fraction:
            self._renders_done += 1
        # At the end of a render Cycles says once that it has no samples.
        self._render_fraction = fraction or self._render_fraction
        count = max(RENDERS.get(self._stage, 1), self._renders_done + 1)
        return (self._renders_done + self._render_fraction) / count

    def fraction(self, now: float) -> float:
        """Return the fraction of the run that is done, from 0 to 1, and never less than before."""
        whole = self._frames * sum(self._expected.values())
        self._shown = max(self._shown, min((self._done_before() + self._done_of_stage(now)) / whole, 1.0))
        return self._shown

    def remaining(self, now: float) -> float | None:
        """Return the seconds that the run still takes by estimate; None as long as they cannot be estimated."""
        if self._pace is None or not self._tells:
            return None
        whole, expected = self._frames * sum(self._expected.values()), self._expected.get(self._stage, 0.0)
        if self._stage_pace is None or expected == 0.0:
            return max(self._pace * (whole - self._done_before() - self._done_of_stage(now)), 0.0)
        own = self._stage_pace * (1.0 - self._done_of_stage(now) / expected)
        return own + max(self._pace * (whole - self._done_before() - expected), 0.0)

    def _done_before(self) -> float:
        """Return the expected time of all frames and stages before the current one, in the unit of the expected
        times."""
        stages = list(self._expected)
        before = stages[: stages.index(self._stage)] if self._stage in stages else stages
        return self._frame * sum(self._expected.values()) + sum(self._expected[name] for name in before)

    def _done_of_stage(self, now: float) -> float:
        """Return how much of the current stage's expected time is done: the reported fraction and the time since that,
        or the time since the stage began; by the time alone never all of it."""
        expected = self._expected.get(self._stage, 0.0)
        known, since = (0.0, self._since) if self._stage_fraction is None else (self._stage_fraction, self._advanced)
        seconds = self._seconds_of_stage()
        if seconds is None or expected == 0.0:
            # What comes before the first render goes at a pace of its own.
            return expected * min(known, 1.0)
        by_time = known + (now - since) / seconds if seconds > 0.0 else known
        return expected * min(max(known, min(by_time, MAX_SHOWN_FRACTION)), 1.0)

    def _seconds_of_stage(self) -> float | None:
        """Return the seconds that the current stage takes, as far as the bar is moved by the clock between two reports;
        None before anything is known of them."""
        if self._stage_pace is not None:
            return self._stage_pace
        if self._stage_fraction:
            return (self._advanced - self._since) / self._stage_fraction
        return self._pace * self._expected.get(self._stage, 0.0) if self._pace is not None and self._tells else None


def left_words(seconds: float) -> str:
    """Return the seconds that remain as words, the last minute alone in seconds: "42 s left", "3 min left", "1 h 5 min
    left"."""
    if round(seconds) < 60:
        return Words("{time} left", time=f"{max(round(seconds), 1)} s")
    hours, minutes = divmod(round(seconds / 60.0), 60)
    time = " ".join([*([f"{hours} h"] if hours else []), *([f"{minutes} min"] if minutes else [])])
    return Words("{time} left", time=time)


def clock(seconds: float) -> str:
    """Return seconds as a text of minutes and seconds, with hours where there are any: 0:42, 3:05, 1:02:30."""
    whole = round(seconds)
    hours, minutes = whole // 3600, whole // 60 % 60
    return f"{hours}:{minutes:02}:{whole % 60:02}" if hours else f"{minutes}:{whole % 60:02}"
