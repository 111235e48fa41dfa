"""The way of an animation without Blender: which frames are rendered, each of them once, whoever else is at it."""

import errno
import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from stereo_reproject.errors import BadInputError, OutputError, StereoReprojectError
from stereo_reproject.sequence import frames as animation
from stereo_reproject.sequence import other_runs as other_runs_module
from stereo_reproject.sequence.fingerprints import Fingerprints, FrameState
from stereo_reproject.sequence.frame_record import Record
from stereo_reproject.sequence.frames import (
    FrameListener,
    FramePlan,
    plan_frames,
    publish_frame,
    render_frames,
)
from stereo_reproject.sequence.journal import Journal
from stereo_reproject.sequence.journal_folder import JOURNAL
from stereo_reproject.sequence.listing import Listing
from stereo_reproject.sequence.other_runs import announcement, check_frames_stayed, other_runs, settle
from stereo_reproject.sequence.output_errors import failed_output, is_full
from stereo_reproject.sequence.progress import AnimationProgress
from stereo_reproject.sequence.progress import Listener as ProgressListener
from stereo_reproject.sequence.runs import BEAT_DIGITS, RUN_BYTES, STALE_SECONDS, LiveRuns
from stereo_reproject.settings.animation import EXISTING, spelled
from tests.jobs.clock import Clock
from tests.programs.tokens import token_of

ROOT = Path(__file__).resolve().parents[2]

WANTED = Fingerprints("settings", {"Object": "1"})
OTHER_SETTINGS = replace(WANTED, settings="others")
OTHER_SCENE = replace(WANTED, scene={"Object": "2", "Mesh": "1"})
FRAMES = (1, 2, 3, 4)

OWN, FAR, GONE, EARLIER, ANOTHER = map(token_of, ("own", "far", "long gone", "earlier", "another"))
"""Runs: this one, one on another machine, and others."""

SPELLED_SECONDS = 3.0
"""Of this process; an algorithm that copies what is left takes ten."""

PUBLISHING = """
import sys
from pathlib import Path
from stereo_reproject.sequence.frames import publish_frame
from stereo_reproject.sequence.journal import Journal
from stereo_reproject.sequence.runs import run_at_work

folder = Path(sys.argv[1])
journal = Journal(folder)
made = folder / "made"
made.write_bytes(b"theirs")
with run_at_work(journal.runs) as token:
    claim = journal.claims.take(2, token)
    fields = {"frame": 2, "settings": "settings", "scene": {"Object": "1"}, "run": token, "figures": {}}
    publish_frame(journal, {"0002.png": made}, fields, claim)
"""


@pytest.fixture
def clock():
    return Clock(0.0)


@pytest.fixture
def journal(tmp_path, clock):
    made = Journal(tmp_path, runs=LiveRuns(tmp_path / JOURNAL, clock=clock))
    made.place.make()
    return made


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    for module in (animation, other_runs_module):
        monkeypatch.setattr(module, "POLL_SECONDS", 0.0)


class Maker:
    """Renders by writing a line, and has it written by the time that the next frame is rendered.

    fails are the errors by the frames that cannot be rendered, unwritten those of frames that cannot be written; before
    is called ahead of each frame.
    """

    def __init__(self, journal, *, token=OWN, wanted=WANTED, fails=(), unwritten=(), before=lambda _: None):
        self.journal, self.token, self.wanted = journal, token, wanted
        self.fails, self.unwritten, self.before = dict(fails), dict(unwritten), before
        self.rendered, self._pending = [], []

    def render(self, frame, claim):
        self.before(frame)
        assert self.journal.claims.holder(frame) == self.token
        self.rendered.append(frame)
        if frame in self.fails:
            raise self.fails[frame]
        self._pending.append((frame, claim))

    def finished(self, *, wait):
        ready = len(self._pending) if wait else len(self._pending) - 1
        written, self._pending = self._pending[: max(ready, 0)], self._pending[max(ready, 0) :]
        return [(frame, self._write(frame, claim)) for frame, claim in written]

    def _write(self, frame, claim):
        if frame in self.unwritten:
            return self.unwritten[frame]
        return publish(self.journal, frame, claim, token=self.token, wanted=self.wanted)


