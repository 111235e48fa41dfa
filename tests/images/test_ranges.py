"""Warnings of values that a file cannot hold, or that no light has."""

import numpy as np
import pytest

from stereo_reproject.images.ranges import MAX_HALF_FLOAT, range_warnings

SHAPE = (4, 5)


def eye(**changes):
    passes = {"Combined": np.ones((*SHAPE, 4), np.float32), "Depth": np.full((*SHAPE, 1), 1e9, np.float32)}
    return passes | {name: np.ones((*SHAPE, count), np.float32) for name, count in changes.items()}


@pytest.mark.parametrize("half", [False, True])
def test_an_ordinary_eye_is_passed_without_a_word(half):
    passes = eye(Position=3, CryptoObject00=4)
    passes["Combined"][0, 0] = MAX_HALF_FLOAT
    passes["Position"][:] = -1e6
    passes["CryptoObject00"][:] = 1e30
    assert range_warnings(passes, view="left", half=half) == []


def test_negative_light_is_counted_by_pixel():
    passes = eye()
    passes["Combined"][1, 2, :3] = passes["Combined"][3, 0, 1] = -1e-6
    (line,) = range_warnings(passes, view="right", half=False)
    assert line.startswith("2 pixels of the right eye are negative")


@pytest.mark.parametrize("name", ["Combined", "Depth"])
def test_values_that_are_no_number_are_counted_by_pass(name):
    passes = eye()
    passes[name][0, 1, 0] = np.nan
    passes["Depth"][3, 3] = np.inf
    (line,) = range_warnings(passes, view="left", half=True)
    assert line == f"1 pixels of the left eye's {name} pass are no numbers"


@pytest.mark.parametrize("name", ["Combined", "Diffuse Direct", "Combined_Sun", "Normal map"])
@pytest.mark.parametrize("value", [65536.0, np.inf])
def test_values_beyond_half_floats_are_counted_by_pass(name, value):
    passes = eye(**{"Diffuse Direct": 3, "Combined_Sun": 3, "Normal map": 4})
    passes[name][2, 2, 0] = value
    assert range_warnings(passes, view="left", half=False) == []
    (line,) = range_warnings(passes, view="left", half=True)
    assert line.startswith(f"1 pixels of the left eye's {name} pass are beyond")
    assert "\n" not in line
