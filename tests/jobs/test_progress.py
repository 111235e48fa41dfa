"""How far a run is said to be."""

import numpy as np
import pytest

from stereo_reproject.jobs.progress import USUAL, Progress, clock, left_words, with_look


def test_nothing_is_said_of_the_time_before_anything_tells():
    progress = Progress(100.0, USUAL["render"])
    progress.begin("load", 100.0)
    assert progress.remaining(101.0) is None
    assert progress.fraction(101.0) == 0.0


def test_a_small_part_of_a_run_does_not_tell_how_long_the_rest_takes():
    """Loading, looking at the scene, and a first look, most of which is the scene's sync: none measures rendering."""
    progress = Progress(0.0, with_look(USUAL["render"]))
    for stage, now in (("load", 1.0), ("plan", 5.0), ("look", 6.0)):
        progress.begin(stage, now)
        assert progress.remaining(now) is None
    for fraction, now in ((0.0, 14.0), (1.0, 15.0)):
        progress.advance(fraction, now)
        assert progress.remaining(now) is None
    progress.begin("source", 16.0)
    assert progress.remaining(16.0) is None


def test_what_comes_before_the_samples_does_not_count_as_their_time():
    """Twelve seconds of sync, and then two seconds for each of eight samples."""
    progress = Progress(0.0, {"source": 80.0, "fill": 20.0})
    progress.begin("source", 0.0)
    progress.advance(1 / 8, 14.0)
    assert progress.remaining(14.0) is None
    for sample in range(2, 9):
        now = 12.0 + 2.0 * sample
        progress.advance(sample / 8, now)
        # The source takes 28 seconds in all, and the rest a fourth of that.
        assert progress.remaining(now) == pytest.approx(28.0 - now + 7.0)
    progress.begin("fill", 28.0)
    assert progress.remaining(28.0) == pytest.approx(7.0)


def test_samples_of_a_run_whose_seconds_are_known_leave_those_of_the_rest():
    progress = Progress(0.0, {"source": 30.0, "fill": 10.0}, in_seconds=True)
    progress.begin("source", 0.0)
    assert progress.remaining(10.0) == pytest.approx(30.0)
    # It syncs for 15 seconds, as it did before.
    progress.advance(1 / 15, 16.0)
    assert progress.remaining(16.0) == pytest.approx(38.0), "one count alone does not tell"
    progress.advance(3 / 15, 18.0)
    assert progress.remaining(18.0) == pytest.approx(12.0 + 10.0)


def test_a_run_as_expected_counts_down_evenly():
    progress = Progress(0.0, {"source": 60.0, "fill": 40.0}, in_seconds=True)
    progress.begin("source", 0.0)
    assert (progress.fraction(30.0), progress.remaining(30.0)) == (pytest.approx(0.3), pytest.approx(70.0))
    progress.begin("fill", 60.0)
    assert (progress.fraction(80.0), progress.remaining(80.0)) == (pytest.approx(0.8), pytest.approx(20.0))


def test_a_first_stage_of_half_the_pace_makes_the_rest_twice_as_long():
    progress = Progress(0.0, {"source": 60.0, "fill": 40.0}, in_seconds=True)
    progress.begin("source", 0.0)
    progress.begin("fill", 120.0)
    assert progress.remaining(120.0) == pytest.approx(80.0)


def test_samples_tell_more_than_the_clock():
    progress = Progress(0.0, {"source": 60.0, "fill": 40.0}, in_seconds=True)
    progress.begin("source", 0.0)
    progress.advance(0.5, 60.0)
    assert progress.fraction(60.0) == pytest.approx(0.3)
    assert progress.remaining(60.0) == pytest.approx(140.0)


def test_between_two_counts_of_samples_the_clock_goes_on():
    progress = Progress(0.0, {"source": 80.0, "fill": 20.0})
    progress.begin("source", 0.0)
    progress.advance(0.25, 10.0)
    assert progress.fraction(10.0) == pytest.approx(0.2)
    assert progress.fraction(20.0) == pytest.approx(0.4)
    assert progress.remaining(20.0) == pytest.approx(30.0)


