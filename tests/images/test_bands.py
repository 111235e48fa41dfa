"""Bands: worked on by several threads with the result of one, and with nothing left that runs."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

from stereo_reproject.images import bands
from stereo_reproject.images.bands import by_bands, over_bands
from stereo_reproject.images.contrast import box_sum, contrast_of
from stereo_reproject.images.lookup import lookup
from stereo_reproject.images.metrics import channel_sum, judged, tone
from stereo_reproject.images.sharpness import pixel_noise

CORES = (1, 4)
ROW_PIXELS = 60
"""Pixels of a band in these tests: a few rows of their pictures."""


@pytest.fixture(autouse=True)
def small_bands(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bands, "BAND_PIXELS", ROW_PIXELS)


def test_a_picture_is_the_same_on_one_core_and_on_several(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    colour = rng.exponential(1.0, (41, 23, 4)).astype(np.float32)
    x, y = rng.uniform(0.0, 23.0, (41, 23)).astype(np.float32), rng.uniform(0.0, 41.0, (41, 23)).astype(np.float32)
    known = rng.random((41, 23)) > 0.1
    results = []
    for cores in CORES:
        monkeypatch.setattr(bands, "usable_cores", lambda cores=cores: cores)
        contrast = contrast_of(colour, known)
        cubic = lookup(colour, x, y, interpolation="cubic")
        results.append([cubic, contrast.signal, contrast.noise, pixel_noise(colour), box_sum(known, (2, 5))])
    for one, several in zip(*results, strict=True):
        np.testing.assert_array_equal(one, several)


def test_several_bands_are_worked_on_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bands, "usable_cores", lambda: 2)
    both = threading.Barrier(2)

    def meet(_: slice) -> None:
        both.wait(timeout=10.0)

    over_bands((4, ROW_PIXELS // 2), meet)


def test_an_error_in_a_band_is_raised_and_no_thread_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    """Blender 4.5 may crash where a thread of Python's runs beside a render."""
    monkeypatch.setattr(bands, "usable_cores", lambda: 4)
    before = threading.active_count()

    def work(rows: slice) -> None:
        time.sleep(0.01)
        if rows.start == 0:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        over_bands((40, ROW_PIXELS), work)
    assert threading.active_count() == before


def test_an_empty_picture_has_an_empty_result() -> None:
    assert by_bands(lambda image: image + 1.0, np.empty((0, 7, 3), np.float32)).shape == (0, 7, 3)


@pytest.mark.parametrize("channels", [0, 3, 4])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_channels_add_up_as_numpy_adds_them(channels: int, dtype: type) -> None:
    values = np.random.default_rng(2).normal(0.0, 100.0, (50, 40, channels)).astype(dtype)
    before = values.copy()
    np.testing.assert_array_equal(channel_sum(values), np.sum(values, axis=-1))
    np.testing.assert_array_equal(values, before)


def test_a_judged_colour_has_its_toned_light_and_its_alpha() -> None:
    colour = np.random.default_rng(3).normal(0.5, 1.0, (9, 8, 4)).astype(np.float32)
    before = colour.copy()
    expected = np.concatenate([tone(colour), np.clip(colour[..., 3:], 0.0, 1.0)], axis=-1)
    np.testing.assert_array_equal(judged(colour), expected)
    np.testing.assert_array_equal(colour, before)


@pytest.mark.parametrize("reach", [(0, 0), (1, 1), (2, 5), (30, 30)])
def test_a_box_sum_adds_up_the_pixels_within_reach(reach: tuple[int, int]) -> None:
    image = np.random.default_rng(4).integers(0, 9, (11, 13)).astype(np.float32)
    padded = np.pad(image, [(reach[0], reach[0]), (reach[1], reach[1])])
    windows = np.lib.stride_tricks.sliding_window_view(padded, (2 * reach[0] + 1, 2 * reach[1] + 1))
    np.testing.assert_array_equal(box_sum(image, reach), windows.sum(axis=(2, 3)))
