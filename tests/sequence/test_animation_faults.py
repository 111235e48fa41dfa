"""An animation survives what may happen to the processes that render it, to its files and to its journal.

The processes are real ones and really killed; only what renders is a stand-in (`stub_animation.py`).
"""

import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import pytest

from stereo_reproject.sequence.checksums import checksum
from stereo_reproject.sequence.journal import Journal
from stereo_reproject.sequence.journal_folder import JOURNAL
from tests.sequence.stub_animation import NAME, content, names

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
STUB = Path(__file__).with_name("stub_animation.py")
SECONDS = 60.0
"""Far more than any of these runs takes."""

PROMPTLY = 20.0
"""Seconds; a run of another machine is given `runs.STALE_SECONDS`, which are more."""

STALE = 4.0
"""Seconds; in these tests two beats of a run, which come every `runs.BEAT_SECONDS`."""

posix = pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")


@pytest.fixture(autouse=True)
def none_is_left():
    yield
    for process in Process.started:
        process.kill()
    Process.started.clear()


class Process:
    """One that renders; its words are read as it says them."""

    started: ClassVar[list["Process"]] = []

    def __init__(self, folder, last, *options, log=None):
        logged = [] if log is None else ["--log", str(log)]
        self.process = subprocess.Popen(
            [sys.executable, str(STUB), str(folder), str(last), *logged, *map(str, options)],
            env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "error"},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.started.append(self)

    def until(self, *words):
        """Read up to the line that begins with these words."""
        wanted = " ".join(map(str, words))
        for line in self.process.stdout:
            if f"{line} ".startswith(f"{wanted}\n") or line.startswith(f"{wanted} "):
                return line
        raise AssertionError(f"it ended before it said {wanted!r}: {self.process.stderr.read()}")

    def heartbeat(self):
        """The number of the process that tells of its life."""
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children")
        (child,) = children.read_text().split()
        return int(child)

    def cut_power(self):
        """End it as a machine ends: with all that it has started, and nothing is cleared away."""
        heartbeat = self.heartbeat()
        self.process.send_signal(signal.SIGSTOP)
        os.kill(heartbeat, signal.SIGKILL)
        self.kill()

    def kill(self):
        with self.process:
            self.process.kill()

    def end(self):
        """Its exit status, and what it said."""
        out, err = self.process.communicate(timeout=SECONDS)
        return Ended(self.process.returncode, out.splitlines(), err)


@dataclass(frozen=True)
class Ended:
    status: int
    lines: list[str]
    err: str

    @property
    def rendered(self):
        return [int(line.split()[1]) for line in self.lines if line.startswith("renders ")]


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "frames"


@dataclass(frozen=True)
class SmallDisk:
    """A folder on a disk that some frames fit on, until it grows; options are what a run on it needs."""

    folder: Path
    options: tuple[str, ...]
    mounted: Path | None

    def grow(self):
        if self.mounted is not None:
            subprocess.run(["mount", "-o", "remount,size=16m", str(self.mounted)], check=True)


@pytest.fixture
def small_disk(tmp_path):
    """A real one where this process may mount it; elsewhere one that is full from a certain flush on."""
    place = tmp_path / "disk"
    place.mkdir()
    mounted = False
    with contextlib.suppress(OSError):
        mount = ["mount", "-t", "tmpfs", "-o", "size=512k", "none", str(place)]
        mounted = subprocess.run(mount, capture_output=True, check=False).returncode == 0
    if not mounted:
        yield SmallDisk(place / "frames", ("--full-at", "52"), None)
        return
    try:
        yield SmallDisk(place / "frames", (), place)
    finally:
        # Whoever was killed may take a moment to let go of it.
        subprocess.run(["umount", "--lazy", str(place)], check=True)


def run(folder, last, *options, status=0):
    ended = Process(folder, last, *options).end()
    assert ended.status == status, ended.err
    return ended


def resume(folder, last, *options):
    return run(folder, last, "--existing", "resume", *options)