def test_the_first_sample_moves_the_bar_but_tells_no_time():
    progress = Progress(0.0, {"source": 80.0, "fill": 20.0})
    progress.begin("source", 0.0)
    progress.advance(0.01, 1.0)
    assert progress.remaining(2.0) is None
    assert progress.fraction(11.0) == pytest.approx(0.088)


def test_progress_never_runs_backwards():
    progress = Progress(0.0, {"plan": 1.0, "source": 79.0, "fill": 20.0})
    for stage, now in (("plan", 0.0), ("source", 0.1)):
        progress.begin(stage, now)
    shown = [progress.fraction(50.0)]
    for fraction, now in ((0.02, 50.0), (0.04, 99.0), (0.3, 100.0)):
        shown.append(progress.fraction(now))
        progress.advance(fraction, now)
        shown.append(progress.fraction(now))
    assert shown == sorted(shown)
    assert shown[0] == pytest.approx(0.01), "what comes before a render tells nothing of it"


def test_what_takes_longer_than_expected_is_never_done_before_it_is():
    progress = Progress(0.0, {"source": 1.0, "fill": 1.0}, in_seconds=True)
    progress.begin("source", 0.0)
    assert 0.4 < progress.fraction(1000.0) < 0.5
    assert progress.remaining(1000.0) > 0.0


def test_renders_of_one_stage_are_counted_together():
    """Multiview's two eyes and one again, each of 10 seconds: every one counts its samples from the beginning."""
    progress = Progress(0.0, {"source": 10.0, "compare": 40.0})
    progress.begin("source", 0.0)
    progress.begin("compare", 10.0)
    shown, left = [], []
    for render in range(3):
        for count in (1, 4, 7, 10, 0):
            now = 10.0 + 10.0 * render + (count or 10)
            progress.advance(count / 10, now)
            shown.append(progress.fraction(now))
            left.append(progress.remaining(now) + now)
    assert shown == sorted(shown)
    assert max(left[2:]) - min(left[2:]) < 1.0, "the end is expected at the same time throughout"


def test_frames_are_counted_by_their_stages_starting_over():
    progress = Progress(0.0, {"source": 3.0, "fill": 1.0}, in_seconds=True, frames=4)
    for frame in range(4):
        progress.begin("source", 4.0 * frame)
        assert progress.fraction(4.0 * frame) == pytest.approx(frame / 4)
        assert progress.remaining(4.0 * frame) == pytest.approx(16.0 - 4.0 * frame)
        progress.begin("fill", 4.0 * frame + 3.0)


def test_frames_of_an_animation_are_counted_from_the_first_on():
    """By the stages as they come; a stage out of order would hide where a frame begins."""
    progress = Progress(0.0, USUAL["animate"], frames=4)
    progress.begin("load", 0.0)
    told = []
    for frame in range(4):
        for k, stage in enumerate(("prepare", "source", "warp", "fill", "refine", "composite", "account", "write")):
            progress.begin(stage, 80.0 * frame + 10.0 * k)
        told.append(progress.fraction(80.0 * frame + 70.0))
    assert np.diff(told) == pytest.approx([0.25] * 3, abs=0.02)


def test_a_stage_that_nobody_expects_changes_nothing_but_comes_last():
    progress = Progress(0.0, {"source": 3.0, "fill": 1.0}, in_seconds=True)
    progress.begin("polish", 4.0)
    assert progress.fraction(5.0) == 1.0
    assert progress.remaining(5.0) == 0.0


@pytest.mark.parametrize(("seconds", "shown"), [(0.4, "0:00"), (42.0, "0:42"), (185.4, "3:05"), (3750.0, "1:02:30")])
def test_clock(seconds, shown):
    assert clock(seconds) == shown


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (0.2, "1 s left"),
        (42.4, "42 s left"),
        (59.4, "59 s left"),
        (59.6, "1 min left"),
        (150.0, "2 min left"),
        (3600.0, "1 h left"),
        (3900.0, "1 h 5 min left"),
    ],
)
def test_the_time_that_is_left_is_said_in_seconds_only_in_the_last_minute(seconds, words):
    assert left_words(seconds) == words
