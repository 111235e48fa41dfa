"""What the worker's process is started with, and what its answers are made of."""

import json
import os
import select
import subprocess
import sys
from pathlib import Path

import pytest

from stereo_reproject.jobs import worker_process
from stereo_reproject.jobs.progress import Progress
from stereo_reproject.jobs.work_folder import work_folder

SECONDS = 60.0


def test_nothing_that_is_set_for_another_python_reaches_blender(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONHOME", "/nowhere")
    monkeypatch.setenv("PYTHONPATH", "/somewhere")
    monkeypatch.setenv("PYTHONWARNINGS", "error")
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "1")
    environment = worker_process.private_environment(tmp_path, own_python=False)
    ours = {name: value for name, value in environment.items() if name.startswith("PYTHON")}
    home = str(Path(worker_process.__file__).resolve().parents[2])
    assert set(ours) <= {"PYTHONPATH", "PYTHONNOUSERSITE"}
    assert "/somewhere" not in ours.get("PYTHONPATH", "").split(os.pathsep)
    assert home in ours["PYTHONPATH"].split(os.pathsep)
    assert environment["CUDA_VISIBLE_DEVICES"] == "1"


def test_the_same_python_keeps_its_settings(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", "/somewhere")
    environment = worker_process.private_environment(tmp_path, own_python=True)
    assert environment["PYTHONPATH"].split(os.pathsep)[-1] == "/somewhere"


def test_charts_are_drawn_whatever_backend_the_user_s_are_for(monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "of another program")
    command = [sys.executable, "-c", "import matplotlib.figure"]
    environment = worker_process.worker_environment()
    ended = subprocess.run(command, env=environment, capture_output=True, timeout=SECONDS, check=False)
    assert (ended.returncode, ended.stderr) == (0, b"")


def test_temporary_files_go_into_the_run_s_own_folder(tmp_path):
    environment = worker_process.private_environment(tmp_path, own_python=True)
    assert {environment[name] for name in ("TMPDIR", "TEMP", "TMP")} == {str(tmp_path / "tmp")}


TILES = """\
Fra:1 | Time:00:00.00 | Scene, ViewLayer | Rendered 0/4 Tiles, Sample 0/24
Fra:1 | Time:00:00.19 | Remaining:00:17.91 | Scene, ViewLayer | Rendered 0/4 Tiles, Sample 1/24
Fra:1 | Time:00:03.60 | Remaining:00:10.79 | Scene, ViewLayer | Rendered 0/4 Tiles, Sample 24/24
Fra:1 | Time:00:03.60 | Remaining:00:10.79 | Scene, ViewLayer | Rendered 1/4 Tiles, Sample 24/24
Fra:1 | Time:00:03.73 | Remaining:00:10.60 | Scene, ViewLayer | Rendered 1/4 Tiles, Sample 1/24
Fra:1 | Time:00:05.27 | Remaining:00:08.10 | Scene, ViewLayer | Rendered 1/4 Tiles, Sample 12/24
Fra:1 | Time:00:06.77 | Remaining:00:06.76 | Scene, ViewLayer | Rendered 1/4 Tiles, Sample 24/24
Fra:1 | Time:00:06.77 | Remaining:00:06.76 | Scene, ViewLayer | Rendered 2/4 Tiles, Sample 24/24
Fra:1 | Time:00:10.74 | Remaining:00:03.57 | Scene, ViewLayer | Rendered 3/4 Tiles, Sample 24/24
Fra:1 | Time:00:10.91 | Remaining:00:03.43 | Scene, ViewLayer | Rendered 3/4 Tiles, Sample 1/24
Fra:1 | Time:00:14.60 | Scene, ViewLayer | Rendered 3/4 Tiles, Sample 24/24
Fra:1 | Time:00:14.60 | Scene, ViewLayer | Rendered 3/4 Tiles, Sample 0/24
"""
"""Lines of Blender's log about a picture that is rendered in four tiles, as large ones are."""


def test_samples_of_all_tiles_count_and_the_time_that_is_left_stays_steady(tmp_path):
    usual, idle = {"source": 80.0, "fill": 20.0}, (sys.executable, "-c", "input()")
    with worker_process.start_worker(idle, tmp_path) as worker:
        worker.begin_stage()
        progress = Progress(0.0, usual)
        progress.begin("source", 0.0)
        done, ends = [], []
        for line in TILES.splitlines(keepends=True):
            with worker.log.open("a") as log:
                log.write(line)
            now = float(line.split("Time:00:")[1].split()[0])
            done.append(worker.samples_done())
            progress.advance(done[-1], now)
            left = progress.remaining(now)
            ends += [] if left is None else [now + left]
        worker.begin_stage()
        assert worker.samples_done() is None
    assert done == sorted(done)
    assert done[4] == pytest.approx((1 + 1 / 24) / 4)
    assert (done[3], done[-1]) == (1 / 4, 1.0)
    # The source takes 14.6 seconds, and the rest a fourth of that.
    assert ends
    assert ends == pytest.approx([18.25] * len(ends), rel=0.15)


def test_a_second_render_in_tiles_begins_anew(tmp_path):
    with worker_process.start_worker((sys.executable, "-c", "input()"), tmp_path) as worker:
        for line, done in (("Rendered 3/4 Tiles, Sample 12/24 ", 7 / 8), ("Rendered 0/4 Tiles, Sample 6/24 ", 1 / 16)):
            with worker.log.open("a") as log:
                log.write(line)
            assert worker.samples_done() == pytest.approx(done)


def test_a_folder_in_use_is_not_abandoned_by_another_of_its_names(tmp_path):
    real, link = tmp_path / "real", tmp_path / "link"
    real.mkdir()
    link.symlink_to(real, target_is_directory=True)
    with work_folder(real, ()) as first, work_folder(link, ()) as second:
        assert first.is_dir()
        assert second.is_dir()
    assert list(real.iterdir()) == []


TELLING = """
import sys
sys.path.insert(0, sys.argv[1])
from stereo_reproject.programs import worker
worker._open_events()("done", report={"low": float("nan"), "ends": (1.5, float("inf"))})
"""


def test_what_is_no_number_is_null_in_an_event():
    """A window shows the report of the event, and not the one of report.json."""
    home = Path(worker_process.__file__).resolve().parents[2]
    answer = subprocess.run([sys.executable, "-c", TELLING, home], capture_output=True, check=True, timeout=60)
    assert json.loads(answer.stdout) == {"event": "done", "report": {"low": None, "ends": [1.5, None]}}


ENCODINGS = ("utf-16", "cp037")
"""Of the user's own choice for standard streams; in the second, a line does not end with the byte that ends ours."""


def start(name, messages, encoding):
    """A process of ours that gets these lines; its standard input stays open, for it ends with that."""
    environment = {**worker_process.worker_environment(), "PYTHONIOENCODING": encoding}
    command = worker_process.module_command(name)
    pipe = subprocess.PIPE
    process = subprocess.Popen(command, env=environment, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL)
    process.stdin.write(b"".join(json.dumps(message).encode() + b"\n" for message in messages))
    process.stdin.flush()
    return process


@pytest.mark.skipif(os.name != "posix", reason="waits for a pipe as POSIX has it")
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_job_is_read_whatever_the_encoding_of_standard_input(encoding):
    with start("programs.worker", [{"command": "nothing of this name"}], encoding) as process:
        # One that waits for the end of the line would wait for good.
        ready, _, _ = select.select([process.stdout], [], [], SECONDS)
        if not ready:
            process.kill()
        event = json.loads(process.stdout.readline())
        assert (event["event"], process.wait()) == ("error", 1)
    assert "nothing of this name" in event["message"]


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_frames_are_read_whatever_the_encoding_of_standard_input(encoding, tmp_path):
    with start("programs.writer", [{"private": str(tmp_path)}, {"frame": 7}], encoding) as process:
        process.communicate(timeout=SECONDS)
    assert process.returncode == 0
    assert json.loads((tmp_path / "7.json").read_text())["status"] == 1


@pytest.mark.skipif(os.name != "posix", reason="a folder goes while somebody stands in it")
def test_who_stands_in_a_folder_that_is_gone_finds_the_libraries_too(tmp_path, monkeypatch):
    before = worker_process.worker_environment().get("PYTHONPATH")
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    assert worker_process.worker_environment().get("PYTHONPATH") == before


def test_a_module_where_the_caller_stands_is_not_taken_for_a_library(tmp_path, monkeypatch):
    (tmp_path / "OpenEXR.py").write_text("raise SystemExit")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    places = worker_process.worker_environment().get("PYTHONPATH", "").split(os.pathsep)
    assert str(tmp_path) not in places
