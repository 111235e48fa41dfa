"""The journal of an animation: what it says of a frame whatever has become of its files, and whose a frame is."""

import json
import os
import platform
import re
import subprocess
import sys
import threading
import time
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from stereo_reproject.errors import BadInputError
from stereo_reproject.sequence import agreed_values
from stereo_reproject.sequence import runs as runs_module
from stereo_reproject.sequence.checksums import checksum
from stereo_reproject.sequence.fingerprints import Fingerprints, FrameState, digest
from stereo_reproject.sequence.frame_record import Record, is_confined
from stereo_reproject.sequence.journal import Journal
from stereo_reproject.sequence.journal_folder import EARLIER_JOURNAL, JOURNAL
from stereo_reproject.sequence.runs import BEAT_DIGITS, LiveRuns, machine, run_at_work
from stereo_reproject.settings.frame import MAX_FRAME
from tests.jobs.clock import Clock
from tests.programs.tokens import token_of
from tests.warp.strange import STRANGE, make_folder, make_huge_file

posix = pytest.mark.skipif(os.name != "posix", reason="named pipes and links as POSIX has them")

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 30.0

FIRST, SECOND, LATE, GONE, NEXT, FAR, NEW, NOBODY = map(
    token_of, ("first", "second", "late", "gone", "next", "far", "new", "nobody")
)
"""Runs."""

WANTED = Fingerprints("settings", {"Object": "1", "Mesh": "2"})

AT_WORK = """
import sys
from pathlib import Path
from stereo_reproject.sequence.runs import LiveRuns, run_at_work

with run_at_work(LiveRuns(Path(sys.argv[1]))) as token:
    print(token, flush=True)
    sys.stdin.read()
"""

BEATING = """
from stereo_reproject.programs import heartbeat
heartbeat.BEAT_SECONDS = 0.01
heartbeat.main()
"""


@pytest.fixture
def clock():
    return Clock(1000.0)


@pytest.fixture
def journal(tmp_path, clock):
    made = Journal(tmp_path, "shot_", runs=LiveRuns(tmp_path / JOURNAL, clock=clock))
    made.place.make()
    return made


