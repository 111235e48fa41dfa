"""Words about a run: how far it is, which stage it is in, and what stays of it after a cancel."""

from __future__ import annotations

from dataclasses import dataclass

from ..stereo_reproject.jobs.progress import left_words
from ..stereo_reproject.jobs.supervisor import VIEW, frame_of
from ..stereo_reproject.pipeline.stages import words_of
from ..stereo_reproject.report.verdict import saved_words
from ..stereo_reproject.words import Words
from .run import BackgroundJob

GOES_ON = "Render Animation goes on with the others"
GOES_ON_WITHOUT_OVERWRITE = "To go on with the others, switch off Overwrite in Output first"
"""Ways to go on after a cancelled animation, by its Overwrite."""


ESCAPE = "Esc: Cancel"
"""Key that ends a run, and what it does."""


@dataclass(frozen=True)
class RunProgress:
    """Progress of a run at a moment: how far it is, from 0 to 1 and in words, what it does, and the time that an
    animation's frames have saved, "" before the first of them.
    """

    fraction: float
    far: str
    stage: str
    saved: str


def run_progress(run: BackgroundJob) -> RunProgress:
    """Return the progress of a run now."""
    return RunProgress(*progress_of(run), stage_alone(run), saved_so_far(run))


def progress_of(run: BackgroundJob) -> tuple[float, str]:
    """Return how far a run is: as a number from 0 to 1, and as a short text with the frame of an animation or the view
    of many, the share and the time that is left; once it was asked to end, that it does so.
    """
    fraction, remaining = run.far()
    if run.is_ending:
        return fraction, Words("Ending")
    words, frame = Words("{share} %", share=f"{100.0 * fraction:.0f}"), frame_words(run)
    if remaining is not None:
        words = Words("{share}, {left}", share=words, left=left_words(remaining))
    return fraction, Words("{frame}  {far}", frame=frame, far=words) if frame else words


def frame_words(run: BackgroundJob) -> str:
    """Return which frame of an animation is rendered and which of all it is, as "Frame 12 (3 of 48)", or which of many
    views, as "View 12 of 48"; "" where neither is rendered.
    """
    view = VIEW.fullmatch(run.detail)
    if view is not None:
        return Words("View {number} of {count}", number=int(view[1]), count=int(view[2]))
    frame = frame_of(run.detail)
    if run.animation is None or frame is None:
        return ""
    frames = run.animation.frames
    return Words("Frame {frame} ({place} of {count})", frame=frame, place=frames.index(frame) + 1, count=len(frames))


def stage_and_saved(progress: RunProgress) -> str:
    """Return in words what a run is doing, of an animation with the time saved so far, from its progress."""
    return Words("{stage}, {saved}", stage=progress.stage, saved=progress.saved) if progress.saved else progress.stage


def ways_to_say(progress: RunProgress) -> list[list[str]]:
    """Return the progress of a run, and how to end it, in ways to say it in lines, the widest first. The first has a
    single line, as the status bar does.
    """
    doing = Words("{far}.  {stage}", far=progress.far, stage=stage_and_saved(progress))
    below = [with_escape(stage_and_saved(progress)), with_escape(progress.stage), Words(ESCAPE)]
    return [[with_escape(doing)], *([progress.far, line] for line in below)]


def with_escape(text: str) -> str:
    """Return a text about a run with the key that ends it."""
    return Words("{text}   |   {escape}", text=text, escape=Words(ESCAPE))


def stage_alone(run: BackgroundJob) -> str:
    """Return in words what a run is doing."""
    words = Words(run.stage_words.get(run.stage) or words_of(run.stage))
    if run.detail and not frame_words(run):
        return Words("{stage}, {detail}", stage=words, detail=run.detail)
    return words


def saved_so_far(run: BackgroundJob) -> str:
    """Return in words the time that an animation's frames have saved, and how many of them, those alone that this run
    has finished; "" before the first of them, and of others.
    """
    count = len(run.savings)
    if count == 0:
        return ""
    message = "{saved} so far by 1 frame" if count == 1 else "{saved} so far by {count} frames"
    return Words(message, saved=saved_words(sum(run.savings)), count=count)


def cancelled_words(run: BackgroundJob) -> str:
    """Return a line that says what stays of a run that was cancelled, and what was there before it."""
    if run.animation is None:
        return Words("Cancelled: nothing was changed")
    finished, there = run.frames_finished, run.animation.there_already()
    message = {0: "Cancelled: no frame was finished", 1: "Cancelled: 1 frame is finished and stays"}
    words = Words(message.get(finished, "Cancelled: {count} frames are finished and stay"), count=finished)
    if there:
        before = "{cancelled}, 1 was there already" if there == 1 else "{cancelled}, {count} were there already"
        words = Words(before, cancelled=words, count=there)
    return words


def cancelled_and_on(cancelled: str, existing: str) -> str:
    """Return the line of `cancelled_words` about an animation of which frames stay, with how to go on; existing says
    what is done with these, as in `AnimationSettings`."""
    how = GOES_ON_WITHOUT_OVERWRITE if existing == "overwrite" else GOES_ON
    return Words("{cancelled}. {how}", cancelled=cancelled, how=Words(how))
