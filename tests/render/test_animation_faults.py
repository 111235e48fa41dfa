"""The real command, killed, starved of its folder and its disk, and several times at once: what was whole stays, and
what comes of it in the end is what an uninterrupted run makes, byte for byte."""

import contextlib
import json
import os
import random
import shutil
import signal
import statistics
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import bpy
import pytest

from stereo_reproject.jobs.work_folder import WORK_PREFIX
from stereo_reproject.sequence.journal_folder import JOURNAL
from tests.render import processes
from tests.render.processes import children, wait_for
from tests.render.test_command_line import DEMO, environment, workers_of

pytestmark = pytest.mark.slow

SECONDS = 120.0
"""Far more than any of these runs takes."""

FRAMES = 12
OPTIONS = ["--size", "64x36", "--samples", "1", "--no-denoise", "--fill", "packed"]

MEMORY_GROWTH = 1.05
"""Of the last 20 of 200 frames over the 20 after the first 10, in which what is made once is made. What one frame's
buffers leave behind is a few per cent more or less each time."""

PANORAMIC = 3

posix = pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")


def open_demo():
    bpy.ops.wm.open_mainfile(filepath=str(DEMO), load_ui=False)
    scene = bpy.context.scene
    # Two marks in Blender's files that are of the clock, and the only ones.
    scene.render.use_stamp_date = scene.render.use_stamp_render_time = False
    return scene


@pytest.fixture(scope="module")
def blend(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "demo.blend"
    open_demo()
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)
    return path


@pytest.fixture(scope="module")
def expected(blend, tmp_path_factory):
    """The frames' files as an uninterrupted run makes them."""
    folder = tmp_path_factory.mktemp("whole") / "frames"
    assert animate(blend, folder, f"1-{FRAMES}").status == 0
    return pictures(folder)


def pictures(folder):
    return {path.name: path.read_bytes() for path in folder.glob("[0-9]*.png")}


def start(blend, folder, frames, *options, **variables):
    return processes.start("animate", blend, folder, "--frames", frames, *OPTIONS, *options, **variables)


def end(process, folder):
    return processes.end(process, folder, SECONDS)


def animate(blend, folder, frames, *options):
    return end(start(blend, folder, frames, *options), folder)


def finished_frames(folder):
    return {path.stem for path in (folder / JOURNAL).glob("[0-9]*.json")}


def is_rendering_after(folder, count):
    """Whether one of the two frames after so many is on its way: the writer may be a frame behind."""
    return any(any((folder / JOURNAL).glob(f"{count + ahead:04d}.claim.*")) for ahead in (1, 2))


def assert_whole(folder, expected):
    assert pictures(folder) == expected
    assert {path.name for path in folder.iterdir()} - set(expected) <= {
        JOURNAL,
        "animation.json",
        "animation.png",
        "animation.svg",
    }
    assert not [path for path in (folder / JOURNAL).iterdir() if path.suffix != ".json" or path.name.startswith(".")]
    assert len(finished_frames(folder)) == len(expected) // 2
    assert workers_of(folder) == []


def kill(process, victim):
    """One of the two, or both; what becomes of whoever is left is its own affair."""
    with contextlib.suppress(OSError, ValueError):
        (worker,) = children(process.pid)
        for pid in {"supervisor": [process.pid], "worker": [worker], "both": [process.pid, worker]}[victim]:
            os.kill(pid, signal.SIGKILL)


@posix
def test_killed_at_random_moments_and_resumed_it_comes_to_the_same(blend, expected, tmp_path):
    folder, moments = tmp_path / "frames", random.Random(8)
    kills = 0
    for victim, last in (("supervisor", 3), ("both", 5), ("supervisor", 7), ("both", 9)):
        before = finished_frames(folder)
        process = start(blend, folder, f"1-{FRAMES}", "--resume")
        wait_for(
            process,
            lambda last=last, process=process: len(finished_frames(folder)) >= last or process.poll() is not None,
        )
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(moments.uniform(0.0, 0.15))
        kills += process.poll() is None
        kill(process, victim)
        process.communicate(timeout=SECONDS)
        assert before <= finished_frames(folder)
    assert kills >= 2, "the kills came too late"
    records = {path: path.read_bytes() for path in (folder / JOURNAL).glob("[0-9]*.json")}
    resumed = animate(blend, folder, f"1-{FRAMES}", "--resume")
    assert (resumed.status, resumed.err) == (0, ""), resumed
    assert_whole(folder, expected)
    assert {path: path.read_bytes() for path in records} == records