@pytest.fixture
def start():
    """Starts a Python of its own, with the package in it."""
    started = []

    def start_python(code, *arguments):
        process = subprocess.Popen(
            [sys.executable, "-c", code, *map(str, arguments)],
            env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "error"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        started.append(process)
        return process

    yield start_python
    for process in started:
        with process:
            process.kill()


def wait_until(condition):
    deadline = time.monotonic() + SECONDS
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def finish(journal, frame, *, wanted=WANTED, files=("_L.png", "_R.png")):
    """A frame that is whole: its files and its record."""
    paths = paths_of(journal, frame, files)
    for path in paths:
        path.write_bytes(f"pixels of {path.name}".encode())
    sums = {path.name: checksum(path) for path in paths}
    record = Record(frame, sums, wanted.settings, wanted.scene, "run", {"wall_seconds": 1.5})
    journal.records.write(record)
    return record


def paths_of(journal, frame, files=("_L.png", "_R.png")):
    return [journal.frames_folder / f"shot_{frame:04d}{end}" for end in files]


def state(journal, frame=1, wanted=WANTED):
    return journal.state(frame, paths_of(journal, frame), wanted)


def elsewhere(journal, token, beat=0):
    """The file of a run on another machine."""
    facts = {"host": "farm-7", "machine": "another", "pid": os.getpid()}
    journal.runs.path(token).write_text(f"{json.dumps(facts)}\n{beat:0{BEAT_DIGITS}}")


def dead_here(journal, token):
    """The file of a run on this machine whose process is gone."""
    finished = subprocess.Popen([sys.executable, "-c", ""])
    finished.wait()
    facts = {"host": platform.node(), "machine": machine(), "pid": finished.pid}
    journal.runs.path(token).write_text(f"{json.dumps(facts)}\n{7:0{BEAT_DIGITS}}")


# The folder


def test_the_journal_is_out_of_sight(journal):
    assert journal.folder.name.startswith(".")
    assert [path.name for path in journal.frames_folder.iterdir()] == [journal.folder.name]


def test_an_animation_that_an_earlier_version_began_goes_on_in_its_journal(journal, tmp_path):
    finish(journal, 3)
    journal.folder.rename(tmp_path / EARLIER_JOURNAL)
    found = Journal(tmp_path, "shot_")
    assert found.folder == tmp_path / EARLIER_JOURNAL
    assert found.known_frames() == {3}
    assert state(found, 3) is FrameState.WHOLE


def test_a_folder_of_the_user_s_with_the_earlier_name_is_left_alone(tmp_path):
    (tmp_path / EARLIER_JOURNAL).mkdir()
    (tmp_path / EARLIER_JOURNAL / "monday.txt").write_text("dear diary")
    assert Journal(tmp_path, "shot_").folder == tmp_path / JOURNAL


def test_of_two_journals_the_present_version_s_counts(journal, tmp_path):
    (tmp_path / EARLIER_JOURNAL).mkdir()
    (tmp_path / EARLIER_JOURNAL / "shot_0001.json").write_text("{}")
    assert Journal(tmp_path, "shot_").folder == journal.folder


def test_a_link_with_the_earlier_name_is_not_followed(journal, tmp_path):
    finish(journal, 3)
    journal.folder.rename(tmp_path / "elsewhere")
    (tmp_path / EARLIER_JOURNAL).symlink_to(tmp_path / "elsewhere", target_is_directory=True)
    assert Journal(tmp_path, "shot_").folder == tmp_path / JOURNAL


# Records


def test_a_record_comes_back_as_it_was_written(journal):
    record = finish(journal, 12)
    assert journal.records.read(12) == record
    assert (journal.records.read(13), journal.records.has_file(13)) == (None, False)


def test_all_records_come_in_order_and_only_those_of_the_same_name(journal):
    for frame in (10000, 3, 0):
        finish(journal, frame)
    other = Journal(journal.frames_folder, "shot_1")
    finish(other, 4)
    assert [record.frame for record in journal.records.read_all()] == [0, 3, 10000]
    assert [record.frame for record in journal.records.read_all([3, 4])] == [3]
    assert [record.frame for record in other.records.read_all()] == [4]


def test_no_folder_is_no_records(tmp_path):
    empty = Journal(tmp_path)
    assert (empty.records.read_all(), empty.records.read(1), empty.claims.holder(1)) == ([], None, None)


RUBBISH = {
    "nothing": b"",
    "cut in half": None,
    "zeros": bytes(200),
    "no text": b"\xff\xfe\x00",
    "another type": b"[]",
    "null": b"null",
    "no fields": b"{}",
    "a field too many": {"colour": "red"},
    "another schema": {"schema": 2},
    "another frame": {"frame": 2},
    "no files": {"files": {}},
    "a list of files": {"files": ["a.png"]},
    "files without sums": {"files": {"a.png": 1}},
    "an endless file": b'{"files": {"a.png": {"bytes": 1e999, "sha256": ""}}}',
    "no scene": {"scene": None},
    "no figures": {"figures": 1},
}


@pytest.mark.parametrize("kind", RUBBISH)
def test_rubbish_is_no_record_and_its_frame_is_unknown(journal, kind):
    record, rubbish = finish(journal, 1), RUBBISH[kind]
    path = journal.folder / "shot_0001.json"
    if rubbish is None:
        rubbish = path.read_bytes()[: path.stat().st_size // 2]
    elif isinstance(rubbish, dict):
        rubbish = json.dumps({**asdict(record), **rubbish}).encode()
    path.write_bytes(rubbish)
    assert journal.records.read(1) is None
    assert journal.records.read_all() == []
    assert state(journal) is FrameState.UNKNOWN
    for file in paths_of(journal, 1):
        file.unlink()
    assert state(journal) is FrameState.UNKNOWN


FIELDS = {
    "frame": [True, -1, 1.0, "1", None],
    "files": [
        {"a.png": {"bytes": "1", "sha256": ""}},
        {"a.png": {"bytes": 1, "sha256": None}},
        {"a.png": {"bytes": 1}},
    ],
    "settings": [1, None, ["settings"]],
    "scene": [{"Object": 1}, [], "Object"],
    "run": [7, None, ["run"]],
    "figures": [[], None, "none"],
    "schema": [True, 1.0, "1"],
}


@pytest.mark.parametrize("field", FIELDS)
def test_each_field_of_a_record_is_of_its_kind_or_nothing_is_believed(journal, field):
    record = finish(journal, 1)
    path = journal.folder / "shot_0001.json"
    for value in FIELDS[field]:
        path.write_text(json.dumps({**asdict(record), field: value}))
        assert journal.records.read(1) is None, value
        assert state(journal) is FrameState.UNKNOWN
    assert str(path) in journal.records.new_doubts()[0]


@posix
@pytest.mark.parametrize("make", STRANGE)
def test_whatever_else_lies_in_a_records_place_is_named_and_its_frame_unknown(journal, make):
    finish(journal, 1)
    path = journal.folder / "shot_0001.json"
    path.unlink()
    make(path)
    assert journal.records.read(1) is None
    assert state(journal) is FrameState.UNKNOWN
    (doubt,) = journal.records.new_doubts()
    assert doubt.startswith(f"{path} is no record that can be read (it is ")
    assert doubt.endswith("): frame 1 counts as not rendered")
    assert journal.records.new_doubts() == [], "once is enough"
    if make is make_folder:
        with pytest.raises(OSError, match=re.escape("shot_0001.json in .stereo_reproject is a folder: move it")):
            finish(journal, 1)
    else:
        finish(journal, 1)
        assert state(journal) is FrameState.WHOLE


OUTSIDE = [
    "../a.png",
    "/etc/passwd",
    "a/../../b.png",
    "..\\a.png",
    "a\\..\\..\\b.png",
    "",
    ".",
    "a//b.png",
    "a\0b",
    "a/",
]


@pytest.mark.parametrize("name", OUTSIDE)
def test_a_record_that_names_files_elsewhere_is_none(journal, name):
    record = finish(journal, 1)
    known = next(iter(record.files.values()))
    journal.records.write(replace(record, files={**record.files, name: known}))
    assert journal.records.read(1) is None
    (doubt,) = journal.records.new_doubts()
    assert repr(name) in doubt


@pytest.mark.parametrize(
    ("name", "windows", "posix"),
    [
        ("holes/0001.png", True, True),
        ("a\\b.png", True, True),
        ("C:a.png", False, True),
        ("a.png:stream", False, True),
        ("\\\\host\\share\\a.png", False, False),
        ("C:\\a.png", False, True),
        (f"holes/{251 * 'n'}.png", True, True),
        (f"{252 * 'n'}.png", False, False),
        ("/".join(600 * "n"), False, False),
        ("\ud800.png", False, False),
    ],
)
def test_a_name_leads_to_something_in_the_folder_or_not(name, windows, posix):
    assert (is_confined(name, windows=True), is_confined(name, windows=False)) == (windows, posix)


@posix
@pytest.mark.parametrize("make", [make for make in STRANGE if make is not make_huge_file])
def test_whatever_else_lies_in_a_files_place_is_not_read(journal, make):
    record = finish(journal, 1)
    (path, _) = paths_of(journal, 1)
    path.unlink()
    make(path)
    size = path.lstat().st_size
    journal.records.write(
        replace(record, files={name: {**known, "bytes": size} for name, known in record.files.items()})
    )
    assert state(journal) is FrameState.DAMAGED


@posix
@pytest.mark.parametrize("of_folder", [False, True])
def test_a_link_that_leaves_the_folder_is_no_file_of_it(journal, tmp_path_factory, of_folder):
    outside = tmp_path_factory.mktemp("outside")
    (outside / "a.png").write_bytes(b"pixels")
    place = journal.frames_folder / "holes"
    if of_folder:
        place.symlink_to(outside, target_is_directory=True)
    else:
        place.mkdir()
        (place / "a.png").symlink_to(outside / "a.png")
    record = finish(journal, 1)
    journal.records.write(replace(record, files={**record.files, "holes/a.png": checksum(outside / "a.png")}))
    assert state(journal) is FrameState.DAMAGED


def test_of_two_records_of_a_frame_its_own_counts_and_the_other_is_named(journal):
    finish(journal, 3)
    twin = journal.folder / "shot_00003.json"
    twin.write_bytes((journal.folder / "shot_0003.json").read_bytes())
    assert [record.frame for record in journal.records.read_all()] == [3]
    assert journal.records.new_doubts() == [f"{twin} is passed over: the record of frame 3 is shot_0003.json"]


def test_records_of_frames_whose_name_goes_on_with_digits_are_nobodys_doubt(journal):
    for name in ("shot_0", "shot_1"):
        sums = {f"{name}0003.png": {"bytes": 1, "sha256": "0"}}
        Journal(journal.frames_folder, name).records.write(Record(3, sums, WANTED.settings, WANTED.scene, "run", {}))
    assert (journal.records.read_all(), journal.records.new_doubts()) == ([], [])


@posix
def test_a_link_is_no_journal(tmp_path):
    outside, frames = tmp_path / "outside", tmp_path / "frames"
    outside.mkdir()
    frames.mkdir()
    journal = Journal(frames)
    journal.folder.symlink_to(outside, target_is_directory=True)
    claim = outside / "0001.claim.1"
    claim.write_text("0" * 16)
    with pytest.raises(BadInputError, match="is a link to another folder"):
        journal.place.make()
    journal.runs.clear(own="")
    assert claim.read_text() == "0" * 16


# What there is of a frame


def test_a_frame_is_whole_as_it_was_published(journal):
    finish(journal, 1)
    assert state(journal) is FrameState.WHOLE


def test_a_frame_of_which_nothing_is_known_and_nothing_there_is_missing(journal):
    assert state(journal) is FrameState.MISSING
    for path in paths_of(journal, 1):
        path.touch()  # as Blender's own placeholders are
    assert state(journal) is FrameState.MISSING


def test_files_that_nobody_recorded_are_unknown(journal):
    paths_of(journal, 1)[1].write_bytes(b"somebody's")
    assert state(journal) is FrameState.UNKNOWN


@pytest.mark.parametrize("which", [0, 1])
def test_one_file_that_is_gone_is_missing(journal, which):
    finish(journal, 1)
    paths_of(journal, 1)[which].unlink()
    assert state(journal) is FrameState.MISSING


def damaged_in_one_byte(data):
    return bytes([data[0] ^ 1]) + data[1:]


@pytest.mark.parametrize(
    "damage",
    [
        damaged_in_one_byte,
        lambda data: data[:-1],
        lambda data: data + b"\0",
        lambda _: b"",
        lambda data: bytes(len(data)),
    ],
    ids=["one byte", "shorter", "longer", "empty", "zeros"],
)
@pytest.mark.parametrize("which", [0, 1])
def test_a_file_that_is_not_as_it_was_is_damaged(journal, which, damage):
    finish(journal, 1)
    path = paths_of(journal, 1)[which]
    path.write_bytes(damage(path.read_bytes()))
    assert state(journal) is FrameState.DAMAGED


def test_other_settings_and_another_scene_are_told_apart(journal):
    finish(journal, 1)
    other_settings = replace(WANTED, settings="others")
    moved = replace(WANTED, scene={"Object": "9", "Mesh": "2", "World": "3"})
    assert state(journal, wanted=other_settings) is FrameState.OTHER_SETTINGS
    assert state(journal, wanted=moved) is FrameState.OTHER_SCENE
    assert state(journal, wanted=replace(moved, settings="others")) is FrameState.OTHER_SCENE
    assert moved.changed(journal.records.read(1)) == ["Object", "World"]
    assert WANTED.changed(journal.records.read(1)) == []


def test_a_digest_depends_on_values_and_not_on_their_order():
    assert digest({"a": 1, "b": [2]}) == digest({"b": [2], "a": 1}) != digest({"a": 1, "b": [3]})


# Whose a frame is


def test_of_many_that_take_a_frame_one_has_it(journal):
    tokens = [token_of(f"run{number}") for number in range(12)]
    for token in tokens:
        elsewhere(journal, token)
    barrier, taken = threading.Barrier(len(tokens)), {}

    def take(token):
        own = Journal(journal.frames_folder, "shot_")
        barrier.wait()
        taken[token] = own.claims.take(5, token)

    threads = [threading.Thread(target=take, args=(token,)) for token in tokens]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    winners = [token for token, claim in taken.items() if claim is not None]
    assert len(winners) == 1
    assert journal.claims.holder(5) == winners[0]
    assert journal.claims.take(5, LATE) is None
    assert journal.claims.take(6, LATE) == 1


def test_of_many_that_take_over_from_a_dead_run_one_has_it(journal):
    assert journal.claims.take(5, GONE) == 1
    barrier, taken = threading.Barrier(8), []
    for number in range(8):
        elsewhere(journal, token_of(f"run{number}"))

    def take(number):
        own = Journal(journal.frames_folder, "shot_")
        barrier.wait()
        taken.append(own.claims.take(5, token_of(f"run{number}")))

    threads = [threading.Thread(target=take, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(claim for claim in taken if claim is not None) == [2]


def test_a_frame_that_is_given_free_can_be_taken_again(journal):
    elsewhere(journal, FIRST)
    claim = journal.claims.take(1, FIRST)
    assert journal.claims.take(1, SECOND) is None
    journal.claims.release(1, claim, FIRST)
    assert journal.claims.holder(1) is None
    assert journal.claims.take(1, SECOND) == 1


def test_giving_a_frame_free_leaves_who_has_taken_over(journal):
    dead_here(journal, FIRST)
    elsewhere(journal, SECOND)
    first = journal.claims.take(1, FIRST)
    second = journal.claims.take(1, SECOND)
    assert (first, second) == (1, 2)
    journal.claims.release(1, first, FIRST)
    assert journal.claims.holder(1) == SECOND
    journal.claims.release(1, second, SECOND)
    assert journal.claims.holder(1) is None


def test_what_a_dead_run_of_this_machine_has_is_taken_over_at_once(journal):
    dead_here(journal, GONE)
    assert not journal.runs.lives(GONE)
    assert journal.claims.take(1, GONE) == 1
    assert journal.claims.take(1, NEXT) == 2
    assert journal.claims.holder(1) == NEXT


def test_a_run_without_a_file_is_dead(journal):
    assert not journal.runs.lives(NOBODY)
    assert not journal.runs.lives("")


def test_a_run_of_another_machine_lives_as_long_as_its_number_changes(journal, clock):
    elsewhere(journal, FAR, beat=1)
    assert journal.claims.take(1, FAR) == 1
    assert journal.runs.lives(FAR)
    clock.now += runs_module.STALE_SECONDS - 1
    assert journal.runs.lives(FAR)
    elsewhere(journal, FAR, beat=2)
    assert journal.runs.lives(FAR)
    clock.now += runs_module.STALE_SECONDS - 1
    assert journal.claims.take(1, NEXT) is None
    clock.now += 1
    assert not journal.runs.lives(FAR)
    assert journal.claims.take(1, NEXT) == 2


def test_a_run_that_comes_back_lives_again(journal, clock):
    elsewhere(journal, FAR, beat=1)
    assert journal.runs.lives(FAR)
    clock.now += runs_module.STALE_SECONDS
    assert not journal.runs.lives(FAR)
    elsewhere(journal, FAR, beat=2)
    assert journal.runs.lives(FAR)


def test_a_run_is_seen_for_the_first_time_when_one_looks_first(journal, clock):
    """However long ago it was written: clocks of machines need not agree."""
    elsewhere(journal, FAR)
    os.utime(journal.runs.path(FAR), (0, 0))
    assert journal.runs.lives(FAR)


@pytest.mark.parametrize("content", [b"", b"\n", b"{", b"null\n0", b"\xff" * 40])
def test_a_run_file_without_sense_is_given_time_and_then_dead(journal, clock, content):
    journal.runs.path(NEW).write_bytes(content)
    assert journal.runs.lives(NEW)
    clock.now += runs_module.STALE_SECONDS
    assert not journal.runs.lives(NEW)


def test_a_claim_that_names_no_run_yet_is_given_time_and_then_taken_over(journal, clock):
    (journal.folder / "shot_0001.claim.1").touch()
    assert journal.claims.take(1, NEXT) is None
    clock.now += runs_module.STALE_SECONDS
    assert journal.claims.take(1, NEXT) == 2


DAMAGED_CLAIMS = [bytes(16), b"\xff" * 16, b"../../somewhere", b"0123456789ABCDEF", b"\n", b"x"]


@pytest.mark.parametrize("content", DAMAGED_CLAIMS)
def test_a_damaged_claim_is_given_time_and_then_taken_over(journal, clock, content):
    """After a power cut it may hold anything; but it may also be one that was made a moment ago."""
    (journal.folder / "shot_0001.claim.1").write_bytes(content)
    assert journal.claims.take(1, NEXT) is None
    clock.now += runs_module.STALE_SECONDS
    assert journal.claims.take(1, NEXT) == 2


@pytest.mark.parametrize("content", [b"x" * 5000, b"\0" * 5000])
def test_a_claim_that_no_run_can_have_made_is_taken_over(journal, content):
    (journal.folder / "shot_0001.claim.1").write_bytes(content)
    assert journal.claims.take(1, NEXT) == 2


@posix
@pytest.mark.parametrize("make", STRANGE)
def test_whatever_else_is_called_as_a_claim_holds_nobody_up_and_stays(journal, make):
    strange = journal.folder / "shot_0001.claim.7"
    make(strange)
    number = journal.claims.take(1, NEXT)
    assert (number, journal.claims.holder(1)) == (8, NEXT)
    journal.claims.release(1, number, NEXT)
    journal.runs.clear(NEXT)
    assert [path.name for path in journal.folder.iterdir()] == ([] if make is make_huge_file else [strange.name])


@posix
@pytest.mark.parametrize("make", STRANGE)
def test_whatever_else_is_called_as_a_run_is_none(journal, make):
    make(journal.runs.path(NEW))
    assert not journal.runs.lives(NEW)
    assert not journal.runs.any_lives(but=NEXT)
    with run_at_work(journal.runs):
        pass
    left = [path for path in journal.folder.iterdir() if not path.is_file() or path.is_symlink()]
    assert left == list(journal.folder.iterdir())


@pytest.mark.parametrize("token", ["../outside", "first", "", "0123456789abcdef0", "shot_0001.claim.1/../x", "\0"])
def test_what_is_no_token_leads_to_no_file(journal, token):
    (journal.frames_folder / "outside").write_text("{}\n0")
    (journal.folder / "run-first").write_text("{}\n0")
    assert not journal.runs.lives(token)


OTHERS = [
    "notes.claim.1", "0001.claim.x", "shot_0001.claim.01", "shot 0001.claim.1", ".0001.json.tmp", ".x.json.77.tmp",
    ".swp.tmp", "run-1", "run-0123456789ABCDEF", ".run-1.tmp", ".a.psd.0123456789abcdef.tmp", "0001.claim.1.bak",
]  # fmt: skip
OURS = [
    "0001.claim.1", "shot_10001.claim.12", ".0001.json.0123456789abcdef.tmp", ".animation.svg.0123456789abcdef.tmp",
    ".shot_animation.png.0123456789abcdef.tmp", ".run-0123456789abcdef.tmp", "run-0123456789abcdef",
]  # fmt: skip


def test_only_what_is_exactly_ours_is_cleared_away(journal):
    for name in (*OTHERS, *OURS):
        (journal.folder / name).write_text("")
    dead_here(journal, "0123456789abcdef")
    journal.runs.clear(NEXT)
    assert {path.name for path in journal.folder.iterdir()} == set(OTHERS)


@posix
def test_a_claim_is_on_the_disk_when_it_is_taken_and_so_is_a_run(journal, monkeypatch):
    flushed, flush = [], os.fsync

    def watched(descriptor):
        flushed.append(Path(f"/proc/self/fd/{descriptor}").readlink().name)
        flush(descriptor)

    monkeypatch.setattr(os, "fsync", watched)
    journal.claims.take(1, NEXT)
    assert flushed == ["shot_0001.claim.1", JOURNAL]
    flushed.clear()
    with run_at_work(journal.runs) as token:
        assert flushed == [f".run-{token}.tmp", JOURNAL]
    flushed.clear()
    finish(journal, 1)
    beside, folder = flushed
    assert (beside.split(".")[1], folder) == ("shot_0001", JOURNAL)
    flushed.clear()
    journal.agreed.agree_on("key", {"seconds": 1.0})
    assert flushed == ["found-key.json", JOURNAL]


# A run's own process


def test_a_run_lives_for_others_and_is_dead_when_it_is_killed(journal, start):
    process = start(AT_WORK, journal.folder)
    token = process.stdout.readline().decode().strip()
    assert journal.runs.lives(token)
    assert journal.claims.take(1, token) == 1
    assert journal.claims.take(1, NEXT) is None
    process.kill()
    process.wait()
    assert journal.claims.take(1, NEXT) == 2
    # What counts its number up finds that out too, and clears away.
    wait_until(lambda: not journal.runs.path(token).exists())


def test_a_run_that_is_over_leaves_nothing(tmp_path):
    runs = LiveRuns(tmp_path)
    with run_at_work(runs) as token:
        assert [path.name for path in tmp_path.iterdir()] == [f"run-{token}"]
    assert list(tmp_path.iterdir()) == []


def test_a_heart_beats_as_long_as_its_run_holds_on_to_it(tmp_path, start):
    path = tmp_path / "run-token"
    path.write_text(f"{{}}\n{0:0{BEAT_DIGITS}}")
    process = start(BEATING, path)
    wait_until(lambda: int(path.read_bytes()[-BEAT_DIGITS:]) > 3)
    assert path.read_bytes()[:3] == b"{}\n"
    assert path.stat().st_size == 3 + BEAT_DIGITS
    process.stdin.close()
    process.wait(SECONDS)
    assert (process.returncode, path.exists()) == (0, False)


def test_a_run_that_was_thought_dead_comes_back_as_settled_as_it_was(tmp_path, start):
    runs, path = LiveRuns(tmp_path), tmp_path / f"run-{FIRST}"
    path.write_text(f'{{"settled": 0}}\n{0:0{BEAT_DIGITS}}')
    start(BEATING, path)
    wait_until(lambda: int(path.read_bytes()[-BEAT_DIGITS:]) > 0)
    runs.mark_settled(FIRST)
    beat = int(path.read_bytes()[-BEAT_DIGITS:])
    wait_until(lambda: int(path.read_bytes()[-BEAT_DIGITS:]) > beat + 1)
    path.unlink()
    wait_until(lambda: path.exists() and path.stat().st_size > BEAT_DIGITS)
    assert path.read_bytes().startswith(b'{"settled": 1}\n')


# What a frame has found


def test_values_are_agreed_on_by_whoever_comes_first(journal):
    assert journal.agreed.read("key") is None
    assert journal.agreed.agree_on("key", {"seconds": 2.0}) == {"seconds": 2.0}
    assert journal.agreed.agree_on("key", {"seconds": 9.0}) == {"seconds": 2.0}
    assert journal.agreed.agree_on("other", {"seconds": 9.0}) == {"seconds": 9.0}


@pytest.mark.parametrize(
    "rubbish",
    [
        b"",
        b"{",
        b"[]",
        b'{"seconds": "long"}',
        b'{"seconds": NaN}',
        b"[" * 100_000,
        b'{"seconds": 1%s}' % (b"0" * 400),
        b"\xff",
        b'{"seconds": true}',
        b'{"seconds": "2"}',
        b'{"seconds": -1}',
        b'{"seconds": [2]}',
    ],
)
def test_values_that_cannot_be_read_are_agreed_on_anew(journal, monkeypatch, rubbish):
    monkeypatch.setattr(agreed_values, "READ_INTERVAL_SECONDS", 0.0)
    (journal.folder / "found-key.json").write_bytes(rubbish)
    assert journal.agreed.agree_on("key", {"seconds": 3.0}) == {"seconds": 3.0}
    assert journal.agreed.read("key") == {"seconds": 3.0}


@posix
@pytest.mark.parametrize("make", [make for make in STRANGE if make is not make_folder])
def test_whatever_else_is_called_as_what_was_found_is_replaced(journal, monkeypatch, make):
    monkeypatch.setattr(agreed_values, "READ_INTERVAL_SECONDS", 0.0)
    make(journal.folder / "found-key.json")
    assert journal.agreed.agree_on("key", {"seconds": 3.0}) == {"seconds": 3.0}
    assert journal.agreed.read("key") == {"seconds": 3.0}


# Movies of the frames


def make_movie(journal, place, content=b"moving", frames=(1, 2, 3, 9)):
    """A movie as an animation makes it: beside its place, and then there."""
    made = place.with_name(f"made-{place.name}")
    made.write_bytes(content)
    with journal.movies.noted(made, place, frames):
        made.replace(place)


def notes_of_movies(journal):
    return sorted(journal.folder.glob("movie-*.json"))


@posix
def test_movies_beside_a_folder_that_is_reached_by_a_link_stay_known(tmp_path):
    (tmp_path / "drive" / "deep").mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "drive" / "deep")
    journal = Journal(tmp_path / "link", "shot_")
    journal.place.make()
    left, right = tmp_path / "left.mp4", tmp_path / "right.mp4"
    make_movie(journal, left, b"left")
    make_movie(journal, right, b"right")
    assert journal.movies.read(left) is not None
    assert journal.movies.read(right) is not None


def test_a_movie_of_the_frames_is_known_wherever_it_lies_until_it_is_another(journal, tmp_path):
    movie = tmp_path / "film.mp4"
    movie.write_bytes(b"moving")
    assert journal.movies.read(movie) is None
    make_movie(journal, movie)
    assert journal.movies.read(movie).frames == {1, 2, 3, 9}
    assert journal.movies.read(movie.rename(tmp_path / "renamed.mp4")).frames == {1, 2, 3, 9}
    movie.write_bytes(b"others")
    assert journal.movies.read(movie) is None
    others = Journal(journal.frames_folder, "others_")
    assert others.movies.read(tmp_path / "renamed.mp4") is None, "of other frames in the same folder"
    (note,) = notes_of_movies(journal)
    note.write_bytes(b"[1]")
    assert journal.movies.read(tmp_path / "renamed.mp4") is None


def test_of_a_movie_of_an_earlier_version_the_frames_are_unknown(journal, tmp_path):
    movie = tmp_path / "film.mp4"
    make_movie(journal, movie)
    (note,) = notes_of_movies(journal)
    note.write_text(json.dumps({"of": journal.name, **checksum(movie)}))
    assert journal.movies.read(movie).frames is None
    make_movie(journal, tmp_path / "another.mp4", b"another")
    assert note in notes_of_movies(journal), "nobody knows where it was put"


@pytest.mark.parametrize("frames", [7, "", "all", None, "3-1"])
def test_a_movie_whose_frames_are_nonsense_is_unknown(journal, tmp_path, frames):
    movie = tmp_path / "film.mp4"
    make_movie(journal, movie)
    (note,) = notes_of_movies(journal)
    note.write_text(json.dumps({**json.loads(note.read_text()), "frames": frames}))
    assert journal.movies.read(movie) is None


def test_as_many_frames_as_a_movie_may_have_are_remembered(journal, tmp_path):
    frames = frozenset(number * (number + 1) // 2 for number in range(1447))
    frames |= {MAX_FRAME - number * 3 for number in range(9, 100_000)}
    make_movie(journal, tmp_path / "film.mp4", frames=frames)
    assert journal.movies.read(tmp_path / "film.mp4").frames == frames


@posix
@pytest.mark.parametrize("make", STRANGE)
def test_whatever_else_lies_in_a_movies_place_or_its_notes_is_unknown(journal, tmp_path, make):
    movie = tmp_path / "film.mp4"
    make_movie(journal, movie)
    (note,) = notes_of_movies(journal)
    note.unlink()
    make(note)
    assert journal.movies.read(movie) is None
    make_movie(journal, tmp_path / "another.mp4", b"another")
    assert os.path.lexists(note), "it is not ours to remove"
    if make is not make_huge_file:
        movie.unlink()
        make(movie)
        assert journal.movies.read(movie) is None


def test_a_movie_that_was_not_put_in_its_place_takes_nothing_from_the_one_that_is_there(journal, tmp_path):
    movie, following = tmp_path / "film.mp4", tmp_path / "made.mp4"
    make_movie(journal, movie)
    following.write_bytes(b"moving on")
    with pytest.raises(BadInputError), journal.movies.noted(following, movie, [1]):
        raise BadInputError("it cannot be replaced")
    assert journal.movies.read(movie).frames == {1, 2, 3, 9}


def test_of_movies_that_are_gone_or_were_replaced_no_note_is_left(journal, tmp_path):
    others = Journal(journal.frames_folder, "others_")
    kept, gone, replaced = (tmp_path / f"{name}.mp4" for name in ("kept", "gone", "replaced"))
    make_movie(others, tmp_path / "others.mp4", b"others")
    (tmp_path / "others.mp4").unlink()
    for movie in (kept, gone, replaced):
        make_movie(journal, movie, movie.name.encode())
    gone.unlink()
    for content in (b"once", b"more", b"again"):
        make_movie(journal, replaced, content, [4])
    assert len(notes_of_movies(journal)) == 3, "and one of others, that is theirs to remove"
    assert [journal.movies.read(movie).frames for movie in (kept, replaced)] == [{1, 2, 3, 9}, {4}]


def test_a_note_that_another_run_has_taken_for_outlived_is_there_in_the_end(journal, tmp_path):
    movie, made = tmp_path / "film.mp4", tmp_path / "made.mp4"
    made.write_bytes(b"moving")
    with journal.movies.noted(made, movie, [1, 2]):
        make_movie(journal, movie, b"theirs")
        assert len(notes_of_movies(journal)) == 1
        made.replace(movie)
    assert journal.movies.read(movie).frames == {1, 2}


# Names


def test_names_that_not_every_drive_can_have_are_told_apart(tmp_path):
    names = {Journal(tmp_path, name).name for name in ("左_", "右_", "__", "a b", "a_b")}
    assert len(names) == 5
    assert all(re.fullmatch(r"[A-Za-z0-9._-]*", name) for name in names)


def test_a_frame_under_another_name_is_missing(journal):
    """Another output path, or another suffix for a view."""
    name = next(iter(files_of_one(journal)))
    renamed = journal.frames_folder / f"other{name.suffix}"
    assert journal.state(1, [name], WANTED) is FrameState.WHOLE
    assert journal.state(1, [renamed], WANTED) is FrameState.MISSING


def files_of_one(journal):
    path = journal.frames_folder / "shot_0001.png"
    path.write_bytes(b"frame 1")
    record = Record(1, {path.name: checksum(path)}, WANTED.settings, WANTED.scene, "run", {})
    journal.records.write(record)
    return [path]