class Listener:
    """What was said, in order."""

    def __init__(self, waits=lambda _: None):
        self.events, self._waits = [], waits
        self.to = FrameListener(
            lambda frame, record: self.events.append(("done", frame, record.run)),
            lambda frame, why: self.events.append(("failed", frame, why)),
            self._on_wait,
        )

    def _on_wait(self, frames):
        self.events.append(("waits", *frames))
        self._waits(frames)

    def frames(self, kind):
        return [event[1] for event in self.events if event[0] == kind]


def publish(journal, frame, claim, *, token=OWN, wanted=WANTED):
    if not journal.claims.holds(frame, claim, token):
        (journal.folder / f"{journal.name}{frame:04d}.claim.{claim}").write_text(token, encoding="utf-8")
    made = journal.frames_folder / f"made-{frame}"
    made.write_bytes(f"frame {frame} by {token}".encode())
    fields = {"frame": frame, "settings": wanted.settings, "scene": wanted.scene, "run": token, "figures": {}}
    return publish_frame(journal, {f"{frame:04d}.png": made}, fields, claim)


def files_of(journal, frames=FRAMES):
    return {frame: [journal.frames_folder / f"{frame:04d}.png"] for frame in frames}


def plan(journal, existing="refuse", *, wanted=WANTED, frames=FRAMES):
    return plan_frames(journal, files_of(journal, frames), wanted, existing)


def render(journal, maker, *, existing="resume", told=None):
    told = told or Listener()
    elsewhere(journal, maker.token)
    render_frames(plan(journal, existing), journal, maker.wanted, maker.token, maker, told.to)
    return told


def elsewhere(journal, token, beat=0, **announced):
    """The file of a run on another machine."""
    facts = {"host": "farm-7", "machine": "another", "pid": os.getpid(), **announced}
    journal.runs.path(token).write_text(f"{json.dumps(facts)}\n{beat:0{BEAT_DIGITS}}")


def everything_in(folder):
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


# The plan


@pytest.mark.parametrize("existing", EXISTING)
def test_where_nothing_is_everything_is_rendered(journal, existing):
    planned = plan(journal, existing)
    assert planned.todo == dict.fromkeys(FRAMES, FrameState.MISSING)
    assert (planned.kept, planned.replaced) == ({}, {})


@pytest.fixture
def mixed(journal):
    """Frame 1 is whole, 2 damaged, 3 somebody's own, 4 of other settings, and 5 is missing."""
    for frame, wanted in ((1, WANTED), (2, WANTED), (4, OTHER_SETTINGS)):
        publish(journal, frame, 1, wanted=wanted)
    files_of(journal)[2][0].write_bytes(b"frame 2 by OWN")
    files_of(journal)[3][0].write_bytes(b"mine")
    return journal


ALL = (*FRAMES, 5)


def test_resume_keeps_what_is_whole_and_knows_of_the_rest(mixed):
    planned = plan(mixed, "resume", frames=ALL)
    assert planned.kept == {1: FrameState.WHOLE}
    assert planned.todo == {
        2: FrameState.DAMAGED,
        3: FrameState.UNKNOWN,
        4: FrameState.OTHER_SETTINGS,
        5: FrameState.MISSING,
    }
    assert sorted(planned.replaced) == [1, 2, 4]


def test_overwrite_keeps_nothing(mixed):
    planned = plan(mixed, "overwrite", frames=ALL)
    assert (list(planned.todo), planned.kept) == (list(ALL), {})
    assert sorted(planned.replaced) == [1, 2, 4]


def test_keep_keeps_whatever_is_there_whoever_has_rendered_it(mixed):
    planned = plan(mixed, "keep", frames=ALL)
    assert planned.kept == {1: FrameState.WHOLE, 3: FrameState.UNKNOWN, 4: FrameState.OTHER_SETTINGS}
    assert list(planned.todo) == [2, 5]


def test_keep_needs_all_files_of_a_frame(journal):
    both = [journal.frames_folder / f"0001_{view}.png" for view in "LR"]
    both[0].write_bytes(b"mine")
    assert list(plan_frames(journal, {1: both}, WANTED, "keep").todo) == [1]
    both[1].touch()
    assert list(plan_frames(journal, {1: both}, WANTED, "keep").todo) == [1]
    both[1].write_bytes(b"mine too")
    assert list(plan_frames(journal, {1: both}, WANTED, "keep").kept) == [1]


def test_refuse_says_what_is_there_and_what_to_do(mixed):
    before = everything_in(mixed.frames_folder)
    with pytest.raises(BadInputError) as refused:
        plan(mixed, "refuse", frames=ALL)
    assert "4 of 5 frames are there already (1-4): --resume" in str(refused.value)
    assert "--overwrite renders all anew" in str(refused.value)
    assert everything_in(mixed.frames_folder) == before


