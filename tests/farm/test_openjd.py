"""The job template of Open Job Description, run for real; in place of the program a few lines that say what they were
given. tests/render/test_farm.py runs it with the program."""

import json
import os
import signal
import subprocess
import sys

import pytest

from tests.farm.openjd_job import finished_job, openjd, run_job, typed

SECONDS = 60.0
"""Far more than any of these jobs takes."""

SAYS_WHAT_IT_WAS_GIVEN = """
import json, sys
print("given", json.dumps(sys.argv[1:]))
"""

FINISHES_TWO_FRAMES = """
print("Blender 5.2.0", "frames of a movie: 9 of 9", sep="\\n")
print("frame 13  3.5 s  8 % traced  1 of 2  0:42 left")
print("frame 14  3.5 s  8 % traced  2 of 2  0:00 left")
"""

FAILS_AT_FRAME_3 = """
import sys
if any(argument.startswith("--frames=3") for argument in sys.argv):
    print("stereo_reproject: warning: the sky is grey", file=sys.stderr)
    print("stereo_reproject: error: frame 3: it rains", file=sys.stderr)
    sys.exit(1)
"""

WAITS_UNTIL_IT_IS_TERMINATED = """
import os, signal
def end(number, frame):
    # Not a line of output: the runner's threads write their own in the middle of it.
    open(__file__ + ".ended", "x").close()
    os._exit(143)
signal.signal(signal.SIGTERM, end)
print("begun", flush=True)
while True:
    signal.pause()
"""


@pytest.fixture
def job(tmp_path):
    """Runs the job with a program, by its lines."""

    def run(program, **parameters):
        return run_job(tmp_path, seconds=SECONDS, **given(tmp_path, program, **parameters))

    return run


def given(folder, program, **parameters):
    (folder / "program.py").write_text(program, encoding="utf-8")
    command = typed(sys.executable, folder / "program.py")
    return {"SceneFile": "room.blend", "OutputDirectory": "out", "Frames": "1-5", "Command": command, **parameters}


def arguments(job):
    return [json.loads(line.removeprefix("given ")) for line in job.lines if line.startswith("given ")]


def frames(job):
    return [next(one for one in args if one.startswith("--frames=")) for args in arguments(job)]


def test_it_keeps_to_the_specification():
    checked = subprocess.run(openjd("check"), capture_output=True, text=True, timeout=SECONDS, check=False)
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_the_command_of_each_task(job, tmp_path):
    done = job(SAYS_WHAT_IT_WAS_GIVEN, ChunkSize=2, MovieFile="room.mp4", Samples=4, Layout="over-under")
    assert done.status == 0, done.out
    assert done.steps == ["Render", "Finish"]
    animate = ["animate", str(tmp_path / "room.blend"), "--output", str(tmp_path / "out")]
    options = ["--resume", "--accuracy=balanced", "--samples=4", "--layout=over-under", "--strict"]
    chunks = ["--frames=1-2", "--frames=3-4", "--frames=5-5"]
    movie = f"--movie={tmp_path / 'room.mp4'}"
    expected = [[*animate, chunk, *options] for chunk in chunks]
    assert arguments(done) == [*expected, [*animate, "--frames=1-5", *options, movie]]


def test_what_is_left_empty_is_left_out(job):
    done = job(SAYS_WHAT_IT_WAS_GIVEN, Frames="0", Samples=0)
    assert [args[4:] for args in arguments(done)] == [
        ["--frames=0-0", "--resume", "--accuracy=balanced", "--strict"],
        ["--frames=0", "--resume", "--accuracy=balanced", "--strict"],
    ]


def test_strict_can_be_switched_off(job):
    done = job(SAYS_WHAT_IT_WAS_GIVEN, Frames="0", Strict="false")
    assert [args[4:] for args in arguments(done)] == [
        [f"--frames={frames}", "--resume", "--accuracy=balanced"] for frames in ("0-0", "0")
    ]


@pytest.mark.parametrize(
    ("asked", "chunks"),
    [
        ("-3-2", ["-3--2", "-1-0", "1-2"]),
        ("1-3,10-11", ["1-2", "3-3", "10-11"]),
        ("1-5:2", ["1-1", "3-3", "5-5"]),
    ],
)
def test_chunks_hold_each_frame_once(job, asked, chunks):
    done = job(SAYS_WHAT_IT_WAS_GIVEN, Frames=asked, ChunkSize=2)
    assert frames(done) == [f"--frames={part}" for part in (*chunks, asked)]


def test_no_shell_reads_what_is_given(job, tmp_path):
    scene = tmp_path / 'it\'s a "room" $(touch harm) `touch harm`; touch harm & %PATH% {Param.Samples}.blend'
    done = job(
        SAYS_WHAT_IT_WAS_GIVEN, SceneFile=scene, Frames="1", ExtraOptions='--size 64x36 --x "b c; $(touch harm)"'
    )
    assert done.status == 0, done.out
    for args in arguments(done):
        assert args[1] == str(scene)
        assert args[-4:] == ["--size", "64x36", "--x", "b c; $(touch harm)"]
    assert not list(tmp_path.rglob("harm"))


def test_progress_is_told(job):
    done = job(FINISHES_TWO_FRAMES, Frames="13-14")
    assert done.told("progress") == ["50.0", "100.0"] * 2
    assert done.told("status")[0] == "frame 13  3.5 s  8 % traced  1 of 2  0:42 left"


def test_a_chunk_that_fails_fails_the_job_and_says_why(job):
    done = job(FAILS_AT_FRAME_3, ChunkSize=2)
    assert done.status != 0
    assert done.chunks == ["1-2", "3-4"]
    assert done.steps == ["Render"]
    assert "stereo_reproject: error: frame 3: it rains" in done.lines
    assert done.told("fail") == ["stereo_reproject: error: frame 3: it rains"]


@pytest.mark.parametrize(("command", "said"), [("no-such-program", "no-such-program"), ("python '", "No closing quot")])
def test_a_command_that_cannot_be_started_is_told(job, command, said):
    done = job("", Command=command)
    assert done.status != 0
    assert said in done.told("fail")[0]
    assert "Traceback" not in done.out


CAN_BE_INTERRUPTED = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
os.execvp(sys.argv[1], sys.argv[1:])
"""
"""Starts a program that listens to Ctrl-C, also where these tests run in the background of a script and ignore it."""


@pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")
def test_cancelling_ends_the_program_in_order(tmp_path):
    parameters = given(tmp_path, WAITS_UNTIL_IT_IS_TERMINATED)
    command = [sys.executable, "-c", CAN_BE_INTERRUPTED, *openjd("run", **parameters)]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    shown = ""
    while not shown.endswith("begun\n"):
        line = process.stdout.readline()
        assert line, shown
        shown += line
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=SECONDS)
    cancelled = finished_job(process.returncode, shown + out)
    assert cancelled.status != 0
    assert (tmp_path / "program.py.ended").exists(), cancelled.out
    assert cancelled.steps == ["Render"]
