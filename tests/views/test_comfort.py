"""Limits of comfort and rigs that keep a scene within them, against the geometry of a screen and of two eyes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereo_reproject.errors import BadInputError
from stereo_reproject.views.camera import PerspectiveCamera, ViewPlane
from stereo_reproject.views.comfort import (
    BROADCAST,
    MAX_VERGENCE_DEGREES,
    Fit,
    Limits,
    Viewing,
    comfort_limits,
    conflict_dioptres,
    depth_at_parallax,
    fit_limits,
    fit_off_axis,
    fit_parallel,
    unit_width,
    vergence_degrees,
)
from stereo_reproject.views.parallax import parallax_at
from tests.warp.analytic import stereo_rig

MONITOR, CINEMA = Viewing(0.6, 0.065, 1.7), Viewing(10.0, 0.065, 1.7)

FRAME_WIDTH = 200
UNIT_WIDTH = 0.8

PERCENT_TOLERANCE = 1e-6
"""Percent of the width: doubles keep some twelve digits through both formulas, and a pixel is a twentieth of it."""


def rig_of(fit, *, parallel=False):
    """Eyes with these settings, the pivot at the left one, whose view is UNIT_WIDTH wide at unit depth."""
    shift = 0.0 if parallel else fit.interocular / fit.screen_depth
    right = np.eye(4)
    right[0, 3] = fit.interocular
    half = 0.5 * UNIT_WIDTH
    left_eye = PerspectiveCamera(FRAME_WIDTH, 100, np.eye(4), ViewPlane(-half, half, -0.2, 0.2))
    plane = ViewPlane(-half - shift, half - shift, -0.2, 0.2)
    return left_eye, PerspectiveCamera(FRAME_WIDTH, 100, right, plane)


def percent(fit, depth, **how):
    return parallax_at(*rig_of(fit, **how), depth, FRAME_WIDTH).percent


VIEWINGS = st.builds(Viewing, st.floats(0.05, 30.0), st.floats(0.04, 0.08), st.floats(0.3, 6.0))


@given(VIEWINGS)
def test_eyes_turn_by_one_degree_to_the_limits_unless_they_would_turn_apart(viewing):
    limits = comfort_limits(viewing)
    assert vergence_degrees(limits.near, viewing) == pytest.approx(-MAX_VERGENCE_DEGREES, rel=1e-9)
    outwards = vergence_degrees(limits.far, viewing)
    assert limits.far <= viewing.eyes_percent * (1.0 + 1e-12)
    assert outwards == pytest.approx(MAX_VERGENCE_DEGREES, rel=1e-9) or (
        limits.far == pytest.approx(viewing.eyes_percent) and outwards < MAX_VERGENCE_DEGREES
    )


def test_a_cinema_s_far_limit_is_the_distance_between_the_eyes():
    assert comfort_limits(CINEMA).far == pytest.approx(0.65)
    assert comfort_limits(MONITOR).far == pytest.approx(3.0, abs=0.05), "the rule of thumb of three percent"


def test_the_screen_itself_asks_nothing_of_the_eyes():
    assert vergence_degrees(0.0, MONITOR) == conflict_dioptres(0.0, MONITOR) == 0.0


def test_eyes_that_look_straight_ahead_focus_on_the_screen_nevertheless():
    """At infinity the conflict is the whole of what the eyes focus: one over the distance of the screen in metres."""
    assert conflict_dioptres(MONITOR.eyes_percent, MONITOR) == pytest.approx(1.0 / (1.7 * 0.6))
    # Half way to the screen, both pictures of a point are apart by the distance of the eyes.
    assert conflict_dioptres(-MONITOR.eyes_percent, MONITOR) == pytest.approx(-1.0 / (1.7 * 0.6))


@given(VIEWINGS, st.floats(-5.0, 0.0), st.floats(0.0, 5.0))
def test_a_budget_is_kept_and_so_is_comfort(viewing, near, far):
    limits, comfort = fit_limits(viewing, Limits(near, far)), comfort_limits(viewing)
    assert max(near, comfort.near) == limits.near <= 0.0 <= limits.far == min(far, comfort.far)


@given(
    near=st.floats(0.01, 1e4),
    ratio=st.one_of(st.floats(1.3, 1e4), st.just(math.inf)),
    limits=st.builds(Limits, st.floats(-3.0, -0.1), st.floats(0.1, 3.0)),
)
def test_both_ends_are_at_their_limits_after_a_fit(near, ratio, limits):
    fit = fit_off_axis(near, near * ratio, limits, UNIT_WIDTH, math.inf)
    assert percent(fit, near) == pytest.approx(limits.near, abs=PERCENT_TOLERANCE)
    assert percent(fit, near * ratio) == pytest.approx(limits.far, abs=PERCENT_TOLERANCE)
    assert fit.depth_at(limits.near, UNIT_WIDTH) == pytest.approx(near, rel=1e-6)


@given(near=st.floats(0.01, 1e4), ratio=st.floats(1.0, 1e6), eyes=st.floats(0.2, 20.0))
def test_infinity_is_never_wider_than_the_eyes(near, ratio, eyes):
    limits = Limits(-1.0, min(2.0, eyes))
    fit = fit_off_axis(near, near * ratio, limits, UNIT_WIDTH, eyes)
    assert percent(fit, math.inf) <= eyes + PERCENT_TOLERANCE
    assert percent(fit, near) == pytest.approx(-1.0, abs=PERCENT_TOLERANCE)
    assert percent(fit, near * ratio) <= limits.far + PERCENT_TOLERANCE


def test_a_flat_scene_has_a_fit_too():
    fit = fit_off_axis(4.0, 4.0, BROADCAST, UNIT_WIDTH, MONITOR.eyes_percent)
    assert percent(fit, 4.0) == pytest.approx(-1.0)
    assert 0.0 < fit.interocular < 1.0


def test_parallel_eyes_have_infinity_at_the_screen_and_the_nearest_point_at_its_limit():
    fit = fit_parallel(2.5, Limits(-1.0, 2.0), UNIT_WIDTH)
    assert percent(fit, 2.5, parallel=True) == pytest.approx(-1.0)
    assert percent(fit, math.inf, parallel=True) == pytest.approx(0.0, abs=PERCENT_TOLERANCE)


@pytest.mark.parametrize(("near", "far"), [(0.0, 1.0), (2.0, 1.0), (math.inf, math.inf), (-1.0, 1.0)])
def test_depths_that_are_none_are_refused(near, far):
    with pytest.raises(BadInputError, match="cannot be fitted"):
        fit_off_axis(near, far, BROADCAST, UNIT_WIDTH, 10.0)


def test_a_sky_needs_depth_behind_the_screen_and_a_wall_does_not():
    in_front = Limits(-1.0, 0.0)
    with pytest.raises(BadInputError, match="raise Behind"):
        fit_off_axis(1.0, math.inf, in_front, UNIT_WIDTH, 10.0)
    fit = fit_off_axis(1.0, 8.0, in_front, UNIT_WIDTH, 10.0)
    assert percent(fit, 8.0) == pytest.approx(0.0, abs=PERCENT_TOLERANCE)


def test_parallel_eyes_need_depth_in_front_of_the_screen():
    with pytest.raises(BadInputError, match="raise In Front"):
        fit_parallel(1.0, Limits(0.0, 2.0), UNIT_WIDTH)


def test_conditions_that_nobody_has_are_refused():
    with pytest.raises(BadInputError, match="above 0"):
        Viewing(0.6, 0.0, 1.7)


def test_a_part_of_the_frame_is_as_wide_as_the_frame():
    left, _ = rig_of(Fit(0.1, 2.0))
    assert unit_width(left, FRAME_WIDTH) == pytest.approx(UNIT_WIDTH)
    assert unit_width(left, 2 * FRAME_WIDTH) == pytest.approx(2.0 * UNIT_WIDTH)


@pytest.mark.parametrize("mode", ["off-axis", "parallel", "toe-in"])
@pytest.mark.parametrize("depth", [1.0, 3.7, 60.0])
def test_a_depth_is_found_again_by_its_parallax(mode, depth):
    eyes = stereo_rig((120, 80), mode=mode, ipd=0.1, convergence=4.0)
    seen = parallax_at(eyes["left"], eyes["right"], depth, 120)
    found = depth_at_parallax(eyes["left"], eyes["right"], seen.percent, 120)
    assert found == pytest.approx(depth, rel=1e-5)


def test_no_depth_is_wider_apart_than_infinity():
    left, right = rig_of(Fit(0.1, 2.0))
    sky = percent(Fit(0.1, 2.0), math.inf)
    assert depth_at_parallax(left, right, sky + 0.1, FRAME_WIDTH) is None
    assert depth_at_parallax(left, right, sky, FRAME_WIDTH) == math.inf


def test_eyes_at_one_place_and_parallel_rays_have_no_depth_by_parallax():
    assert depth_at_parallax(*rig_of(Fit(0.0, 2.0)), 0.0, FRAME_WIDTH) is None
    flat = stereo_rig((120, 80), mode="off-axis", orthographic=True)
    assert depth_at_parallax(flat["left"], flat["right"], 0.0, 120) is None