def test_refuse_lets_runs_that_begin_together_share_the_frames(journal):
    elsewhere(journal, FAR)
    publish(journal, 1, journal.claims.take(1, FAR), token=FAR)
    planned = plan(journal, "refuse")
    assert (planned.kept, list(planned.todo)) == ({1: FrameState.WHOLE}, [2, 3, 4])
    publish(journal, 2, 1, token=GONE)
    with pytest.raises(BadInputError, match="2 of 4 frames are there already"):
        plan(journal, "refuse")


def test_refuse_does_not_take_other_settings_for_a_run_that_began_just_now(journal):
    elsewhere(journal, FAR)
    publish(journal, 1, 1, token=FAR, wanted=OTHER_SETTINGS)
    with pytest.raises(BadInputError, match=r"1 of 4 frames are there already \(1\)"):
        plan(journal, "refuse")


def test_a_changed_scene_is_refused_with_what_has_changed(mixed):
    publish(mixed, 5, 1, wanted=OTHER_SCENE)
    with pytest.raises(BadInputError) as refused:
        plan(mixed, "resume", frames=ALL)
    assert "the scene has changed since frame 5 was rendered (Object, Mesh): --overwrite" in str(refused.value)
    assert list(plan(mixed, "overwrite", frames=ALL).todo) == list(ALL)


def test_a_changed_scene_in_a_frame_that_is_not_asked_for_is_no_matter(journal):
    publish(journal, 9, 1, wanted=OTHER_SCENE)
    assert list(plan(journal, "resume").todo) == list(FRAMES)


# Rendering


def test_frames_are_rendered_in_order_and_each_is_told_of(journal):
    maker = Maker(journal)
    told = render(journal, maker)
    assert maker.rendered == list(FRAMES)
    assert told.frames("done") == list(FRAMES)
    assert [journal.state(frame, paths, WANTED) for frame, paths in files_of(journal).items()] == [FrameState.WHOLE] * 4
    assert [journal.claims.holder(frame) for frame in FRAMES] == [None] * 4
    again = Maker(journal)
    assert (render(journal, again).events, again.rendered) == ([], [])


def test_a_frame_that_fails_is_passed_over_and_given_free(journal):
    maker = Maker(journal, fails={2: StereoReprojectError("no memory")}, unwritten={3: StereoReprojectError("no file")})
    told = render(journal, maker)
    assert maker.rendered == list(FRAMES)
    assert [event for event in told.events if event[0] == "failed"] == [
        ("failed", 2, "no memory"),
        ("failed", 3, "no file"),
    ]
    assert told.frames("done") == [1, 4]
    assert [journal.claims.holder(frame) for frame in FRAMES] == [None] * 4
    assert list(plan(journal, "resume").todo) == [2, 3]


def test_three_failures_in_a_row_are_enough(journal):
    errors = {frame: StereoReprojectError(f"frame {frame}: no memory") for frame in FRAMES}
    maker = Maker(journal, fails=errors)
    told = Listener()
    with pytest.raises(StereoReprojectError, match="frame 3: no memory"):
        render(journal, maker, told=told)
    assert maker.rendered == [1, 2, 3]
    assert told.frames("failed") == [1, 2]
    assert [journal.claims.holder(frame) for frame in FRAMES] == [None] * 4


def test_failures_that_are_not_in_a_row_are_not(journal):
    frames = range(1, 8)
    maker = Maker(journal, fails={frame: StereoReprojectError("no memory") for frame in (1, 2, 5, 6)})
    told = Listener()
    render_frames(plan(journal, frames=frames), journal, WANTED, OWN, maker, told.to)
    assert (told.frames("failed"), told.frames("done")) == ([1, 2, 5, 6], [3, 4, 7])


def test_what_is_wrong_with_all_frames_ends_the_run_at_the_first(journal):
    maker = Maker(journal, fails={1: BadInputError("no camera")})
    with pytest.raises(BadInputError, match="no camera"):
        render(journal, maker)
    assert maker.rendered == [1]


def test_what_is_wrong_with_a_later_frame_does_not(journal):
    maker = Maker(journal, fails={3: BadInputError("the camera is a panorama there")})
    told = render(journal, maker)
    assert (told.frames("failed"), told.frames("done")) == ([3], [1, 2, 4])


