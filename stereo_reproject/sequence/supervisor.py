"""An animation's run, supervised: Blender is started again where it ends on one of the frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from ..jobs.interrupts import Interrupts, RunInterruptedError
from ..jobs.supervisor import FRAME, HANDED_OVER, Event, Job, WorkerCrashedError, frame_of, run_worker
from ..jobs.warn_once import WarnOnce
from ..jobs.worker_process import Worker
from ..words import Words
from .frames import MAX_FAILURES_IN_A_ROW
from .journal_folder import journal_path
from .output_errors import KEPT
from .runs import LiveRuns


def run_animation(
    job: Job,
    on_event: Callable[[Event], None],
    *,
    on_tick: Callable[[], None] = lambda: None,
    interrupts: Interrupts | None = None,
    command: Sequence[str] | None = None,
    waiting: Worker | None = None,
) -> dict[str, Any]:
    """Have an animation rendered by a worker process, as `run_worker` does, and start another worker for the remaining
    frames when Blender crashes on one of them. Return the report.

    The frame on which it crashed is left out, with a warning. After MAX_FAILURES_IN_A_ROW crashes without a finished
    frame between them the last one's error is raised. on_event gets each warning only once, however many workers find
    it. The arguments and the other errors are those of `run_worker`.
    """
    animation = job.animation
    assert animation is not None
    starts = _Starts(on_event)
    while True:
        starts.stage = {}
        first, waiting = waiting, None
        try:
            return run_worker(
                replace(job, animation=animation),
                starts.report,
                on_tick=on_tick,
                interrupts=interrupts,
                command=command,
                waiting=first,
            )
        except RunInterruptedError as error:
            raise RunInterruptedError(error.signum, KEPT) from None
        except WorkerCrashedError as error:
            starts.crashes_in_a_row += 1
            frame = frame_of(str(starts.stage.get("detail")))
            if frame is None or starts.crashes_in_a_row >= MAX_FAILURES_IN_A_ROW:
                raise
            # What is there by now, the frame before this one among it, is the run's own, and was not reported yet.
            existing = "resume" if animation.existing == "refuse" else animation.existing
            animation = replace(animation, finished=tuple(starts.finished), existing=existing, goes_on=True)
            if starts.stage["stage"] == HANDED_OVER:
                on_event(
                    {"event": "warning", "message": Words("Blender is started again: {reason}", reason=str(error))}
                )
                continue
            animation = replace(animation, skip={**animation.skip, frame: str(error)})
            warning = Words("{frame} is left out: {reason}", frame=f"{FRAME}{frame}", reason=str(error))
            on_event({"event": "warning", "message": warning})
        finally:
            if job.output is not None:
                # Whoever is killed before it has a heartbeat leaves its files in the journal.
                LiveRuns(journal_path(job.output)).clear(own="")


class _Starts:
    """The events of one animation over all its workers: passed on to on_event, each warning once, and remembered where
    they matter for the next worker."""

    def __init__(self, on_event: Callable[[Event], None]) -> None:
        self._on_event = on_event
        self._warn = WarnOnce(lambda text: on_event({"event": "warning", "message": text}))
        self.finished: list[int] = []
        """Frames that were finished, in order."""
        self.stage: Event = {}
        """The last event of a stage since Blender was started."""
        self.crashes_in_a_row = 0

    def report(self, event: Event) -> None:
        """Pass on an event of a worker, and remember finished frames and the current stage."""
        if event["event"] == "warning":
            self._warn(str(event.get("message")))
            return
        if event["event"] == "frame":
            self.finished.append(event["frame"])
            self.crashes_in_a_row = 0
        elif event["event"] == "stage":
            self.stage = event
        self._on_event(event)
