"""The way of an animation: the plan of the frames that are to be rendered, and then one after the other, each of them
once.

What renders a frame and writes its files is handed in (`blender.commands.animation` has the one that ships), so that
this can be read, and killed at any moment in a test, without Blender.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from ..errors import BadInputError, OtherRunError, OutputError, StereoReprojectError
from ..files import flush, flush_folder, leads_elsewhere, put_in_place
from ..settings.animation import spelled
from ..words import Words
from .checksums import checksum
from .fingerprints import Fingerprints, FrameState
from .frame_record import Record
from .journal import Journal
from .listing import Listing
from .other_runs import check_same
from .output_errors import failed_output

POLL_SECONDS = 1.0
"""Time between two looks at frames that another run has."""

MAX_FAILURES_IN_A_ROW = 3
"""Number of frames that cannot be rendered, one after the other, at which a run gives up."""


@dataclass(frozen=True)
class FramePlan:
    """The plan of a run: `todo` are the frames that it renders and `kept` those that stay as they are, each with its
    state on the drive.

    replaced are the records that existed when the plan was made, by frame: a record that differs from these later is
    new, from another run that was quicker. With "overwrite", records of live runs that render the same are left out of
    `replaced`, so that they count as new.
    """

    todo: Mapping[int, FrameState]
    kept: Mapping[int, FrameState]
    replaced: Mapping[int, Record]

    def is_new(self, record: Record) -> bool:
        """Return True if this record was written by another run after the plan was made."""
        return record != self.replaced.get(record.frame)


@dataclass(frozen=True)
class FrameListener:
    """Functions that are called as an animation goes on. `done` gets each finished frame with its record; `failed` gets
    each frame that could not be rendered, with the reason; `waits` gets the frames of other runs that this run waits
    for, when it has nothing else to do."""

    done: Callable[[int, Record], None] = lambda _frame, _record: None
    failed: Callable[[int, str], None] = lambda _frame, _why: None
    waits: Callable[[Sequence[int]], None] = lambda _frames: None


class FrameMaker(Protocol):
    """The protocol of whatever renders frames and has their files written and recorded, which may go on while the next
    frame is rendered."""

    def render(self, frame: int, claim: int) -> None:
        """Render a frame and hand it over to be written; claim is the number of this run's claim of it. Raises
        StereoReprojectError if it cannot be rendered."""
        ...

    def finished(self, *, wait: bool) -> list[tuple[int, Record | StereoReprojectError | None]]:
        """Return the frames whose writing has ended since the last call, each with its record, or with the error, or
        with None where another run has claimed it meanwhile and it was not written.

        With `wait`, first wait until all frames that were handed over are written.
        """
        ...


def plan_frames(
    journal: Journal,
    files: Mapping[int, Sequence[Path]],
    wanted: Fingerprints,
    existing: str,
    *,
    on_look: Callable[[int], None] = lambda _: None,
) -> FramePlan:
    """Return the plan for frames of an animation: which are rendered, and which stay.

    files has the paths of each frame's files, and wanted the fingerprints of what is asked for. existing is one of
    `settings.animation.EXISTING`. on_look is called after each frame whose files were read and checked, which takes a
    while. Raises BadInputError where existing frames must not be touched, and OSError.
    """
    _check_folders(journal, files)
    # Of many frames few are there as a rule, and only those are looked at.
    known, there = journal.known_frames(), Listing()
    # Read first: a frame that another run finishes while its state is looked at replaces what was there before.
    replaced = {record.frame: record for record in journal.records.read_all(frame for frame in files if frame in known)}
    states = dict.fromkeys(files, FrameState.MISSING)
    if existing == "overwrite":
        replaced = {
            frame: record
            for frame, record in replaced.items()
            if wanted.state_of(record) is not FrameState.WHOLE or not journal.runs.lives(record.run)
        }
    else:
        for frame, paths in files.items():
            if frame in known or any(map(there.may_hold, paths)):
                states[frame] = journal.state(frame, paths, wanted)
                on_look(frame)
    kept = {frame: state for frame, state in states.items() if _is_kept(state, existing, files[frame])}
    if existing == "refuse":
        _check_shared(journal, states, replaced)
    if existing == "resume":
        _check_scene(journal, states, wanted)
    todo = {frame: state for frame, state in states.items() if frame not in kept}
    return FramePlan(todo, kept, replaced)


def _check_folders(journal: Journal, files: Mapping[int, Sequence[Path]]) -> None:
    """Raise BadInputError if one of the folders for the files, other than the frames' folder itself, is a link to
    another place."""
    for folder in dict.fromkeys(path.parent for paths in files.values() for path in paths):
        if folder != journal.frames_folder and leads_elsewhere(folder):
            raise BadInputError(
                Words("{folder} is a link to another folder: remove it, or name another for the frames", folder=folder)
            )


def _is_kept(state: FrameState, existing: str, files: Sequence[Path]) -> bool:
    """Return True if a frame in this state is not to be rendered again. With "keep", it is enough that all its files
    exist and are not empty, as in Blender without Overwrite."""
    if existing == "keep" and state not in (FrameState.MISSING, FrameState.DAMAGED):
        # As Blender does it without Overwrite, whoever has rendered them: all that counts is that they are there.
        return all(path.exists() and path.stat().st_size for path in files)
    return state is FrameState.WHOLE


def _check_shared(journal: Journal, states: Mapping[int, FrameState], known: Mapping[int, Record]) -> None:
    """Raise BadInputError if any frames exist already, unless all of these are whole and come from live runs, which
    have just begun on the same animation. states are the frames' states, and known the records that the plan has read,
    both by frame."""
    there = [frame for frame, state in states.items() if state is not FrameState.MISSING or frame in known]
    records = {record.frame: record for record in journal.records.read_all(there)}
    tokens = {records[frame].run if frame in records else "" for frame in there}
    if all(states[frame] is FrameState.WHOLE for frame in there) and all(map(journal.runs.lives, tokens)):
        return
    raise BadInputError(
        Words(
            "{folder}: {count} of {all} frames are there already ({frames}): --resume keeps what is whole and renders"
            " the rest, --overwrite renders all anew",
            folder=journal.frames_folder,
            count=len(there),
            all=len(states),
            frames=spelled(there),
        )
    )


def _check_scene(journal: Journal, states: Mapping[int, FrameState], wanted: Fingerprints) -> None:
    """Raise BadInputError if an existing frame was rendered of another scene; the message names what has changed."""
    others = [frame for frame, state in states.items() if state is FrameState.OTHER_SCENE]
    if others:
        record = journal.records.read(others[0])
        kinds = ", ".join(wanted.changed(record)) if record else "unknown"
        raise BadInputError(
            Words(
                "{folder}: the scene has changed since frame {frame} was rendered ({kinds}): --overwrite renders all"
                " anew, another folder keeps both",
                folder=journal.frames_folder,
                frame=others[0],
                kinds=kinds,
            )
        )


def render_frames(
    plan: FramePlan,
    journal: Journal,
    wanted: Fingerprints,
    token: str,
    maker: FrameMaker,
    listener: FrameListener,
) -> None:
    """Render the frames in plan.todo, each by one run alone. Returns when all of them are rendered, by this run or
    another, or have failed.

    A frame that another run has claimed is left to it, and looked at again at the end. token is this run's. A frame
    that cannot be rendered is passed over; after MAX_FAILURES_IN_A_ROW such frames the last one's error is raised.
    OutputError is raised at once, as is BadInputError if no frame has succeeded yet.
    """
    work = _Work(plan, journal, wanted, token, maker, listener)
    left = set(plan.todo)
    while left:
        mine = {frame for frame in sorted(left) if work.do(frame)}
        left -= mine
        left |= work.collect(wait=not left or not mine)
        if left and not mine:
            listener.waits(sorted(left))
            time.sleep(POLL_SECONDS)


@dataclass
class _Work:
    """The state of `render_frames` while it goes on: its arguments, this run's claims by frame, and the frames that
    other runs have taken over."""

    plan: FramePlan
    journal: Journal
    wanted: Fingerprints
    token: str
    maker: FrameMaker
    listener: FrameListener
    _failed_in_a_row: int = 0
    _rendered: int = 0
    _done: int = 0
    _claims: dict[int, int] = field(default_factory=dict)
    _taken_over: set[int] = field(default_factory=set)

    def do(self, frame: int) -> bool:
        """Render a frame and hand it over to be written. Return False, with nothing done, where another live run has
        claimed it; else True, also if another run has finished it meanwhile or if it failed. Raises the errors of
        `render_frames`."""
        try:
            claim = self.journal.claims.take(frame, self.token)
            if claim is None:
                return False
            record = self.journal.records.read(frame)
            if record is not None and self.plan.is_new(record):
                self.journal.claims.release(frame, claim, self.token)
                self._check_same(record)
                self.listener.done(frame, record)
                return True
        except OSError as error:
            raise failed_output(self.journal.frames_folder, error) from error
        self._claims[frame] = claim
        try:
            self.maker.render(frame, claim)
            self._rendered += 1
        except StereoReprojectError as error:
            self._fail(frame, error, hopeless=isinstance(error, BadInputError) and not self._rendered)
        self._look(wait=False)
        return True

    def _check_same(self, record: Record) -> None:
        """Raise OtherRunError if a frame of another run is of another scene or other settings; frames that this run has
        rendered are written first."""
        try:
            check_same(self.journal, record, self.wanted)
        except OtherRunError:
            # What is rendered by now is to be kept.
            self._look(wait=True)
            raise

    def collect(self, *, wait: bool) -> set[int]:
        """Report the frames that are written by now; with `wait`, wait for all. Return those that another run has taken
        over, to be looked at again later."""
        self._look(wait=wait)
        taken, self._taken_over = self._taken_over, set()
        return taken

    def _look(self, *, wait: bool) -> None:
        """Take the results of written frames from the maker (with `wait`, of all) and report them to the listener."""
        for frame, result in self.maker.finished(wait=wait):
            if result is None:
                self._taken_over.add(frame)
            elif isinstance(result, StereoReprojectError):
                self._fail(frame, result, hopeless=isinstance(result, BadInputError) and not self._done)
            else:
                self._failed_in_a_row = 0
                self._done += 1
                self.listener.done(frame, result)

    def _fail(self, frame: int, error: StereoReprojectError, *, hopeless: bool) -> None:
        """Release the claim of a frame that failed and report it to the listener. Raise the error instead where the run
        has to end: if it is `hopeless` to go on, if it is an OutputError, or after MAX_FAILURES_IN_A_ROW failures."""
        with contextlib.suppress(OSError):
            self.journal.claims.release(frame, self._claims[frame], self.token)
        self._failed_in_a_row += 1
        if isinstance(error, OutputError) or hopeless or self._failed_in_a_row >= MAX_FAILURES_IN_A_ROW:
            raise error
        self.listener.failed(frame, str(error))


def publish_frame(journal: Journal, made: Mapping[str, Path], record: Mapping[str, Any], claim: int) -> Record | None:
    """Move a frame's finished files into the frames' folder, write its record, and return it; None, with nothing moved,
    where another run has claimed the frame meanwhile.

    made has the path of each file, on the same drive, by its path in the frames' folder; each appears there whole.
    record has the fields of a `Record` but for its files. claim is the number of this run's claim, which is released.
    Raises OutputError.
    """
    try:
        sums = {}
        for name, path in made.items():
            flush(path)
            sums[name] = checksum(path)
        finished = Record(**record, files=sums)
        if not journal.claims.holds(finished.frame, claim, finished.run):
            return None
        journal.records.remove(finished.frame)
        for name, path in made.items():
            place = journal.frames_folder / name
            place.parent.mkdir(exist_ok=True)
            put_in_place(path, place)
        for folder in dict.fromkeys((journal.frames_folder / name).parent for name in made):
            flush_folder(folder)
        journal.records.write(finished)
        journal.claims.release(finished.frame, claim, finished.run)
    except OSError as error:
        raise failed_output(journal.frames_folder, error) from error
    return finished
