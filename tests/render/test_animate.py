"""`animate` as a user types it: what is there afterwards, what a second run makes of it, and what a crash costs."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import OpenEXR
import pytest

from stereo_reproject.blender.output.pictures import read_png
from stereo_reproject.blender.scene.working import open_blend
from stereo_reproject.sequence.journal_folder import JOURNAL
from tests.delivery.movies import frames as movie_frames
from tests.delivery.movies import stereo

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
DEMO = ROOT / "demo" / "cornell-box" / "cornell-box.blend"

SIZE = (64, 36)
# What is measured may make another choice each time: auto fills as it finds cheapest.
REPEATABLE = ["--seed", "5", "--fill", "packed"]
SMALL = ["--size", "64x36", "--samples", "1", "--no-denoise", "--accuracy", "draft", *REPEATABLE]
STEREO = ["--interocular", "0.2", "--convergence", "6.9"]
LAYOUT = ["--layout", "side-by-side-half"]
WHOLE = ["--frames", "1-3"]

SECONDS = 120.0
"""Far more than any of these runs takes."""

posix = pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")

# The real entry point, whose worker is watched.
DRIVER = """
import sys
from stereo_reproject.jobs import worker_process
from stereo_reproject import __main__
watching = sys.argv.pop(1)
worker_process.own_worker = lambda: [sys.executable, "-c", watching]
sys.exit(__main__.run())
"""

WATCHING = """
import os, signal, time
from pathlib import Path
from stereo_reproject.programs import worker
from stereo_reproject.blender.commands import frame_maker
from stereo_reproject.sequence.journal_folder import JOURNAL

render = frame_maker.BlenderFrameMaker.render
folder = Path(os.environ["NOTES"])

def watched(self, frame, claim):
    (folder / f"{frame} {os.getpid()}").touch()
    meanwhile(self, frame)
    render(self, frame, claim)

frame_maker.BlenderFrameMaker.render = watched
"""

# Neither renders before the other has a frame as well.
TOGETHER = """
def meanwhile(_, frame):
    while len({path.name.split()[1] for path in folder.iterdir()}) < 2:
        time.sleep(0.01)

worker.main()
"""

# Renders nothing before it may.
HELD_BACK = """
def meanwhile(_, frame):
    while not (folder.parent / "go").exists():
        time.sleep(0.01)

worker.main()
"""

CRASHING = """
def meanwhile(maker, frame):
    tell = maker._on_stage

    def dies(stage, where):
        tell(stage, where)
        if frame == 3:
            os.kill(os.getpid(), signal.SIGKILL)

    maker._on_stage = dies

worker.main()
"""


@dataclass(frozen=True)
class Run:
    status: int
    out: str
    err: str
    folder: Path

    @property
    def rendered(self):
        """The frames that are told of, in order."""
        return [int(number) for number in re.findall(r"^frame (\d+)  ", self.out, re.MULTILINE)]

    @property
    def files(self):
        return files_in(self.folder)

    @property
    def report(self):
        return json.loads((self.folder / "animation.json").read_text(encoding="utf-8"))


def files_in(folder):
    """All but charts, which need matplotlib, and what frames have cost, whose name is a checksum."""
    names = (path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    return sorted(
        name
        for name in names
        if not re.fullmatch(rf"animation\.(png|svg)|{re.escape(JOURNAL)}/(found|movie)-[\w-]+\.json", name)
    )


def contents(folder):
    return {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in folder.rglob("*") if path.is_file()}


def command(scene, folder, *options):
    return ["animate", str(scene), "--output", str(folder), *SMALL, *STEREO, *LAYOUT, *map(str, options)]


def environment(**more):
    return {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "error", **more}


def animate(folder, *options, scene=DEMO):
    finished = subprocess.run(
        [sys.executable, "-m", "stereo_reproject", *command(scene, folder, *options)],
        env=environment(),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    return Run(finished.returncode, finished.stdout, finished.stderr, folder)


def watch(code, notes, folder, *options):
    """A run whose worker notes the frames that it begins with."""
    notes.mkdir(exist_ok=True)
    return subprocess.Popen(
        [sys.executable, "-c", DRIVER, WATCHING + code, *command(DEMO, folder, *options)],
        env=environment(NOTES=str(notes)),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def begun(notes):
    return sorted(int(path.name.split()[0]) for path in notes.iterdir())


def assert_one_line(run, *parts, status=2):
    assert (run.status, run.out) == (status, ""), run.err
    assert run.err.startswith("stereo_reproject: error: ")
    assert run.err.count("\n") == 1
    for part in parts:
        assert part in run.err


# A first run


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    folder = tmp_path_factory.mktemp("first") / "out"
    return animate(folder, *WHOLE, "--holes", "--movie", "--compare", "every=2")


@pytest.fixture
def again(first, tmp_path):
    """A copy of the first run's folder, to do with as one likes."""
    return Path(shutil.copytree(first.folder, tmp_path / "out"))