@posix
def test_without_its_worker_it_goes_on_with_the_other_frames(blend, expected, tmp_path):
    folder = tmp_path / "frames"
    process = start(blend, folder, f"1-{FRAMES}")
    wait_for(process, lambda: finished_frames(folder) and is_rendering_after(folder, len(finished_frames(folder))))
    kill(process, "worker")
    ended = end(process, folder)
    assert "Traceback" not in ended.err
    if ended.status == 0:
        # It was between two frames, neither of which is to blame.
        assert "Blender is started again: Blender was killed by signal 9 (SIGKILL)" in ended.err
        assert_whole(folder, expected)
        return
    assert ended.status == 1
    assert "is left out: Blender was killed by signal 9 (SIGKILL)" in ended.err
    assert f"1 of {FRAMES} frames failed" in ended.err.splitlines()[-1]
    assert len(finished_frames(folder)) == FRAMES - 1
    assert animate(blend, folder, f"1-{FRAMES}", "--resume").status == 0
    assert_whole(folder, expected)


@posix
def test_without_its_writer_it_goes_on_with_the_other_frames(blend, expected, tmp_path):
    folder = tmp_path / "frames"
    process = start(blend, folder, f"1-{FRAMES}")
    wait_for(process, lambda: finished_frames(folder))
    (worker,) = children(process.pid)
    writer = next(pid for pid in children(worker) if b"stereo_reproject.programs.writer" in command_line(pid))
    os.kill(writer, signal.SIGKILL)
    ended = end(process, folder)
    assert ended.status in (0, 1), ended
    assert len(finished_frames(folder)) >= FRAMES - 1
    assert animate(blend, folder, f"1-{FRAMES}", "--resume").status == 0
    assert_whole(folder, expected)


def command_line(pid):
    return Path(f"/proc/{pid}/cmdline").read_bytes()


@posix
def test_interrupted_it_leaves_what_is_finished_and_nothing_else(blend, expected, tmp_path):
    folder = tmp_path / "frames"
    process = start(blend, folder, f"1-{FRAMES}")
    wait_for(process, lambda: len(finished_frames(folder)) >= 2)
    process.send_signal(signal.SIGINT)
    ended = end(process, folder)
    assert (ended.status, ended.err.splitlines()[-1]) == (
        130,
        "stereo_reproject: interrupted; finished frames are kept, and --resume renders the rest",
    )
    there = pictures(folder)
    for frame in finished_frames(folder):
        for view in "LR":
            assert there[f"{frame}_{view}.png"] == expected[f"{frame}_{view}.png"]
    assert not [path for path in folder.iterdir() if path.name.startswith(WORK_PREFIX)]
    assert animate(blend, folder, f"1-{FRAMES}", "--resume").status == 0
    assert_whole(folder, expected)


def test_a_frame_that_cannot_be_rendered_is_left_out(expected, tmp_path):
    scene = open_demo()
    data = scene.camera.data.copy()
    data.type, data.panorama_type = "PANO", "MIRRORBALL"
    panoramic = bpy.data.objects.new("Panoramic", data)
    scene.collection.objects.link(panoramic)
    for frame, camera in ((1, scene.camera), (PANORAMIC, panoramic), (PANORAMIC + 1, scene.camera)):
        scene.timeline_markers.new(f"from {frame}", frame=frame).camera = camera
    blend, folder = tmp_path / "demo.blend", tmp_path / "frames"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend), compress=False)
    ended = animate(blend, folder, "1-5")
    assert ended.status == 1
    assert f"1 of 5 frames failed ({PANORAMIC})" in ended.err.splitlines()[-1]
    assert sorted(pictures(folder)) == sorted(f"{frame:04d}_{view}.png" for frame in (1, 2, 4, 5) for view in "LR")
    report = json.loads((folder / "animation.json").read_text())
    assert list(report["failed"]) == [str(PANORAMIC)]