@pytest.mark.parametrize("how", ["fails", "unwritten"])
def test_a_folder_that_takes_nothing_ends_the_run(journal, how):
    maker = Maker(journal, **{how: {2: OutputError("the disk is full")}})
    with pytest.raises(OutputError, match="the disk is full"):
        render(journal, maker)
    assert 4 not in maker.rendered


def other_run_publishes(journal, _frame=None):
    """Another process renders frame 2 from its claim to its record."""
    if not files_of(journal)[2][0].exists():
        command = [sys.executable, "-c", PUBLISHING, str(journal.frames_folder)]
        subprocess.run(command, env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "error"}, check=True)


def test_what_another_run_has_done_meanwhile_is_not_rendered_again(journal):
    maker = Maker(journal, before=lambda frame: other_run_publishes(journal, frame))
    told = render(journal, maker)
    assert maker.rendered == [1, 3, 4]
    assert sorted(told.frames("done")) == list(FRAMES)
    assert files_of(journal)[2][0].read_bytes() == b"theirs"
    assert journal.claims.holder(2) is None


def test_with_overwrite_what_was_there_before_is_rendered_and_what_another_run_has_made_since_is_not(journal):
    for frame in (1, 2):
        publish(journal, frame, 1, token=EARLIER)

    def another_overwrites(frame):
        if frame == 1:
            publish(journal, 2, 1, token=ANOTHER)

    maker = Maker(journal, before=another_overwrites)
    told = render(journal, maker, existing="overwrite")
    assert maker.rendered == [1, 3, 4]
    assert ("done", 2, ANOTHER) in told.events


OTHERS = {
    "of other settings": (OTHER_SETTINGS, "of other settings: another folder keeps both"),
    "of another scene": (OTHER_SCENE, r"of another scene \(Object, Mesh\): another folder keeps both"),
}


@pytest.mark.parametrize("others", OTHERS)
@pytest.mark.parametrize("existing", EXISTING)
def test_what_another_run_has_made_meanwhile_of_something_else_is_not_rendered_over(journal, existing, others):
    wanted, said = OTHERS[others]
    if existing == "overwrite":
        # What was there before is of no account.
        publish(journal, 3, 1, token=EARLIER, wanted=OTHER_SCENE)

    def they_publish(frame):
        if frame == 2:
            publish(journal, 3, 1, token=ANOTHER, wanted=wanted)

    maker = Maker(journal, before=they_publish)
    told = Listener()
    with pytest.raises(BadInputError, match=f"another run has rendered frame 3 meanwhile, {said}; finished frames"):
        render(journal, maker, existing=existing, told=told)
    assert maker.rendered == told.frames("done") == [1, 2], "and what is rendered by now is written and told of"
    assert files_of(journal)[3][0].read_text() == f"frame 3 by {ANOTHER}"
    assert [journal.claims.holder(frame) for frame in FRAMES] == [None] * 4


def test_what_was_of_other_settings_before_is_rendered_by_one_of_several_runs_alone(journal):
    for frame in FRAMES:
        publish(journal, frame, 1, token=EARLIER, wanted=OTHER_SETTINGS)

    def another_renders(frame):
        if frame == 1:
            publish(journal, 2, 1, token=ANOTHER)

    maker = Maker(journal, before=another_renders)
    told = render(journal, maker)
    assert maker.rendered == [1, 3, 4]
    assert ("done", 2, ANOTHER) in told.events
    check_frames_stayed(journal, FRAMES, WANTED)


def test_a_frame_that_another_run_has_replaced_by_something_else_is_found_in_the_end(journal):
    for frame in FRAMES:
        publish(journal, frame, 1)
    publish(journal, 2, 1, token=ANOTHER, wanted=OTHER_SETTINGS)
    check_frames_stayed(journal, (1, 3, 4, 9), WANTED)
    with pytest.raises(BadInputError, match="another run has rendered frame 2 meanwhile, of other settings"):
        check_frames_stayed(journal, FRAMES, WANTED)


def announce(journal, *, beat=0, frames=(3, 4, 5, 9), wanted=OTHER_SCENE, **other):
    """Unless told otherwise, as earlier versions do it, which do not say whether they have settled."""
    facts = announcement(journal, frames, wanted)
    facts.pop("settled")
    elsewhere(journal, FAR, beat, **{**facts, **other})


