"""What the worker's process is started with, and what its answers are made of."""

import json
import os
import select
import subprocess
import sys
from pathlib import Path

import pytest

from stereo_reproject.jobs import worker_process
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