def assert_whole(folder, last, *, signature="", without=()):
    """All frames are there, as an uninterrupted run makes them, with their records, and nothing else is."""
    frames = [frame for frame in range(1, last + 1) if frame not in without]
    expected = {name: content(name, signature) for frame in frames for name in names(frame)}
    assert {path.name for path in folder.iterdir()} == {JOURNAL, *expected}
    assert {path.name for path in (folder / JOURNAL).iterdir()} == {f"{NAME}{frame:04d}.json" for frame in frames}
    for name, data in expected.items():
        assert (folder / name).read_bytes() == data
    for record in Journal(folder, NAME).records.read_all():
        assert dict(record.files) == {name: checksum(folder / name) for name in names(record.frame)}


def logged(log):
    return [int(line) for line in log.read_text().splitlines()] if log.exists() else []


def wait_for(condition):
    """For what another process is about to do by itself."""
    deadline = time.monotonic() + SECONDS
    while not condition():
        assert time.monotonic() < deadline
        os.sched_yield()


# Killed


@posix
def test_killed_at_30_random_moments_nothing_is_lost_and_nothing_rendered_without_need(folder, tmp_path):
    moments, last = random.Random(5), 200
    sessions = []
    while len(sessions) < 30:
        log = tmp_path / f"log-{len(sessions)}"
        process = Process(folder, last, "--existing", "resume", "--seconds", 0.01, log=log)
        if moments.random() < 0.8:
            process.until("plan")
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.process.wait(moments.uniform(0.0, 0.12))
        if moments.random() < 0.3:
            with contextlib.suppress(ValueError):
                process.cut_power()
        process.kill()
        sessions.append(logged(log))
    assert len(set().union(*sessions)) < last, "the kills came too late"
    sessions.append(resume(folder, last, "--seconds", 0.0).rendered)
    assert_whole(folder, last)
    assert set().union(*sessions) == set(range(1, last + 1))
    for number, session in enumerate(sessions[:-1]):
        later = {frame for rendered in sessions[number + 1 :] for frame in rendered}
        # Only the frame that a kill has hit is rendered again.
        assert later.isdisjoint(session[:-1])
    assert resume(folder, last).rendered == []


def test_an_ended_run_leaves_its_frames_alone(folder):
    run(folder, 4)
    before = {path: path.stat().st_mtime_ns for path in folder.iterdir() if path.is_file()}
    assert resume(folder, 4).rendered == []
    assert "--resume" in run(folder, 4, status=2).err
    assert {path: path.stat().st_mtime_ns for path in folder.iterdir() if path.is_file()} == before
    assert_whole(folder, 4)


def test_a_frame_that_cannot_be_rendered_is_passed_over(folder):
    ended = run(folder, 5, "--throws-at", 2)
    assert [line for line in ended.lines if line.startswith("failed")] == ["failed 2 the renderer cannot"]
    assert_whole(folder, 5, without=(2,))
    assert resume(folder, 5).rendered == [2]
    assert_whole(folder, 5)


# Several at once


@pytest.mark.parametrize("count", [2, 4])
@pytest.mark.parametrize("existing", ["refuse", "resume", "overwrite"])
def test_started_at_once_they_render_each_frame_once(folder, count, existing):
    processes = [Process(folder, 40, "--existing", existing, "--seconds", 0.02) for _ in range(count)]
    ended = [process.end() for process in processes]
    assert [one.status for one in ended] == [0] * count, [one.err for one in ended]
    rendered = Counter(frame for one in ended for frame in one.rendered)
    assert rendered == dict.fromkeys(range(1, 41), 1)
    assert_whole(folder, 40)


def of_others(signature, kind="settings"):
    return f"--{kind}", signature, "--signature", signature


@pytest.mark.parametrize(("existing", "kind"), [("refuse", "settings"), ("resume", "settings"), ("overwrite", "scene")])
def test_one_that_begins_before_the_first_frame_of_another_scene_is_there_leaves_the_folder_to_it(
    folder, existing, kind
):
    earlier = Process(folder, 30, "--seconds", 0.2)
    earlier.until("renders", 1)
    later = Process(folder, 30, "--existing", existing, *of_others("later", kind)).end()
    assert (later.status, later.rendered) == (2, []), later
    differs = "of another scene (meshes)" if kind == "scene" else "of other settings"
    assert later.err.startswith(f"{folder}: another run renders frames 1-30 there, {differs}: another folder")
    assert earlier.end().status == 0
    assert_whole(folder, 30)