def test_a_run_that_is_at_the_same_frames_of_another_scene_is_in_the_way(journal):
    announce(journal)
    waits = []

    def it_beats(frames):
        waits.append(list(frames))
        announce(journal, beat=1)

    with pytest.raises(BadInputError) as refused:
        settle(journal, FRAMES, WANTED, OWN, it_beats)
    assert (
        f"{journal.frames_folder}: another run renders frames 3-4 there, of another scene (Object, Mesh): another"
        in (str(refused.value))
    )
    assert waits == [[3, 4]]


def test_a_run_that_a_power_cut_has_ended_elsewhere_is_in_nobodys_way_for_good(journal, clock):
    announce(journal)
    waits = []

    def time_passes(frames):
        waits.append(list(frames))
        clock.now += STALE_SECONDS / 2

    settle(journal, FRAMES, WANTED, OWN, time_passes)
    assert len(waits) == 2


SMALLEST, GREATEST = "0" * 16, "f" * 16


def test_of_two_runs_that_look_at_once_the_one_with_the_greater_token_gives_way(journal):
    """Neither has settled: each has announced itself, and sees the other."""
    announce(journal, settled=0)
    waits = []

    def it_beats(frames):
        waits.append(frames)
        announce(journal, settled=0, beat=len(waits))

    with pytest.raises(BadInputError, match="another run renders frames 3-4 there"):
        settle(journal, FRAMES, WANTED, GREATEST, it_beats)
    assert waits == [[3, 4]]


def test_of_two_runs_that_look_at_once_the_one_with_the_smaller_token_goes_on_when_the_other_has_gone(journal):
    elsewhere(journal, SMALLEST, **announcement(journal, FRAMES, WANTED))
    announce(journal, settled=0)
    waits = []

    def it_beats_and_goes(frames):
        waits.append(frames)
        assert not is_settled(journal, SMALLEST)
        if len(waits) < 3:
            announce(journal, settled=0, beat=len(waits))
        else:
            journal.runs.path(FAR).unlink()

    settle(journal, FRAMES, WANTED, SMALLEST, it_beats_and_goes)
    assert len(waits) == 3
    assert is_settled(journal, SMALLEST)


def test_a_run_that_settles_meanwhile_stays_whatever_its_token(journal):
    announce(journal, settled=0)
    waits = []

    def it_settles(frames):
        waits.append(frames)
        announce(journal, settled=0, beat=len(waits))
        if len(waits) == 3:
            journal.runs.mark_settled(FAR)

    with pytest.raises(BadInputError, match="another run renders frames 3-4 there"):
        settle(journal, FRAMES, WANTED, SMALLEST, it_settles)
    assert len(waits) == 3


def test_a_run_that_was_stopped_before_it_settled_is_not_waited_for_for_ever(journal, clock):
    """Its number goes on, for another process counts it."""
    announce(journal, settled=0)
    waits = []

    def it_beats(frames):
        waits.append(frames)
        clock.now += STALE_SECONDS / 3
        announce(journal, settled=0, beat=len(waits))

    with pytest.raises(BadInputError, match="another run renders frames 3-4 there"):
        settle(journal, FRAMES, WANTED, SMALLEST, it_beats)
    assert len(waits) == 3


def is_settled(journal, token):
    (found,) = (run.settled for run in other_runs(journal, OWN) if run.token == token)
    return found


def test_a_run_that_settles_changes_one_byte_of_its_file(journal):
    elsewhere(journal, OWN, 7, **announcement(journal, FRAMES, WANTED))
    before = journal.runs.path(OWN).read_bytes()
    settle(journal, FRAMES, WANTED, OWN)
    after = journal.runs.path(OWN).read_bytes()
    assert after == before.replace(b'"settled": 0', b'"settled": 1') != before


UNCONCERNED = {
    "the same": {"wanted": WANTED},
    "other frames": {"frames": (5, 9)},
    "another name": {"of": "others_"},
    "no frames": {"frames": ()},
    "unreadable frames": {"frames": (), "of": ""},
    "no scene": {"scene": None},
    "a list": {"scene": [1]},
    "no settings": {"settings": 7, "scene": {}, "of": None},
}


@pytest.mark.parametrize("kind", UNCONCERNED)
def test_other_runs_are_in_nobodys_way(journal, kind):
    def never(_):
        raise AssertionError("there is nothing to wait for")

    announce(journal, **UNCONCERNED[kind])
    settle(journal, FRAMES, WANTED, OWN, never)
    elsewhere(journal, FAR)  # as earlier versions do
    settle(journal, FRAMES, WANTED, OWN, never)


