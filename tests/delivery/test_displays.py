"""Known light-field displays: a grid that the quilt's pixels hold, and names that can be typed."""

import re

import pytest

from stereo_reproject.delivery.displays import DISPLAYS, display_of
from stereo_reproject.errors import BadInputError

ALL = list(DISPLAYS.values())


@pytest.mark.parametrize("display", ALL, ids=lambda display: display.name)
def test_a_view_is_as_large_as_its_place_in_the_quilt(display):
    width, height = display.view_size()
    assert 0 <= display.quilt_size[0] - display.columns * width < display.columns
    assert 0 <= display.quilt_size[1] - display.rows * height < display.rows
    assert 40 <= display.count <= 256
    assert 30.0 <= display.cone_degrees <= 60.0


@pytest.mark.parametrize("display", ALL, ids=lambda display: display.name)
def test_a_name_can_be_typed(display):
    assert re.fullmatch(r"[a-z0-9.-]+", display.name)
    assert display_of(display.name) is display


def test_the_portrait_is_as_its_maker_says():
    portrait = DISPLAYS["portrait"]
    assert (portrait.count, portrait.view_size(), portrait.aspect) == (48, (420, 560), 420 / 560)


def test_with_another_grid_its_views_have_another_size():
    assert DISPLAYS["portrait"].view_size(6, 5) == (560, 672)


@pytest.mark.parametrize("name", ["", "Portrait", "27", 65, None, ["go"]])
def test_an_unknown_display_is_bad_input(name):
    with pytest.raises(BadInputError, match="the display must be one of portrait, go, "):
        display_of(name)
