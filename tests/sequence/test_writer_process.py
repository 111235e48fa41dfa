"""The process that writes frames, as whoever waits for it has it: another command answers in its place."""

import sys

import pytest

from stereo_reproject.errors import OutputError, StereoReprojectError
from stereo_reproject.jobs.supervisor import Session
from stereo_reproject.sequence.writer_process import WriterJob, WriterProcess, WrittenFrame

ANSWERS_ALL = """
import json, pathlib, sys
private = pathlib.Path(json.loads(sys.stdin.readline())["private"])
for line in sys.stdin:
    frame = json.loads(line)["frame"]
    beside = private / "answer.tmp"
    beside.write_text(json.dumps({"record": None}))
    beside.replace(private / f"{frame}.json")
"""
ANSWERS_NOTHING = "import sys\nfor line in sys.stdin: pass"
ENDS_AT_ONCE = "import sys\nsys.stdin.readline(), sys.stdin.readline(), sys.exit(7)"


@pytest.fixture
def private(tmp_path):
    folder = tmp_path / "frames" / "private"
    folder.mkdir(parents=True)
    return folder


def started(private, code):
    order = WriterJob(
        blend="", session=Session(), private=str(private), folder=str(private.parent),
        name="", output=None, layout=None, file_format=None,
    )  # fmt: skip
    process = WriterProcess(order, [sys.executable, "-c", code])
    process.start()
    return process


def frame(number):
    return WrittenFrame(number, 1, "", {}, {})


def test_frames_are_answered_for_in_order(private):
    process = started(private, ANSWERS_ALL)
    for number in range(1, 8):
        process.hand_over(frame(number))
    assert process.finished(wait=True) == [(number, None) for number in range(1, 8)]
    process.close()


@pytest.mark.parametrize("made_anew", [False, True])
def test_nobody_waits_for_an_answer_that_went_away_with_its_folder(private, made_anew):
    process = started(private, ANSWERS_NOTHING)
    process.hand_over(frame(1))
    private.parent.rename(private.parent.with_name("elsewhere"))
    if made_anew:
        # As Blender does on the way to a file.
        private.mkdir(parents=True)
    [(number, error)] = process.finished(wait=True)
    assert number == 1
    assert isinstance(error, OutputError)
    assert str(error) == f"{private.parent} is gone, with the frames that were in it"
    process.close()


def test_a_process_that_ended_is_told_of_and_the_next_frames_have_another(private):
    process = started(private, ENDS_AT_ONCE)
    process.hand_over(frame(1))
    process.hand_over(frame(2))
    results = process.finished(wait=True)
    assert [number for number, _ in results] == [1, 2]
    for number, error in results:
        assert type(error) is StereoReprojectError
        assert str(error) == f"frame {number} was not written: Blender stopped unexpectedly (exit status 7)"
    process.close()
