"""Accuracy settings: what they promise, and what a tolerance makes of them."""

from dataclasses import replace

import pytest

from stereo_reproject.errors import BadInputError
from stereo_reproject.pipeline.next_accuracy import WHOLE, next_better
from stereo_reproject.settings.accuracy import SETTINGS, accuracy_of, for_denoised, for_size
from stereo_reproject.settings.frame import ACCURACIES, CUSTOM, StereoSettings


def test_the_settings_are_those_that_users_choose_from_and_grow_stricter():
    assert tuple(SETTINGS) == ACCURACIES
    promises = [SETTINGS[name].promise for name in ACCURACIES]
    assert promises == [None, 1.25, 1.1, 1.05, 1.02]
    limits = [SETTINGS[name].tile_limit for name in ACCURACIES[1:]]
    assert limits == sorted(limits, reverse=True)
    assert [name for name in ACCURACIES if SETTINGS[name].promises_worst_tiles] == ["exact"]
    assert SETTINGS["exact"].tile_limit == 1.2


@pytest.mark.parametrize(
    ("tolerance", "like"), [(1.5, "preview"), (1.25, "preview"), (1.2, "preview"), (1.07, "balanced"), (1.001, "exact")]
)
def test_a_tolerance_is_promised_with_all_else_of_the_setting_that_promises_less(tolerance, like):
    settings = StereoSettings(tolerance=tolerance)
    assert settings.accuracy == CUSTOM
    accuracy = accuracy_of(settings)
    assert accuracy.promise == tolerance
    assert accuracy.silhouette_step == SETTINGS[like].silhouette_step


@pytest.mark.parametrize("tolerance", [1.0, 0.5, 0, -1.0, float("nan"), float("inf"), "1.1", True])
def test_a_tolerance_that_no_render_could_keep_is_refused(tolerance):
    with pytest.raises(BadInputError, match="tolerance"):
        StereoSettings(tolerance=tolerance)


def test_accuracy_and_tolerance_are_two_ways_to_say_the_same():
    with pytest.raises(BadInputError, match="one of them"):
        StereoSettings(accuracy="high", tolerance=1.07)
    with pytest.raises(BadInputError, match="accuracy"):
        StereoSettings(accuracy=CUSTOM)


def test_settings_survive_the_way_to_the_worker():
    settings = StereoSettings(tolerance=1.07)
    assert StereoSettings(accuracy=settings.accuracy, tolerance=settings.tolerance) == settings


def test_the_next_better_setting_promises_more_until_there_is_none():
    following = {name: next_better(SETTINGS[name]) for name in ACCURACIES}
    assert following == {
        "draft": "preview",
        "preview": "balanced",
        "balanced": "high",
        "high": "exact",
        "exact": WHOLE,
    }
    assert next_better(accuracy_of(StereoSettings(tolerance=1.07))) == "high"
    assert next_better(accuracy_of(StereoSettings(tolerance=1.001))) == WHOLE


@pytest.mark.parametrize(
    ("name", "size", "spacing"),
    [
        ("balanced", (320, 180), 8),
        ("balanced", (480, 270), 8),
        ("balanced", (640, 360), 8),
        ("balanced", (800, 450), 10),
        ("balanced", (960, 540), 12),
        ("balanced", (1280, 720), 16),
        ("balanced", (7680, 4320), 16),
        ("high", (960, 540), 12),
        ("preview", (480, 270), 12),
        ("preview", (960, 540), 18),
        ("preview", (1920, 1080), 24),
        ("exact", (320, 180), 6),
        ("exact", (7680, 4320), 6),
    ],
)
def test_tiles_grow_with_pictures_but_where_the_worst_are_promised_something(name, size, spacing):
    sized = for_size(SETTINGS[name], size[0] * size[1])
    assert sized == replace(SETTINGS[name], probe_spacing=spacing)


@pytest.mark.parametrize(
    ("name", "size", "spacing"),
    [
        ("balanced", (480, 270), 6),
        ("balanced", (960, 540), 6),
        ("balanced", (1920, 1080), 8),
        ("preview", (960, 540), 9),
        ("exact", (960, 540), 6),
    ],
)
def test_tiles_of_denoised_pictures_are_smaller(name, size, spacing):
    assert for_denoised(for_size(SETTINGS[name], size[0] * size[1])).probe_spacing == spacing