def test_an_announcement_tells_frames_and_is_short(journal):
    announce(journal)
    (other,) = other_runs(journal, OWN)
    assert (other.token, other.frames, other.wanted) == (FAR, {3, 4, 5, 9}, OTHER_SCENE)
    announce(journal, frames=[number * number for number in range(1000)])
    (other,) = other_runs(journal, OWN)
    assert other.frames == set(range(998_002))
    assert journal.runs.path(FAR).stat().st_size < RUN_BYTES / 2
    assert other_runs(journal, FAR) == []


def test_frames_of_others_are_waited_for_when_all_else_is_done(journal):
    elsewhere(journal, FAR)
    claim = journal.claims.take(1, FAR)
    looks = []

    def they_finish(frames):
        looks.append(list(frames))
        if len(looks) == 2:
            publish(journal, 1, claim, token=FAR)

    maker = Maker(journal)
    told = render(journal, maker, told=Listener(they_finish))
    assert maker.rendered == [2, 3, 4]
    assert looks == [[1], [1]]
    assert told.events[-1] == ("done", 1, FAR)
    assert told.frames("done")[:3] == [2, 3, 4], "own frames are told of before it waits"


def test_frames_of_others_are_taken_over_when_those_are_dead(journal, clock):
    elsewhere(journal, FAR)
    assert journal.claims.take(2, FAR) == 1
    waits = []

    def time_passes(_frames):
        waits.append(clock.now)
        clock.now += STALE_SECONDS / 2

    maker = Maker(journal)
    told = render(journal, maker, told=Listener(time_passes))
    assert maker.rendered == [1, 3, 4, 2]
    assert len(waits) == 2
    assert told.frames("done")[-1] == 2
    assert journal.claims.holder(2) is None


def test_frames_of_others_are_not_taken_over_as_long_as_those_live(journal, clock):
    elsewhere(journal, FAR)
    claim = journal.claims.take(2, FAR)
    beats = []

    def time_passes(_frames):
        clock.now += STALE_SECONDS - 1
        beats.append(None)
        elsewhere(journal, FAR, beat=len(beats))
        if len(beats) == 5:
            publish(journal, 2, claim, token=FAR)

    maker = Maker(journal)
    render(journal, maker, told=Listener(time_passes))
    assert (maker.rendered, len(beats)) == ([1, 3, 4], 5)


# Publishing


def test_a_frames_files_are_published_with_their_sums_and_the_claim_goes(journal):
    made = {}
    for name in ("0007_L.png", "0007_R.png", "holes/0007.png"):
        made[name] = journal.frames_folder / f"made-{len(made)}"
        made[name].write_bytes(name.encode())
    claim = journal.claims.take(7, OWN)
    fields = {"frame": 7, "settings": "s", "scene": {}, "run": OWN, "figures": {"wall_seconds": 1.0}}
    record = publish_frame(journal, made, fields, claim)
    assert journal.records.read(7) == record
    assert sorted(record.files) == sorted(made)
    for name in made:
        assert (journal.frames_folder / name).read_bytes() == name.encode()
        assert record.files[name]["bytes"] == len(name)
    assert journal.claims.holder(7) is None


def test_a_frame_that_cannot_be_published_has_no_record(journal):
    (journal.frames_folder / "0001.png").mkdir()
    with pytest.raises(OutputError, match=r"cannot be written \(.*\): finished frames are kept, and --resume"):
        publish(journal, 1, journal.claims.take(1, OWN))
    assert journal.records.read(1) is None


def test_what_stands_in_the_way_of_writing_is_one_line(tmp_path):
    Journal(tmp_path).place.make()
    full = str(failed_output(tmp_path, OSError(errno.ENOSPC, "No space left on device")))
    assert "the disk is full; free some space: finished frames are kept, and --resume renders the rest" in full
    denied = str(failed_output(tmp_path, OSError(errno.EACCES, "Permission denied")))
    assert f"{tmp_path} cannot be written (Permission denied): finished frames are kept" in denied
    said = str(failed_output(tmp_path, StereoReprojectError("cannot write frame 3: no codec")))
    assert "cannot be written (cannot write frame 3: no codec)" in said
    gone = str(failed_output(tmp_path / "gone", OSError(errno.ENOENT, "No such file")))
    assert gone == f"{tmp_path / 'gone'} is gone, with the frames that were in it"
    # As good as shut, also for root.
    shut = str(failed_output(tmp_path / ("x" * 300), StereoReprojectError("no file")))
    assert "cannot be written (no file)" in shut