def test_started_at_once_by_different_settings_one_goes_on_and_nothing_is_mixed(folder):
    signatures = ("one", "other")
    processes = {
        name: Process(folder, 30, "--existing", "resume", "--seconds", 0.2, *of_others(name)) for name in signatures
    }
    ended = {name: process.end() for name, process in processes.items()}
    statuses = {name: one.status for name, one in ended.items()}
    assert sorted(statuses.values()) == [0, 2], ended
    for name in signatures:
        if statuses[name] == 0:
            assert_whole(folder, 30, signature=name)
        else:
            assert ended[name].rendered == []


def test_different_settings_of_different_frames_do_not_meet(folder):
    slow = Process(folder, 2, "--seconds", 1)
    slow.until("renders", 1)
    assert run(folder, 4, "--first", 3, *of_others("others")).rendered == [3, 4]
    assert slow.end().status == 0


def test_several_render_again_what_is_of_other_settings(folder):
    run(folder, 20)
    new = of_others("new")
    ended = [Process(folder, 20, "--existing", "resume", "--seconds", 0.02, *new) for _ in range(2)]
    ended = [process.end() for process in ended]
    assert [one.status for one in ended] == [0, 0], ended
    assert Counter(frame for one in ended for frame in one.rendered) == dict.fromkeys(range(1, 21), 1)
    assert_whole(folder, 20, signature="new")


def test_after_one_that_was_killed_others_settings_go_on_at_once(folder):
    killed = Process(folder, 4, "--seconds", 0.2)
    killed.until("done", 1)
    killed.kill()
    start = time.monotonic()
    assert run(folder, 4, "--existing", "resume", *of_others("new")).rendered == [1, 2, 3, 4]
    assert time.monotonic() - start < PROMPTLY
    assert_whole(folder, 4, signature="new")


@posix
@pytest.mark.parametrize("ending", ["kill", "cut_power"])
def test_the_frame_of_one_that_was_killed_is_taken_over_at_once_on_this_machine(folder, ending):
    killed = Process(folder, 12, "--seconds", 0.05)
    killed.until("renders", 3)
    other = Process(folder, 12, "--existing", "resume", "--seconds", 0.05)
    other.until("renders")
    getattr(killed, ending)()
    start = time.monotonic()
    assert other.end().status == 0
    assert time.monotonic() - start < PROMPTLY
    assert_whole(folder, 12)


@posix
def test_the_frame_of_one_that_died_on_another_machine_is_taken_over_after_a_while(folder):
    killed = Process(folder, 4, "--seconds", SECONDS, "--machine", "one")
    killed.until("renders", 1)
    other = Process(folder, 4, "--existing", "resume", "--machine", "two", "--stale", STALE)
    other.until("waits", 1)
    killed.cut_power()
    died = time.monotonic()
    other.until("renders", 1)
    assert time.monotonic() - died > STALE - 2.5, "it was not dead for long enough"
    assert other.end().status == 0
    # Its private folder is for its own machine to remove.
    assert run(folder, 4, "--existing", "resume", "--machine", "one").rendered == []
    assert_whole(folder, 4)


@posix
def test_one_that_lives_on_another_machine_keeps_its_frame_however_long_it_takes(folder):
    slow = Process(folder, 2, "--seconds", 1.8 * STALE, "--machine", "one")
    slow.until("renders", 1)
    other = Process(folder, 1, "--existing", "resume", "--machine", "two", "--stale", STALE)
    other.until("waits", 1)
    slow.until("done", 1)
    assert other.end().rendered == []
    slow.kill()


@posix
def test_one_that_wakes_up_after_it_was_thought_dead_does_no_damage(folder):
    sleeper = Process(folder, 3, "--stops-at", 1, "--signature", "sleeper")
    sleeper.until("renders", 1)
    heartbeat = sleeper.heartbeat()
    os.kill(heartbeat, signal.SIGSTOP)
    other = Process(folder, 3, "--existing", "resume", "--signature", "other", "--stale", STALE)
    assert sorted(other.end().rendered) == [1, 2, 3]
    before = {path: path.read_bytes() for path in folder.glob("*.png")}
    os.kill(heartbeat, signal.SIGCONT)
    sleeper.process.send_signal(signal.SIGCONT)
    woken = sleeper.end()
    assert (woken.status, woken.rendered) == (0, []), woken
    assert {path: path.read_bytes() for path in before} == before
    assert_whole(folder, 3, signature="other")


