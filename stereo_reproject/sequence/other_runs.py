"""Runs of other settings or of another scene in the same folder: which of them gives way, so that nothing is mixed.

A run announces its frames and fingerprints in its file, and then looks at the announcements of the others. Where two
would render the same frame differently, both may find each other. Then the one with the greater token gives way at
once; the one with the smaller token waits until the other has gone, or has settled and renders. A settled run stays.
One that does neither for long (it was stopped, and only its number goes on) counts as settled.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from ..errors import BadInputError, OtherRunError
from ..settings.animation import read_frames, spelled
from ..words import Words
from .fingerprints import Fingerprints, FrameState
from .frame_record import Record
from .journal import Journal
from .journal_folder import UNREADABLE_ERRORS

POLL_SECONDS = 1.0
"""Time between two looks at another run that has yet to show that it lives, or to settle."""

ANNOUNCED_CHARACTERS = 1000
"""Greatest length of the frames in an announcement; of those that take more, only the first and the last are named."""


@dataclass(frozen=True)
class LiveRun:
    """Another run that may be at work: its token, and the frames and fingerprints that it has announced. settled is
    True once it has found no other run in its way; then it renders or is about to."""

    token: str
    frames: frozenset[int]
    wanted: Fingerprints
    settled: bool


def announcement(journal: Journal, frames: Collection[int], wanted: Fingerprints) -> dict[str, Any]:
    """Return the facts that a run announces in its file before its first frame, for `runs.run_at_work`. A list of
    frames that is too long is shortened to its first and last frame."""
    text = spelled(frames)
    if len(text) > ANNOUNCED_CHARACTERS:
        text = f"{min(frames)}-{max(frames)}"
    return {"of": journal.name, "frames": text, **asdict(wanted), "settled": 0}


def other_runs(journal: Journal, own: str) -> list[LiveRun]:
    """Return the other runs that may be at work on frames of this name; own is the token of this run. Those whose files
    cannot be read are left out. Raises OSError."""
    found = []
    for token, facts in journal.runs.announced(but=own).items():
        with contextlib.suppress(BadInputError, *UNREADABLE_ERRORS):
            wanted = Fingerprints(str(facts["settings"]), dict(facts["scene"]))
            if facts["of"] == journal.name:
                # Runs of earlier versions never wait, and do not say that they have settled.
                settled = facts.get("settled", 1) != 0
                found.append(LiveRun(token, frozenset(read_frames(facts["frames"])), wanted, settled))
    return found


def settle(
    journal: Journal,
    frames: Collection[int],
    wanted: Fingerprints,
    token: str,
    waits: Callable[[Sequence[int]], None] = lambda _frames: None,
) -> None:
    """Wait until no other run renders some of these frames differently; then mark this run as settled.

    It must have announced itself and must not yet have looked which frames exist: then at least one of two runs sees
    the other. waits is called with the frames in question before each wait. Raises OtherRunError where this run has to
    give way, and OSError.
    """
    runs = journal.runs
    begun = runs.clock()
    while rivals := _rivals(journal, frames, wanted, token):
        waited_long = runs.clock() - begun >= runs.stale_seconds
        for rival in rivals:
            at_work = runs.is_at_work(rival.token)
            common = sorted(rival.frames.intersection(frames))
            if at_work and (rival.settled or rival.token < token or waited_long):
                raise _mixed(
                    journal,
                    Words("another run renders frames {frames} there", frames=spelled(common)),
                    wanted,
                    rival.wanted,
                )
            waits(common)
        time.sleep(POLL_SECONDS)
    runs.mark_settled(token)


def _rivals(journal: Journal, frames: Collection[int], wanted: Fingerprints, own: str) -> list[LiveRun]:
    """Return the other runs that may be at work and would render some of these frames of another scene or by other
    settings. own is the token of this run."""
    return [
        run
        for run in other_runs(journal, own)
        if not run.frames.isdisjoint(frames) and wanted.state_of(run.wanted) is not FrameState.WHOLE
    ]


def check_frames_stayed(journal: Journal, frames: Iterable[int], wanted: Fingerprints) -> None:
    """Raise OtherRunError if another run has replaced one of these finished frames by one of another scene or other
    settings."""
    for record in journal.records.read_all(frames):
        check_same(journal, record, wanted)


def check_same(journal: Journal, record: Record, wanted: Fingerprints) -> None:
    """Raise OtherRunError if a record, written by another run, is of another scene or other settings than wanted."""
    if wanted.state_of(record) is not FrameState.WHOLE:
        what = Words("another run has rendered frame {frame} meanwhile", frame=record.frame)
        raise _mixed(journal, what, wanted, record)


def _mixed(journal: Journal, what: Words, wanted: Fingerprints, theirs: Record | Fingerprints) -> OtherRunError:
    """Return the error for frames that would be rendered differently by two runs. `what` says in words what the other
    run does; theirs are its record or fingerprints, which differ from those wanted."""
    kinds = ", ".join(wanted.changed(theirs))
    differs = Words(wanted.state_of(theirs).value)
    if kinds:
        differs = Words("{differs} ({kinds})", differs=differs, kinds=kinds)
    return OtherRunError(
        Words(
            "{folder}: {what}, {differs}: another folder keeps both; finished frames are kept",
            folder=journal.frames_folder,
            what=what,
            differs=differs,
        )
    )