@pytest.mark.skipif(os.name != "posix", reason="counts files as POSIX has it")
@pytest.mark.parametrize(("files", "free", "full"), [(400, 3, True), (400, 300, False), (0, 0, False)])
def test_a_drive_without_room_for_further_files_is_full(tmp_path, monkeypatch, files, free, full):
    real = os.statvfs(tmp_path)
    facts = [*real]
    facts[5:8] = files, free, free
    monkeypatch.setattr(os, "statvfs", lambda _: os.statvfs_result(facts))
    assert is_full(tmp_path, below=0) is full


@pytest.mark.parametrize(
    ("frames", "text"),
    [
        ([], ""),
        ([3], "3"),
        ([1, 2], "1-2"),
        ([2, 1, 3, 3], "1-3"),
        ([1, 3], "1, 3"),
        ([1, 3, 5], "1-5:2"),
        ([1, 2, 3, 10, 20, 22, 24], "1-3, 10, 20-24:2"),
    ],
)
def test_frames_are_spelled_as_people_write_them(frames, text):
    assert spelled(frames) == text


def test_a_frame_that_is_replaced_half_has_no_record(journal):
    """Its files would be of two renders."""
    for token, right in ((EARLIER, "0001_R.png"), (ANOTHER, "0001_R.png")):
        elsewhere(journal, token)
        claim = journal.claims.take(1, token)
        made = {name: journal.frames_folder / f"made-{name}" for name in ("0001_L.png", right)}
        for path in made.values():
            path.write_text(token)
        fields = {"frame": 1, "settings": "s", "scene": {}, "run": token, "figures": {}}
        if token == EARLIER:
            publish_frame(journal, made, fields, claim)
            (journal.frames_folder / right).unlink()
            (journal.frames_folder / right).mkdir()
        else:
            with pytest.raises(OutputError):
                publish_frame(journal, made, fields, claim)
    assert (journal.frames_folder / "0001_L.png").read_text() == ANOTHER
    assert journal.records.read(1) is None


def test_of_many_frames_those_alone_are_looked_at_that_are_there(journal):
    publish(journal, 3, journal.claims.take(3, OWN))
    journal.frames_folder.joinpath("0005.png").write_bytes(b"of somebody else")
    journal.claims.take(7, OWN)
    looked = []
    frames = range(1, 20_001)
    planned = plan_frames(journal, files_of(journal, frames), WANTED, "resume", on_look=looked.append)
    assert looked == [3, 5, 7]
    assert list(planned.kept) == [3]
    assert [frame for frame, state in planned.todo.items() if state is not FrameState.MISSING] == [5]
    assert len(planned.todo) == len(frames) - 1


def test_what_is_called_alike_but_for_capitals_and_accents_is_looked_at(tmp_path):
    (tmp_path / "Shot_e\u0301_0001.png").write_bytes(b"")
    there = Listing()
    assert there.may_hold(tmp_path / "shot_\u00e9_0001.png")
    assert not there.may_hold(tmp_path / "shot_\u00e9_0002.png")
    assert not there.may_hold(tmp_path / "none" / "shot_\u00e9_0001.png")


def test_many_frames_that_are_not_one_after_the_other_are_spelled_quickly():
    squares = [number * number for number in range(100_000)]
    start = time.process_time()
    assert spelled(squares).endswith("9999600004, 9999800001")
    assert time.process_time() - start < SPELLED_SECONDS


def test_the_time_that_is_left_counts_no_load(journal):
    times = iter([100.0, 103.0, 105.0])
    told = []
    plan = FramePlan(dict.fromkeys(FRAMES, FrameState.MISSING), {}, {})
    progress = AnimationProgress(
        plan, len(FRAMES), ProgressListener(on_frame=told.append), {}, clock=lambda: next(times)
    )
    for frame in FRAMES[:3]:
        figures = {"wall_seconds": 2.0}
        progress.frame_listener.done(frame, Record(frame, {}, "", {}, OWN, figures))
    assert [event["each"] for event in told] == [2.0, 3.0, 2.5]
    assert [event["remaining"] for event in told] == [2.0 * 3, 3.0 * 2, 2.5]