def test_every_file_is_there_and_nothing_else(first):
    assert (first.status, first.err) == (0, "")
    assert first.files == [
        f"{JOURNAL}/0001.json",
        f"{JOURNAL}/0002.json",
        f"{JOURNAL}/0003.json",
        "0001.png",
        "0002.png",
        "0003.png",
        "animation.json",
        "cornell-box_HSBS.mp4",
        "holes/0001.png",
        "holes/0002.png",
        "holes/0003.png",
    ]
    assert first.rendered == [1, 2, 3]
    assert not re.search("Fra:|Saved|Info|Read blend|\r", first.out)


def test_a_frame_holds_both_eyes_in_the_layout(first):
    picture = read_png(first.folder / "0001.png")
    assert picture.shape == (SIZE[1], SIZE[0], 3)
    left, right = np.split(picture, 2, axis=1)
    assert 0.0 < np.abs(left - right).mean() < 0.2 < picture.max()


def test_the_movie_has_all_frames_and_its_mark(first):
    movie = first.folder / "cornell-box_HSBS.mp4"
    assert stereo(movie) == "side by side"
    assert len(movie_frames(movie)) == 3


def test_pictures_of_holes_show_what_was_traced(first):
    for frame in (1, 2, 3):
        assert read_png(first.folder / "holes" / f"{frame:04d}.png").std() > 0.01


def test_the_report_tells_of_each_frame_and_of_all(first):
    report = first.report
    assert [row["frame"] for row in report["frames"]] == report["asked_for"] == [1, 2, 3]
    assert [row["files"] for row in report["frames"]] == [[f"{n:04d}.png", f"holes/{n:04d}.png"] for n in (1, 2, 3)]
    assert [row["frame"] for row in report["frames"] if "compare" in row] == [1, 3]
    whole = report["totals"]
    assert (whole["frames"], whole["compared"], whole["speedup_from"]) == (3, 2, "measured")
    assert whole["seconds"] == pytest.approx(sum(row["wall_seconds"] for row in report["frames"]))
    assert report["failed"] == {}
    for row in report["frames"]:
        assert (row["size"], row["samples"], row["accuracy"]) == ([64, 36], 1, "draft")
        assert 0.0 < row["fractions"]["rerendered"] < 1.0
        assert row["warp"] == {"asked": "auto", "used": "numpy", "gpu": None}
        assert 0.0 < row["beside_seconds"] <= row["wall_seconds"]


# A second one


def test_frames_that_are_there_are_not_touched_unless_it_is_said_how(first, again):
    before = contents(again)
    run = animate(again, *WHOLE)
    assert_one_line(run, "3 of 3 frames are there already (1-3)", "--resume", "--overwrite")
    assert contents(again) == before


