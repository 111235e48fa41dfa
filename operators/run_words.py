"""Words about a run: how far it is, which stage it is in, and what stays of it after a cancel."""

from __future__ import annotations

from ..stereo_reproject.jobs.progress import left_words
from ..stereo_reproject.jobs.supervisor import FRAME
from ..stereo_reproject.pipeline.stages import words_of
from ..stereo_reproject.report.verdict import saved_words
from .run import BackgroundJob


def progress_of(run: BackgroundJob) -> tuple[float, str]:
    """Return how far a run is: as a number from 0 to 1, and as a short text with the frame of an animation, the share
    and the time that is left.
    """
    fraction, remaining = run.far()
    share = f"{100.0 * fraction:.0f} %"
    left = "" if remaining is None else f", {left_words(remaining)}"
    return fraction, "  ".join(filter(None, [frame_words(run), f"{share}{left}"]))


def frame_words(run: BackgroundJob) -> str:
    """Return which frame of an animation is rendered and which of all it is, as "Frame 12 (3 of 48)"; "" where no frame
    is rendered.
    """
    if run.animation is None or not run.detail.startswith(FRAME):
        return ""
    frame, frames = int(run.detail.removeprefix(FRAME)), run.animation.frames
    return f"Frame {frame} ({frames.index(frame) + 1} of {len(frames)})"


def stage_of(run: BackgroundJob) -> str:
    """Return in words what a run is doing; of an animation with the time saved so far."""
    saved = "" if run.saved is None else f"{saved_words(run.saved)} so far"
    detail = "" if frame_words(run) else run.detail
    return ", ".join(filter(None, [words_of(run.stage), detail, saved]))


def cancelled_words(run: BackgroundJob) -> str:
    """Return a line that says what stays of a run that was cancelled."""
    if run.animation is None:
        return "Cancelled: nothing was changed"
    done = run.frames_finished
    frames = {0: "no frame was finished", 1: "1 frame is finished and stays"}
    return f"Cancelled: {frames.get(done, f'{done} frames are finished and stay')}"
