"""An animation's run, supervised: Blender is started again where it ends on one of the frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from ..jobs.interrupts import Interrupts, RunInterruptedError
from ..jobs.supervisor import FRAME, HANDED_OVER, Event, Job, WorkerCrashedError, run_worker
from .frames import FAILURES_IN_A_ROW
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
    done: list[int] = []
    tell = _each_warning_once(on_event)
    stage: Event = {}
    crashes = 0

    def watch(event: Event) -> None:
        nonlocal stage, crashes
        if event["event"] == "frame":
            done.append(event["frame"])
            crashes = 0
        elif event["event"] == "stage":
            stage = event
        tell(event)

    while True:
        stage = {}
        try:
            return run_worker(
                replace(job, animation=animation), watch, on_tick=on_tick, interrupts=interrupts, command=command
            )
        except RunInterruptedError as error:
            raise RunInterruptedError(error.signum, KEPT) from None
        except WorkerCrashedError as error:
            crashes += 1
            frame = str(stage.get("detail"))
            if not frame.startswith(FRAME) or crashes >= FAILURES_IN_A_ROW:
                raise
            # What is there by now, the frame before this one among it, is the run's own: nobody was told of that yet.
            existing = "resume" if animation.existing == "refuse" else animation.existing
            animation = replace(animation, finished=tuple(done), existing=existing, goes_on=True)
            if stage["stage"] == HANDED_OVER:
                on_event({"event": "warning", "message": f"Blender is started again: {error}"})
                continue
            animation = replace(animation, skip={**animation.skip, int(frame.removeprefix(FRAME)): str(error)})
            on_event({"event": "warning", "message": f"{frame} is left out: {error}"})
        finally:
            if job.output is not None:
                # Whoever is killed before it has a heartbeat leaves its files in the journal.
                LiveRuns(job.output / JOURNAL).clear(own="")


def _each_warning_once(on_event: Callable[[Event], None]) -> Callable[[Event], None]:
    """Pass events on, but for warnings that were passed on before."""
    said: set[str] = set()

    def tell(event: Event) -> None:
        message = str(event.get("message"))
        if event["event"] != "warning" or message not in said:
            on_event(event)
        if event["event"] == "warning":
            said.add(message)

    return tell
