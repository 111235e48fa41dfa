"""Who carries pixels over: what was asked for, numpy without a GPU, and left free the faster of the two."""

import pytest

from stereo_reproject.pipeline.shared_findings import SharedFindings
from stereo_reproject.warp import stage as warp_stage
from stereo_reproject.warp.stage import choose_warper, seconds_taken
from stereo_reproject.warp.tuning import TUNING as WARP_TUNING
from stereo_reproject.warp.warper import NUMPY, Warper, warp_view

GPU = Warper(warp_view, "A graphics card")


def never(*_):
    raise AssertionError("nobody asked for that")


def test_numpy_is_taken_without_a_look_for_a_gpu():
    assert choose_warper("numpy", 10 * WARP_TUNING.least_gpu_pixels, never, never) is NUMPY


def test_left_free_a_small_picture_starts_no_gpu():
    assert choose_warper("auto", WARP_TUNING.least_gpu_pixels - 1, never, never) is NUMPY


@pytest.mark.parametrize(("faster", "chosen"), [(True, GPU), (False, NUMPY)])
def test_left_free_a_large_picture_has_the_faster_one(faster, chosen):
    measured = []

    def is_faster(stage):
        measured.append(stage)
        return faster

    assert choose_warper("auto", WARP_TUNING.least_gpu_pixels, lambda: GPU, is_faster) is chosen
    assert measured == [GPU]


def test_what_was_asked_for_is_not_measured():
    assert choose_warper("gpu", 1, lambda: GPU, never) is GPU


@pytest.mark.parametrize("asked", ["auto", "gpu"])
def test_without_a_gpu_it_is_numpy(asked):
    assert choose_warper(asked, WARP_TUNING.least_gpu_pixels, lambda: None, never) is NUMPY


def test_the_seconds_are_those_of_the_run(monkeypatch):
    now = [5.0]
    monkeypatch.setattr(warp_stage.time, "perf_counter", lambda: now[0])

    def work(warper):
        assert warper is GPU
        now[0] += 2.5

    assert seconds_taken(work, GPU) == 2.5


def test_for_a_frame_on_its_own_measuring_costs_more_than_it_saves():
    assert SharedFindings().gpu_is_faster(never) is False