def test_a_folder_that_goes_away_is_said(blend, tmp_path):
    folder = tmp_path / "frames"
    process = start(blend, folder, "1-500")
    wait_for(process, lambda: len(finished_frames(folder)) >= 2)
    moved = folder.rename(tmp_path / "elsewhere")
    ended = end(process, folder)
    shutil.rmtree(folder, ignore_errors=True)
    assert (ended.status, ended.err.splitlines()[-1]) == (
        2,
        f"stereo_reproject: error: {folder} is gone, with the frames that were in it",
    )
    assert "Traceback" not in ended.err
    assert workers_of(folder) == []
    assert len(finished_frames(moved)) >= 2


def test_two_at_once_render_each_frame_once(blend, expected, tmp_path):
    folder = tmp_path / "frames"
    both = [start(blend, folder, f"1-{FRAMES}", "--resume") for _ in range(2)]
    ended = [end(process, folder) for process in both]
    assert [one.status for one in ended] == [0, 0], ended
    assert_whole(folder, expected)


@dataclass(frozen=True)
class SmallDisk:
    """A folder on a disk that is soon full; environment is what a command needs to find it so."""

    folder: Path
    environment: dict[str, str]


@pytest.fixture
def small_disk(tmp_path):
    """A real one where this process may mount it; elsewhere one that each process finds full at its ninth flush."""
    place = tmp_path / "disk"
    place.mkdir()
    mounted = False
    with contextlib.suppress(OSError):
        mount = ["mount", "-t", "tmpfs", "-o", "size=1200k", "none", str(place)]
        mounted = subprocess.run(mount, capture_output=True, check=False).returncode == 0
    if not mounted:
        yield SmallDisk(place / "frames", {"PYTHONPATH": full_at(9, tmp_path / "full")})
        return
    try:
        yield SmallDisk(place / "frames", {})
    finally:
        # Whoever was killed may take a moment to let go of it.
        subprocess.run(["umount", "--lazy", str(place)], check=True)


def full_at(number, folder):
    """Folders in which each Python that is started finds how it is to find the disk full."""
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(
        "import errno, itertools, os\n"
        "flushes, real = itertools.count(1), os.fsync\n"
        "def fsync(descriptor):\n"
        f"    if next(flushes) >= {number}:\n"
        "        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))\n"
        "    real(descriptor)\n"
        "os.fsync = fsync\n"
    )
    return os.pathsep.join([str(folder), environment()["PYTHONPATH"]])


@posix
def test_a_full_disk_is_said(blend, expected, small_disk, tmp_path):
    folder = small_disk.folder
    ended = end(start(blend, folder, "1-500", **small_disk.environment), folder)
    assert (ended.status, len(ended.err.splitlines())) == (2, 1), ended
    assert "the disk is full; free some space: finished frames are kept, and --resume renders the rest" in ended.err
    assert "Traceback" not in ended.err
    assert not [path for path in folder.iterdir() if path.name.startswith(WORK_PREFIX)]
    finished = sorted(finished_frames(folder))
    assert finished
    for name in (f"{frame}_{view}.png" for frame in finished for view in "LR"):
        assert name not in expected or (folder / name).read_bytes() == expected[name]
    roomy = tmp_path / "roomy"
    shutil.copytree(folder, roomy)
    wanted = max(FRAMES, len(finished))
    assert animate(blend, roomy, f"1-{wanted}", "--resume").status == 0
    assert expected.items() <= pictures(roomy).items()


def resident(folder):
    """Megabytes that were held when a frame was finished, by its number."""
    records = [json.loads(path.read_text()) for path in (folder / JOURNAL).glob("[0-9]*.json")]
    return {record["frame"]: record["figures"]["memory"]["resident_mb"] for record in records}


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="what a process holds is only told there")
def test_memory_does_not_grow_over_200_frames(tmp_path):
    folder = tmp_path / "frames"
    options = ["--frames", "1-200", "--size", "64x36", "--samples", "1", "--quiet"]
    arguments = [sys.executable, "-m", "stereo_reproject", "animate", str(DEMO), "--output", str(folder), *options]
    subprocess.run(arguments, env=environment(), check=True, timeout=4 * SECONDS, stdin=subprocess.DEVNULL)
    held = resident(folder)
    assert len(held) == 200
    early, late = ([held[frame] for frame in frames] for frames in (range(11, 31), range(181, 201)))
    assert statistics.median(late) <= MEMORY_GROWTH * statistics.median(early)
    assert max(late) <= MEMORY_GROWTH * max(early)