def test_resume_renders_what_is_damaged_or_missing_and_the_same_again(first, again):
    damaged = again / "0002.png"
    data = bytearray(damaged.read_bytes())
    data[len(data) // 2] ^= 1
    damaged.write_bytes(data)
    (again / "holes" / "0003.png").unlink()
    kept = contents(again)[again / "0001.png"]
    run = animate(again, *WHOLE, "--holes", "--resume")
    assert (run.status, run.err, run.rendered) == (0, "", [2, 3])
    assert run.out.splitlines()[:3] == [
        "1 of 3 frames are there already",
        "to be rendered: 3",
        "rendered again, for being damaged: 2",
    ]
    assert contents(again)[again / "0001.png"] == kept
    for frame in (2, 3):
        np.testing.assert_array_equal(read_png(again / f"{frame:04d}.png"), read_png(first.folder / f"{frame:04d}.png"))
    assert run.files == first.files


def test_resume_of_what_is_whole_renders_nothing_and_makes_the_movie_again(first, again):
    kept = contents(again)[again / "0002.png"]
    (again / "cornell-box_HSBS.mp4").unlink()
    run = animate(again, *WHOLE, "--resume", "--movie", again / "another.mkv")
    assert (run.status, run.rendered) == (0, [])
    assert contents(again)[again / "0002.png"] == kept
    assert stereo(again / "another.mkv") == "side by side"


def test_frames_of_other_settings_are_rendered_again_and_it_is_said(first, again):
    run = animate(again, *WHOLE, "--resume", "--samples", "2")
    assert (run.status, run.rendered) == (0, [1, 2, 3])
    assert run.out.splitlines()[0] == "rendered again, for being of other settings: 1-3"
    assert [row["samples"] for row in run.report["frames"]] == [2, 2, 2]


def test_a_changed_scene_is_refused_unless_all_is_to_be_overwritten(first, again, tmp_path):
    scene = open_blend(DEMO)
    mesh = next(item for item in scene.objects if item.type == "MESH")
    mesh.location.x += 0.1
    changed = tmp_path / "cornell-box.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(changed), compress=False)
    before = contents(again)
    run = animate(again, *WHOLE, "--resume", scene=changed)
    assert_one_line(run, "the scene has changed since frame 1 was rendered", "--overwrite renders all anew")
    assert contents(again) == before
    run = animate(again, "--frames", "2", "--overwrite", scene=changed)
    assert (run.status, run.rendered) == (0, [2])


def test_what_cannot_be_written_is_said_before_anything_is_rendered(tmp_path):
    run = animate(tmp_path / "out", "--frames", "1", "--layout", "multi-view", "--format", "PNG")
    assert_one_line(run, "PNG cannot hold multi-view: choose OPEN_EXR")
    assert not (tmp_path / "out").exists()


# Several at once, and ends before the end


def test_two_runs_share_the_frames_and_render_each_once(tmp_path):
    notes, folder = tmp_path / "notes", tmp_path / "out"
    both = [watch(TOGETHER, notes, folder, "--frames", "1-6") for _ in range(2)]
    for process in both:
        out, err = process.communicate(timeout=SECONDS)
        assert (process.returncode, err) == (0, "")
        assert len(re.findall(r"^frame \d+  ", out, re.MULTILINE)) <= 6
    assert begun(notes) == [1, 2, 3, 4, 5, 6]
    assert len({path.name.split()[1] for path in notes.iterdir()}) == 2
    names = [f"{frame:04d}.png" for frame in range(1, 7)]
    journal = [f"{JOURNAL}/{frame:04d}.json" for frame in range(1, 7)]
    assert files_in(folder) == [*journal, *names, "animation.json"]
    assert len({json.loads((folder / name).read_text())["run"] for name in journal}) == 2
    report = json.loads((folder / "animation.json").read_text())
    assert [row["frame"] for row in report["frames"]] == [1, 2, 3, 4, 5, 6]


def test_of_two_runs_of_different_settings_one_has_the_folder(tmp_path):
    notes, folder = tmp_path / "notes", tmp_path / "out"
    earlier = watch(HELD_BACK, notes, folder, *WHOLE)
    try:
        deadline = time.monotonic() + SECONDS
        while not begun(notes):
            assert time.monotonic() < deadline
            time.sleep(0.01)
        later = animate(folder, "--frames", "2-3", "--resume", "--samples", "2", "--movie")
    finally:
        (tmp_path / "go").touch()
        _, err = earlier.communicate(timeout=SECONDS)
    assert_one_line(later, f"{folder}: another run renders frames 2-3 there, of other settings: another folder keeps")
    assert (earlier.returncode, err) == (0, "")
    records = [json.loads((folder / f"{JOURNAL}/{frame:04d}.json").read_text()) for frame in (1, 2, 3)]
    assert len({record["settings"] for record in records}) == 1
    report = json.loads((folder / "animation.json").read_text())
    assert [(row["frame"], row["samples"]) for row in report["frames"]] == [(1, 1), (2, 1), (3, 1)]
    assert not list(folder.glob("*.mp4"))


@posix
def test_a_blender_that_is_killed_on_a_frame_costs_that_frame(tmp_path):
    notes, folder = tmp_path / "notes", tmp_path / "out"
    process = watch(CRASHING, notes, folder, "--frames", "1-5")
    _, err = process.communicate(timeout=SECONDS)
    assert process.returncode == 1
    warning, error = err.splitlines()
    assert "warning: frame 3 is left out: Blender was killed by signal 9" in warning
    assert "error: 1 of 5 frames failed (3); frame 3: Blender was killed" in error
    # What was being written just then is rendered once more, what crashes is not.
    assert (sorted(set(begun(notes))), begun(notes).count(3)) == ([1, 2, 3, 4, 5], 1)
    report = json.loads((folder / "animation.json").read_text())
    assert [row["frame"] for row in report["frames"]] == [1, 2, 4, 5]
    assert list(report["failed"]) == ["3"]
    run = animate(folder, "--frames", "1-5", "--resume")
    assert (run.status, run.rendered) == (0, [3])
    assert run.report["failed"] == {}


@posix
def test_a_run_that_is_killed_leaves_whole_frames_and_the_next_one_goes_on(tmp_path):
    folder = tmp_path / "out"
    process = subprocess.Popen(
        [sys.executable, "-m", "stereo_reproject", *command(DEMO, folder, "--frames", "1-40")],
        env=environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    with process:
        for _ in range(3):
            assert process.stdout.readline().startswith("frame ")
        process.send_signal(signal.SIGKILL)
    deadline = time.monotonic() + SECONDS
    while list((folder / JOURNAL).glob("run-*")):
        assert time.monotonic() < deadline, "the worker outlives its parent"
        time.sleep(0.01)
    there = {path.name: path.read_bytes() for path in folder.glob("[0-9]*.png")}
    assert len(there) >= 3
    assert all(data.endswith(b"IEND\xaeB`\x82") for data in there.values())
    last = max(int(name[:4]) for name in there) + 2
    run = animate(folder, "--frames", f"1-{last}", "--resume")
    assert (run.status, run.err) == (0, "")
    journal = [f"{JOURNAL}/{frame:04d}.json" for frame in range(1, last + 1)]
    assert run.files == [*journal, *(f"{frame:04d}.png" for frame in range(1, last + 1)), "animation.json"]
    recorded = [name for name in there if int(name[:4]) not in run.rendered]
    assert len(recorded) >= 3
    assert all((folder / name).read_bytes() == there[name] for name in recorded)


# One working scene for all frames


def pixels(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {
            (part.header.get("view"), name): np.array(channel.pixels)
            for part in file.parts
            for name, channel in part.channels.items()
        }


def test_a_frame_of_a_sequence_has_the_noise_that_it_has_alone(tmp_path):
    exr = ["--layout", "multi-view", "--format", "OPEN_EXR"]
    sequence = animate(tmp_path / "all", "--frames", "1-3", *exr)
    alone = animate(tmp_path / "alone", "--frames", "3", *exr)
    assert (sequence.status, alone.status) == (0, 0), sequence.err + alone.err
    one, other = pixels(tmp_path / "all" / "0003.exr"), pixels(tmp_path / "alone" / "0003.exr")
    for name, values in one.items():
        np.testing.assert_array_equal(values, other[name])


def test_a_frame_of_a_sequence_is_as_it_is_alone(shared_scenes, tmp_path):
    """What Cycles keeps of one frame does not show in the next: a man walks, bone by bone, and the shutter is open."""
    scene = open_blend(shared_scenes / "walking-man" / "walking-man.blend")
    scene.render.use_motion_blur = True
    blend = tmp_path / "walking-man.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend), compress=False)
    exr = ["--layout", "multi-view", "--format", "OPEN_EXR", "--interocular", "0.065", "--convergence", "5"]
    sequence = animate(tmp_path / "all", "--frames", "12-16:4", *exr, scene=blend)
    alone = animate(tmp_path / "alone", "--frames", "16", *exr, scene=blend)
    assert (sequence.status, alone.status) == (0, 0), sequence.err + alone.err
    assert (sequence.rendered, alone.rendered) == ([12, 16], [16])
    one, other = pixels(tmp_path / "all" / "0016.exr"), pixels(tmp_path / "alone" / "0016.exr")
    assert set(one) == set(other)
    for name, values in one.items():
        np.testing.assert_array_equal(values, other[name])
    before = pixels(tmp_path / "all" / "0012.exr")
    assert any(np.abs(before[name] - values).max() > 0.05 for name, values in one.items())


def test_every_frame_has_the_same_passes(shared_scenes, tmp_path):
    """What denoising needs is switched on in the first frame, stays, and is not the user's: a room with a mirror."""
    blend = shared_scenes / "living-room" / "living-room.blend"
    command = [sys.executable, "-m", "stereo_reproject", "animate", str(blend), "--output", str(tmp_path / "out")]
    small = ["--size", "64x36", "--samples", "1", "--denoise", "--frames", "1-2", "--quiet"]
    subprocess.run(
        [*command, *small, "--layout", "multi-view", "--format", "OPEN_EXR_MULTILAYER"], check=True, timeout=SECONDS
    )
    first, second = (set(pixels(tmp_path / "out" / f"{frame:04d}.exr")) for frame in (1, 2))
    assert first == second
