"""Settings of many views check themselves, and take from a display what nobody has said."""

import dataclasses
import math

import pytest

from stereo_reproject.delivery.displays import DISPLAYS
from stereo_reproject.errors import BadInputError
from stereo_reproject.settings.views import ViewsSettings, read_quilt, views_settings

NO_NUMBERS = [math.nan, math.inf, -math.inf, "40", "", [1.0], True]

BAD = [
    *[("count", value) for value in [0, 1, -2, 257, 48.0, "48", True, math.nan, None]],
    *[("cone_degrees", value) for value in [*NO_NUMBERS, 0.0, -1.0, 180.0, 400, 10**400]],
    *[("baseline", value) for value in [*NO_NUMBERS, 0.0, -0.1]],
    *[("focus_distance", value) for value in [*NO_NUMBERS, 0.0, -3]],
    *[("columns", value) for value in [0, -8, 8.0, "8", None, 257, 5]],
    *[("rows", value) for value in [0, -6, 6.0, True, None, 257, 5]],
    *[("aspect", value) for value in [*NO_NUMBERS, 0.0, -0.75, 101.0, 0.001]],
    *[("fresh", value) for value in [*NO_NUMBERS, -0.1, 1.01, None]],
    *[("display", value) for value in ["", "27", 65, ["go"]]],
]


def fields(**changed):
    plain = {"count": 48, "columns": 8, "rows": 6, **changed}
    return plain if plain.get("baseline") is not None else {"cone_degrees": 40.0, **plain}


@pytest.mark.parametrize(("name", "value"), BAD)
def test_a_bad_value_is_bad_input_in_one_line(name, value):
    with pytest.raises(BadInputError) as raised:
        ViewsSettings(**fields(**{name: value}))
    assert "\n" not in str(raised.value)
    assert "must" in str(raised.value)
    named = {"count": "views", "cone_degrees": "cone", "columns": "quilt", "rows": "quilt"}
    assert named.get(name, name).split("_", maxsplit=1)[0] in str(raised.value)


@pytest.mark.parametrize("both", [{}, {"cone_degrees": 40.0, "baseline": 0.5}])
def test_either_the_cone_or_the_baseline(both):
    with pytest.raises(BadInputError, match="either the cone or the baseline"):
        ViewsSettings(48, **both)


def test_settings_are_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        ViewsSettings(48, 40.0).count = 2


def test_names_go_from_the_left_and_have_two_digits_at_least():
    assert ViewsSettings(2, 40.0).names == ("view_00", "view_01")
    assert ViewsSettings(101, 40.0).names[99:] == ("view_099", "view_100")


def test_the_usual_ones():
    assert views_settings() == ViewsSettings(48, 40.0, columns=8, rows=6)


@pytest.mark.parametrize("name", DISPLAYS)
def test_a_display_says_all_that_nobody_else_does(name):
    display, found = DISPLAYS[name], views_settings(display=name)
    assert (found.columns, found.rows, found.count) == (display.columns, display.rows, display.count)
    assert (found.cone_degrees, found.baseline, found.aspect) == (display.cone_degrees, None, display.aspect)
    assert found.view_size == display.view_size()


def test_what_is_said_goes_before_the_display():
    found = views_settings(display="go", count=20, baseline=0.5, focus_distance=2.0, quilt=(5, 4), aspect=1.0)
    assert found == ViewsSettings(20, None, 0.5, 2.0, 5, 4, 1.0, "go")
    assert found.view_size == DISPLAYS["go"].view_size(5, 4)
    assert views_settings(display="go", cone_degrees=20.0).count == 66


def test_number_and_quilt_say_each_other():
    assert (views_settings(quilt=(5, 9)).count, views_settings(count=45).columns) == (45, 9)
    assert views_settings(display="16-gen2", count=45).columns == 5
    assert views_settings(display="16-gen2", count=30).columns == 6


@pytest.mark.parametrize("count", [0, 1, 257, 10**9])
def test_a_number_that_nobody_wants_is_refused_at_once(count):
    with pytest.raises(BadInputError, match="the number of views must be from 2 to 256"):
        views_settings(count=count)


def test_a_quilt_as_people_write_it():
    assert read_quilt("8x6") == read_quilt("8X6") == (8, 6)


@pytest.mark.parametrize("text", ["", "8", "8x", "x6", "0x6", "8x6x2", "-8x6", "8 x 6", "8.0x6", "a" * 99])
def test_what_is_no_quilt(text):
    with pytest.raises(BadInputError, match="of the form COLUMNSxROWS"):
        read_quilt(text)


def test_the_scenes_own_views_are_counted_by_it():
    views = ViewsSettings(0, columns=2, rows=2, from_scene=True)
    assert views.names == ()
    views.check_places(4)
    with pytest.raises(BadInputError, match="a place for each of the 5 views"):
        views.check_places(5)


@pytest.mark.parametrize("said", [{"count": 4}, {"cone_degrees": 20.0}, {"baseline": 1.0}, {"display": "go"}])
def test_nothing_else_says_where_the_scenes_own_views_stand(said):
    with pytest.raises(BadInputError, match="leave --views"):
        ViewsSettings(**{"count": 0, **said}, from_scene=True)


def test_a_layout_that_is_none():
    with pytest.raises(BadInputError, match="the layout must be one of individual, multi-view"):
        ViewsSettings(48, 40.0, layout="quilt")
