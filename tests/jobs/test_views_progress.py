"""Progress of many views: by those that are finished, and the time left from their pace."""

import pytest

from stereo_reproject.jobs.views_progress import LEAST_TELLING_SHARE, SHARE_OF_VIEWS, ViewsProgress
from stereo_reproject.pipeline.stages import Stage


def at_view(progress, number, now, count=8, stage=Stage.SOURCE):
    progress.begin(stage, now, f"view {number} of {count}")


def test_finished_views_count():
    progress = ViewsProgress(8)
    progress.begin(Stage.LOAD, 0.0, "")
    assert progress.fraction(5.0) == 0.0
    for number in range(1, 9):
        at_view(progress, number, 5.0 + 2.0 * number)
        assert progress.fraction(0.0) == pytest.approx(SHARE_OF_VIEWS * (number - 1) / 8)


def test_samples_count_where_a_view_is_rendered_whole():
    progress = ViewsProgress(8)
    at_view(progress, 3, 0.0)
    progress.advance(0.5, 1.0)
    assert progress.fraction(1.0) == pytest.approx(SHARE_OF_VIEWS * 2.5 / 8)
    at_view(progress, 3, 2.0, stage=Stage.FILL)
    progress.advance(0.9, 3.0)
    assert progress.fraction(3.0) == pytest.approx(SHARE_OF_VIEWS * 2.0 / 8)


def test_what_comes_after_the_views_is_the_rest():
    progress = ViewsProgress(8)
    at_view(progress, 8, 0.0)
    progress.begin(Stage.WRITE, 1.0, "")
    assert (progress.fraction(1.0), progress.remaining(1.0)) == (SHARE_OF_VIEWS, None)


def test_the_time_left_is_told_once_enough_views_are_finished():
    progress = ViewsProgress(8)
    at_view(progress, 1, 10.0)
    assert progress.remaining(10.0) is None
    at_view(progress, 2, 14.0)
    assert LEAST_TELLING_SHARE * 8 > 1
    assert progress.remaining(14.0) is None
    at_view(progress, 3, 16.0)
    # Two views in six seconds: six more take 18.
    assert progress.remaining(16.0) == pytest.approx(18.0)
    assert progress.remaining(17.0) == pytest.approx(17.0)
    assert progress.remaining(100.0) == 0.0
