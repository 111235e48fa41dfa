"""A signal ends a run at any moment: also while it waits for what never answers, and then what is half done is undone.

Each in a process of its own, which really waits.
"""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.programs.test_cli import DRIVER, STUB, wait_until

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 30.0

WAITING = """
import os, sys
from pathlib import Path
from stereo_reproject.jobs import interrupts
from stereo_reproject.jobs import supervisor
from stereo_reproject.jobs import work_folder
from stereo_reproject.errors import StereoReprojectError
interrupts.HELD_SECONDS, interrupts.CLEANING_SECONDS = 0.05, float(sys.argv[3])
never, folder = os.pipe()[0], Path(sys.argv[1])

def wait():
    print("waits", flush=True)
    os.read(never, 1)

def publish(work, held):
    names = ("left.exr", "right.exr", "report.json")
    for name in names:
        (work / "out" / name).write_text("new")
    replace, count = Path.replace, iter(range(100))

    def hanging(self, target):
        result = replace(self, target)
        if next(count) == 4:
            wait()
        return result

    Path.replace = hanging
    work_folder.publish(work, folder, names, between_steps=held.check)

status = 0
try:
    with interrupts.Interrupts() as held:
        with work_folder.work_folder(folder, ()) as work, held.until_cleaning():
            if sys.argv[2] == "publishing":
                publish(work, held)
            if sys.argv[2] == "working":
                wait()
            if sys.argv[2] == "never undone":
                try:
                    wait()
                finally:
                    wait()
        if sys.argv[2] == "cleaning":
            wait()
except StereoReprojectError as error:
    print(error, file=sys.stderr)
    status = error.exit_status
sys.exit(status)
"""


def start(folder, moment, *, cleaning=SECONDS):
    return subprocess.Popen(
        [sys.executable, "-c", WAITING, str(folder), moment, str(cleaning)],
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "error"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.fixture
def folder(tmp_path):
    made = tmp_path / "pair"
    made.mkdir()
    for name in ("left.exr", "report.json"):
        (made / name).write_text("old")
    return made


def end(process, signum):
    with process:
        try:
            assert process.stdout.readline() == "waits\n"
            process.send_signal(signum)
            return process.communicate(timeout=SECONDS)[1]
        finally:
            process.kill()


@pytest.mark.parametrize("moment", ["working", "publishing"])
@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_one_signal_ends_what_never_answers_and_undoes_it(folder, moment, signum):
    process = start(folder, moment)
    said = end(process, signum)
    assert process.returncode == 128 + signum
    assert said.endswith("; no result was written\n")
    assert {path.name: path.read_text() for path in folder.iterdir()} == {"left.exr": "old", "report.json": "old"}


@pytest.mark.parametrize("moment", ["cleaning", "never undone"])
def test_what_cannot_even_be_cleaned_up_after_ends_as_it_is(folder, moment):
    process = start(folder, moment, cleaning=0.3)
    assert end(process, signal.SIGTERM) == ""
    assert process.returncode == 128 + signal.SIGTERM


def test_a_reader_that_never_reads_holds_nothing_up(tmp_path):
    """As a terminal that was stopped, or a pipe into a program that hangs."""
    blend = tmp_path / "room.blend"
    blend.write_bytes(b"BLENDER-v502")
    impatient = f"from stereo_reproject.jobs import interrupts\ninterrupts.HELD_SECONDS = 0.1\n{DRIVER}"
    stub = [sys.executable, str(STUB), "says more than anybody reads", str(tmp_path)]
    process = subprocess.Popen(
        [sys.executable, "-c", impatient, *stub, "render", str(blend), "--output", str(tmp_path / "pair")],
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "error"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    with process:
        try:
            wait_until((tmp_path / "ready").exists)
            process.send_signal(signal.SIGTERM)
            assert process.wait(SECONDS) == 128 + signal.SIGTERM
            assert process.stderr.read() == b"stereo_reproject: terminated; no result was written\n"
        finally:
            process.kill()
    assert not (tmp_path / "pair").exists()
