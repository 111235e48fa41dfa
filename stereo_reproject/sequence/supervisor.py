"""An animation's run, supervised: Blender is started again where it ends on one of the frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from ..jobs.interrupts import Interrupts, RunInterruptedError
from ..jobs.supervisor import FRAME, HANDED_OVER, Event, Job, WorkerCrashedError, run_worker
from ..jobs.warn_once import WarnOnce
from .frames import MAX_FAILURES_IN_A_ROW
from .journal_folder import JOURNAL
from .output_errors import KEPT
from .runs import LiveRuns


def run_animation(
    job: Job,
    on_event: Callable[[Event], None],
    *,
    on_tick: Callable[[], None] = lambda: None,
    interrupts: Interrupts | None = None,
    command: Sequence[str] | None = None,
) -> dict[str, Any]:
    """`run_worker` for an animation, which goes on with the other frames when Blender ends on one of them.

    It does so until several have ended one after the other without a frame that was finished in between. on_event gets
    a warning once, however often Blender is started and finds it again.
    """
    animation = job.animation
    assert animation is not None
    starts = _Starts(on_event)
    while True:
        starts.stage = {}
        try:
            return run_worker(
                replace(job, animation=animation),
                starts.report,
                on_tick=on_tick,
                interrupts=interrupts,
                command=command,
            )
        except RunInterruptedError as error:
            raise RunInterruptedError(error.signum, KEPT) from None
        except WorkerCrashedError as error:
            starts.crashes_in_a_row += 1
            frame = str(starts.stage.get("detail"))
            if not frame.startswith(FRAME) or starts.crashes_in_a_row >= MAX_FAILURES_IN_A_ROW:
                raise
            # What is there by now, the frame before this one among it, is the run's own, and was not reported yet.
            existing = "resume" if animation.existing == "refuse" else animation.existing
            animation = replace(animation, finished=tuple(starts.finished), existing=existing, goes_on=True)
            if starts.stage["stage"] == HANDED_OVER:
                on_event({"event": "warning", "message": f"Blender is started again: {error}"})
                continue
            animation = replace(animation, skip={**animation.skip, int(frame.removeprefix(FRAME)): str(error)})
            on_event({"event": "warning", "message": f"{frame} is left out: {error}"})
        finally:
            if job.output is not None:
                # Whoever is killed before it has a heartbeat leaves its files in the journal.
                LiveRuns(job.output / JOURNAL).clear(own="")


class _Starts:
    """Events of one run over all starts of Blender: passed on, each warning once, and remembered where they matter."""

    def __init__(self, on_event: Callable[[Event], None]) -> None:
        self._on_event = on_event
        self._warn = WarnOnce(lambda text: on_event({"event": "warning", "message": text}))
        self.finished: list[int] = []
        """Frames that were finished, in order."""
        self.stage: Event = {}
        """The last event of a stage since Blender was started."""
        self.crashes_in_a_row = 0

    def report(self, event: Event) -> None:
        """Pass an event of the worker on."""
        if event["event"] == "warning":
            self._warn(str(event.get("message")))
            return
        if event["event"] == "frame":
            self.finished.append(event["frame"])
            self.crashes_in_a_row = 0
        elif event["event"] == "stage":
            self.stage = event
        self._on_event(event)