@posix
def test_one_that_wakes_up_while_its_frame_is_rendered_by_another_waits_for_it(folder):
    sleeper = Process(folder, 1, "--stops-at", 1, "--signature", "sleeper")
    sleeper.until("renders", 1)
    heartbeat = sleeper.heartbeat()
    os.kill(heartbeat, signal.SIGSTOP)
    other = Process(folder, 1, "--existing", "resume", "--signature", "other", "--stale", STALE, "--seconds", 3)
    other.until("renders", 1)
    os.kill(heartbeat, signal.SIGCONT)
    sleeper.process.send_signal(signal.SIGCONT)
    sleeper.until("waits", 1)
    assert other.end().status == 0
    assert sleeper.end().rendered == []
    assert_whole(folder, 1, signature="other")


# The journal and the files


def rubbish(size, seed=9):
    return random.Random(seed).randbytes(size)


def cut_in_half(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def replaced(path):
    path.write_bytes(rubbish(path.stat().st_size))


def other_json(path):
    path.write_text('{"frame": 3, "files": {"shot_0003_L.png": {"bytes": 1e999, "sha256": []}}, "scene": [[[]]]}')


def deep_json(path):
    path.write_text("[" * 100_000)


@pytest.mark.parametrize("damage", [cut_in_half, replaced, other_json, deep_json, Path.unlink])
def test_a_damaged_record_costs_its_frame_alone(folder, damage):
    run(folder, 5)
    damage(folder / JOURNAL / f"{NAME}0003.json")
    assert "1 of 5" not in (refused := run(folder, 5, status=2).err)
    assert "5 of 5 frames are there already" in refused
    assert resume(folder, 5).rendered == [3]
    assert_whole(folder, 5)


def test_without_the_journal_all_is_rendered_again_in_its_place(folder):
    run(folder, 5)
    shutil.rmtree(folder / JOURNAL)
    assert "5 of 5 frames are there already" in run(folder, 5, status=2).err
    assert resume(folder, 5).rendered == [1, 2, 3, 4, 5]
    assert_whole(folder, 5)


def empty(path):
    path.write_bytes(b"")


@pytest.mark.parametrize("damage", [replaced, cut_in_half, empty, Path.unlink])
def test_a_damaged_file_costs_its_frame_alone(folder, damage):
    run(folder, 5)
    damage(folder / names(4)[1])
    assert resume(folder, 5).rendered == [4]
    assert_whole(folder, 5)


def test_what_dead_runs_have_left_is_cleared_away(folder):
    run(folder, 3)
    journal = folder / JOURNAL
    (journal / "run-0123456789abcdef").write_text('{"machine": "?"')
    for name in ("0002.claim.1", "0002.claim.7", "0009.claim.1"):
        (journal / f"{NAME}{name}").write_text("fedcba9876543210")
    (journal / f".{NAME}0003.json.0123456789abcdef.tmp").write_text('{"frame"')
    (folder / names(2)[0]).unlink()
    # Nobody can tell by its file whether that run lives, so that it is watched for a while.
    assert resume(folder, 3, "--stale", 0.0).rendered == [2]
    assert_whole(folder, 3)


@posix
def test_what_others_have_put_there_holds_nobody_up(folder):
    run(folder, 4)
    journal = folder / JOURNAL
    for path in (folder / names(2)[0], journal / f"{NAME}0003.json"):
        path.unlink()
        path.symlink_to("/dev/zero")
    abandoned = folder / ".stereo_reproject-x"
    abandoned.mkdir()
    strange = [journal / "run-0123456789abcdef", journal / f"{NAME}0002.claim.1", abandoned / "pid"]
    for path in strange:
        os.mkfifo(path)
    (journal / f"{NAME}0003.claim.1").write_bytes(b"\0" * 5000)
    shutil.copy(journal / f"{NAME}0001.json", journal / f"{NAME}00001.json")
    assert resume(folder, 4).rendered == [2, 3]
    assert all(path.is_fifo() for path in strange)
    for path in (*strange, journal / f"{NAME}00001.json"):
        path.unlink()
    abandoned.rmdir()
    assert_whole(folder, 4)


@posix
def test_a_journal_that_is_a_link_is_refused_and_nothing_removed_where_it_leads(folder, tmp_path):
    outside = tmp_path / "outside"
    outside.mkdir()
    folder.mkdir()
    (folder / JOURNAL).symlink_to(outside, target_is_directory=True)
    for name in ("0001.claim.1", ".0001.json.0123456789abcdef.tmp", "notes.claim.1"):
        (outside / name).write_text("mine")
    assert run(folder, 2, status=2).err.startswith(f"{folder / JOURNAL} is a link to another folder")
    assert len(list(outside.iterdir())) == 3


def test_what_a_living_run_has_is_not_cleared_away(folder):
    slow = Process(folder, 2, "--seconds", SECONDS)
    slow.until("renders", 1)
    (folder / JOURNAL / ".unfinished.json.0123456789abcdef.tmp").write_text("{")
    before = {path.name for path in (folder / JOURNAL).iterdir()}
    assert len(before) == 3
    run(folder, 0, "--existing", "resume")
    assert {path.name for path in (folder / JOURNAL).iterdir()} == before
    slow.kill()


@posix
def test_a_run_that_is_killed_leaves_no_claims(folder):
    killed = Process(folder, 2, "--seconds", SECONDS)
    killed.until("renders", 1)
    killed.kill()
    wait_for(lambda: list((folder / JOURNAL).iterdir()) == [])


# Clocks


@pytest.mark.parametrize("offset", [-86400.0, 86400.0])
def test_clocks_do_not_matter(folder, offset):
    run(folder, 3)
    for path in folder.rglob("*"):
        os.utime(path, (time.time() + 1e6, time.time() + 1e6))
    assert resume(folder, 3, "--clock", offset).rendered == []
    (folder / names(2)[0]).unlink()
    both = [Process(folder, 20, "--existing", "resume", "--seconds", 0.02, "--clock", at) for at in (0.0, offset)]
    ended = [process.end() for process in both]
    assert [one.status for one in ended] == [0, 0], ended
    assert Counter(frame for one in ended for frame in one.rendered) == dict.fromkeys((2, *range(4, 21)), 1)
    assert_whole(folder, 20)


# Drives


def test_a_folder_that_goes_away_is_said(folder):
    process = Process(folder, 100, "--seconds", 0.05)
    process.until("renders", 2)
    wait_for(lambda: gone(folder))
    ended = process.end()
    assert ended.status == 2
    assert ended.err == f"{folder} is gone, with the frames that were in it\n"
    assert not folder.exists()


def gone(folder):
    # Whoever is writing into it may be quicker once.
    shutil.rmtree(folder, ignore_errors=True)
    return not folder.exists()


FULL = "the disk is full; free some space: finished frames are kept, and --resume renders the rest"
FULL_AT_ONCE = "the disk is full; free some space or choose another folder"
FIRST_FLUSHES = 4
"""Of the first run: the folder's name, the journal's, its own file, and that one's folder."""
FLUSHES = 7
"""Of each frame: its claim and the folder of that, its two files and theirs, and at last its record and its folder."""


@pytest.mark.parametrize("flush", range(1, FIRST_FLUSHES + FLUSHES + 4))
def test_a_disk_that_is_full_from_any_moment_on_is_said_and_nothing_is_lost(folder, flush):
    told = FULL_AT_ONCE if flush == 1 else FULL
    assert run(folder, 5, "--full-at", flush, status=2).err == f"{folder}: {told}\n"
    there = [record.frame for record in Journal(folder, NAME).records.read_all()]
    assert len(there) == max(flush - FIRST_FLUSHES, 0) // FLUSHES
    assert resume(folder, 5).rendered == [frame for frame in range(1, 6) if frame not in there]
    assert_whole(folder, 5)


@posix
def test_a_small_disk(folder, small_disk):
    ended = run(small_disk.folder, 40, *small_disk.options, status=2)
    assert ended.err == f"{small_disk.folder}: {FULL}\n"
    finished = [record.frame for record in Journal(small_disk.folder, NAME).records.read_all()]
    assert 1 < len(finished) < 40
    small_disk.grow()
    assert resume(small_disk.folder, 40).rendered == [frame for frame in range(1, 41) if frame not in finished]
    assert_whole(small_disk.folder, 40)
