"""The job template of docs/farm, run as a farm would: its tasks start the program itself."""

import json
import sys
from pathlib import Path

import pytest

from tests.farm.openjd_job import run_job, typed

ROOT = Path(__file__).resolve().parents[2]
DEMO = ROOT / "demo" / "cornell-box" / "cornell-box.blend"

SECONDS = 300.0
"""Far more than a job of three small frames takes."""

FRAMES = (1, 2, 3)
CHARTS = ("animation.json", "animation.png")
PARAMETERS = {
    "SceneFile": DEMO,
    "OutputDirectory": "out",
    "MovieFile": "cornell-box.mp4",
    "Frames": "1-3",
    "ChunkSize": 2,
    "Accuracy": "draft",
    "Samples": 1,
    "ExtraOptions": "--size 64x36 --no-denoise --seed 5",
    "Command": typed(sys.executable, "-m", "stereo_reproject"),
}


def files_in(folder):
    return {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("farm")


@pytest.fixture(scope="module")
def job(folder):
    done = run_job(folder, seconds=SECONDS, **PARAMETERS)
    assert done.status == 0, done.out
    return done


def test_the_frames_are_rendered_in_chunks_and_the_rest_is_made_last(job):
    assert job.steps == ["Render", "Finish"]
    assert job.chunks == ["1-2", "3-3"]


def test_every_frame_the_movie_and_the_charts_are_there(job, folder):
    names = list(files_in(folder / "out"))
    for frame in FRAMES:
        assert any(f"{frame:04d}" in name for name in names), names
    assert set(CHARTS) <= set(names)
    assert json.loads((folder / "out" / "animation.json").read_text(encoding="utf-8"))
    assert (folder / "cornell-box.mp4").stat().st_size > 0


def test_the_session_is_told_of_each_frame(job):
    assert job.told("progress") == ["50.0", "100.0", "100.0"]
    assert [status.split()[:2] for status in job.told("status")] == [["frame", str(frame)] for frame in FRAMES]


def test_a_second_run_renders_nothing(job, folder):
    def written():
        """Frames alone: a journal may be written to, and movie and charts are made anew."""
        found = files_in(folder / "out")
        frames = {name: path for name, path in found.items() if any(f"{frame:04d}" in name for frame in FRAMES)}
        return {name: path.stat().st_mtime_ns for name, path in frames.items() if path.suffix in (".png", ".exr")}

    before = written()
    again = run_job(folder, seconds=SECONDS, **PARAMETERS)
    assert again.status == 0, again.out
    assert again.told("progress") == []
    assert written() == before != {}


def test_a_task_that_fails_fails_the_job_and_says_why_in_one_line(tmp_path):
    done = run_job(tmp_path, seconds=SECONDS, **{**PARAMETERS, "SceneFile": "missing.blend"})
    assert done.status != 0
    assert done.steps == ["Render"]
    (reason,) = done.told("fail")
    assert reason.startswith("stereo_reproject: error: ")
    assert "missing.blend does not exist" in reason
    assert reason in done.lines
    assert "Traceback" not in done.out
    assert not (tmp_path / "out").exists()
