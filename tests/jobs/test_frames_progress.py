"""How far an animation is said to be."""

from functools import partial

import pytest

from stereo_reproject.jobs.frames_progress import FramesProgress
from stereo_reproject.jobs.progress import USUAL, Progress

STAGES = {"source": 30.0, "fill": 10.0}


def progress_of(total, *, renders=1):
    return FramesProgress(0.0, total, partial(Progress, stages=STAGES, frames=renders))


def rendered(progress, frame, start, *, seconds=40.0):
    progress.begin("source", start, f"frame {frame}")
    progress.begin("fill", start + 0.75 * seconds, f"frame {frame}")


def finished(frame, total, each, *, done=None):
    return {"frame": frame, "done": frame if done is None else done, "total": total, "each": each}


def test_in_the_first_frame_the_others_are_taken_to_last_as_long():
    progress = progress_of(4)
    rendered(progress, 1, 0.0)
    assert progress.fraction(30.0) == pytest.approx(0.75 / 4)
    assert progress.remaining(30.0) == pytest.approx(10.0 + 3 * 40.0)


def test_the_beginning_of_the_first_frame_does_not_tell_how_long_all_take():
    progress = progress_of(12)
    progress.begin("source", 0.0, "frame 1")
    # The scene was synced in these three seconds, and then one sample of 16 rendered.
    progress.advance(1 / 16, 3.0)
    assert progress.remaining(3.0) is None
    alone = progress_of(1)
    alone.begin("source", 0.0, "frame 1")
    for sample in (1, 2):
        alone.advance(sample / 16, 2.0 + sample)
    assert alone.remaining(4.0) is not None


@pytest.mark.parametrize("late", [False, True])
def test_a_frame_that_is_written_while_the_next_is_rendered_counts_once(late):
    progress = progress_of(4)
    rendered(progress, 1, 0.0)
    if not late:
        progress.finish(finished(1, 4, 40.0))
    rendered(progress, 2, 40.0)
    if late:
        progress.finish(finished(1, 4, 40.0))
    assert progress.fraction(70.0) == pytest.approx(1.75 / 4)
    assert progress.remaining(70.0) == pytest.approx(10.0 + 2 * 40.0)


def test_the_parts_of_a_frame_are_of_one_frame():
    progress, parts = progress_of(4), progress_of(4)
    rendered(progress, 1, 0.0)
    parts.begin("source", 0.0, "frame 1, view 1 of 8")
    parts.begin("fill", 30.0, "frame 1, view 2 of 8")
    assert parts.fraction(30.0) == progress.fraction(30.0) == pytest.approx(0.75 / 4)


def test_in_the_last_frame_there_is_no_more_left_than_of_itself():
    progress = progress_of(2)
    rendered(progress, 1, 0.0)
    rendered(progress, 2, 40.0)
    progress.finish(finished(1, 2, 40.0))
    assert progress.remaining(70.0) == pytest.approx(10.0)
    assert progress.remaining(200.0) < 10.0


def test_frames_that_were_there_already_count_as_done():
    progress = progress_of(10)
    rendered(progress, 7, 0.0)
    progress.finish(finished(7, 10, 40.0))
    rendered(progress, 8, 40.0)
    assert progress.fraction(70.0) == pytest.approx(7.75 / 10)


def test_several_layers_are_one_frame():
    progress = progress_of(2, renders=2)
    for layer in range(2):
        rendered(progress, 1, 40.0 * layer)
    assert progress.fraction(70.0) == pytest.approx(1.75 / 4)
    assert progress.remaining(70.0) == pytest.approx(10.0 + 80.0)


def test_it_never_goes_back():
    progress = progress_of(3)
    rendered(progress, 1, 0.0)
    before = progress.fraction(39.0)
    progress.begin("source", 40.0, "frame 2")
    assert progress.fraction(40.0) >= before


def test_before_anything_tells_no_time_is_left():
    progress = FramesProgress(0.0, 3, partial(Progress, stages=USUAL["animate"]))
    progress.begin("load", 0.0)
    assert progress.remaining(1.0) is None
    assert progress.fraction(1.0) == 0.0


def test_between_two_frames_what_is_finished_counts_once():
    progress = progress_of(4)
    rendered(progress, 1, 0.0)
    progress.finish(finished(1, 4, 40.0))
    assert progress.fraction(41.0) == pytest.approx(0.25)
    assert progress.remaining(41.0) == pytest.approx(120.0)


def test_a_frame_that_failed_counts_once():
    progress = progress_of(4)
    rendered(progress, 1, 0.0)
    rendered(progress, 2, 40.0)
    progress.finish(finished(2, 4, 40.0))
    progress.begin("source", 80.0, "frame 3")
    assert progress.fraction(80.0) == pytest.approx(0.5)
    assert progress.remaining(80.0) == pytest.approx(80.0)


def test_a_frame_of_another_run_counts_too():
    progress = progress_of(4)
    rendered(progress, 1, 0.0)
    progress.finish(finished(1, 4, 40.0))
    progress.finish(finished(2, 4, 40.0))
    progress.begin("source", 40.0, "frame 3")
    progress.finish(finished(4, 4, 40.0, done=3))
    progress.begin("fill", 70.0, "frame 3")
    assert progress.fraction(70.0) == pytest.approx(0.9375)
    assert progress.remaining(70.0) == pytest.approx(10.0)
