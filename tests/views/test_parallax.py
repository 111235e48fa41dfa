"""Binocular parallax against the same formula in fifty digits, where float64's plain difference has few left."""

from decimal import Decimal, getcontext, localcontext

import numpy as np
import pytest

from stereo_reproject.views.camera import PerspectiveCamera, ViewPlane
from stereo_reproject.views.parallax import (
    ARC_MINUTE,
    is_wider_than_eyes,
    parallax_angle,
    parallax_at,
    parallax_difference,
    visible_parallax,
)

DIGITS = 60

RELATIVE_TOLERANCE = 8 * np.finfo(np.float64).eps
"""Half a dozen float64 operations, none of which cancels: the difference of two depths is exact to one rounding."""

NEAR_EQUAL = [
    # near, far, interocular distance
    (1.0, 1.0 + 1e-12, 0.065),
    (10.0, np.nextafter(10.0, 11.0), 0.065),
    (0.05, 0.05 + 1e-16, 0.2),
    (1e6, 1e6 + 1e-4, 0.065),
    (1e9, 1e9 + 1.0, 0.001),
    (1e12, 1e12 + 1e-3, 1.0),
]
ORDINARY = [(0.5, 3.0, 0.065), (0.01, 1e10, 0.5), (2.0, 2.0, 0.065), (1.0, 1e300, 0.065), (1e-3, 2e-3, 4.0)]


def arctan(x: Decimal) -> Decimal:
    """Taylor series, after halving the argument eight times: atan(x) = 2 atan(x / (1 + sqrt(1 + x²)))."""
    halvings = 8
    for _ in range(halvings):
        x = x / (1 + (1 + x * x).sqrt())
    total, power, k = Decimal(0), x, 0
    while k < 3 * DIGITS:
        total += (power if k % 2 == 0 else -power) / (2 * k + 1)
        power *= x * x
        k += 1
    return total * 2**halvings


def exact_difference(near: float, far: float, ipd: float) -> float:
    with localcontext() as context:
        context.prec = DIGITS
        half = Decimal(float(ipd)) / 2
        return float(2 * (arctan(half / Decimal(float(near))) - arctan(half / Decimal(float(far)))))


def test_the_yardstick_itself():
    with localcontext() as context:
        context.prec = DIGITS
        assert abs(float(4 * arctan(Decimal(1))) - np.pi) < 1e-15
    assert getcontext().prec < DIGITS, "the precision is ours alone"


@pytest.mark.parametrize(("near", "far", "ipd"), NEAR_EQUAL + ORDINARY)
def test_the_difference_is_exact_to_rounding(near, far, ipd):
    got = float(parallax_difference(np.array(near), np.array(far), ipd))
    assert got == pytest.approx(exact_difference(near, far, ipd), rel=RELATIVE_TOLERANCE, abs=0.0)


@pytest.mark.parametrize(("near", "far", "ipd"), NEAR_EQUAL)
def test_the_plain_difference_would_not_do(near, far, ipd):
    """The cases above are ones on which it has ten digits left at best, of sixteen."""
    plain = float(parallax_angle(np.array(near), ipd) - parallax_angle(np.array(far), ipd))
    assert plain != pytest.approx(exact_difference(near, far, ipd), rel=1e-10, abs=0.0)


def test_random_depths_agree_with_the_exact_formula():
    rng = np.random.default_rng(5)
    near = 10.0 ** rng.uniform(-2, 8, 60)
    far = near * (1.0 + 10.0 ** rng.uniform(-14, 4, 60))
    got = parallax_difference(near, far, 0.065)
    expected = [exact_difference(n, f, 0.065) for n, f in zip(near, far, strict=True)]
    np.testing.assert_allclose(got, expected, rtol=RELATIVE_TOLERANCE)


def test_sky():
    near = np.array([0.5, 3.0, 1e20, np.inf])
    got = parallax_difference(near, np.full(4, np.inf), 0.065)
    np.testing.assert_allclose(got[:3], parallax_angle(near[:3], 0.065), rtol=RELATIVE_TOLERANCE)
    assert got[3] == 0.0
    assert parallax_angle(np.array(np.inf), 0.065) == 0.0


def test_unknown_depths_stay_unknown():
    near = np.array([np.nan, 1.0, np.nan, np.nan])
    far = np.array([2.0, np.nan, np.nan, np.inf])
    assert np.all(np.isnan(parallax_difference(near, far, 0.065)))


def test_without_interocular_distance_there_is_no_parallax():
    depth = np.array([0.1, 1.0, 1e9, np.inf])
    np.testing.assert_array_equal(parallax_difference(depth, np.full(4, np.inf), 0.0), 0.0)
    np.testing.assert_array_equal(parallax_angle(depth, 0.0), 0.0)


def test_it_grows_with_the_gap_and_with_the_interocular_distance():
    far = np.geomspace(1.0, 1e8, 200)
    across = parallax_difference(np.ones(200), far, 0.065)
    assert across[0] == 0.0
    assert np.all(np.diff(across) > 0)
    ipds = np.geomspace(1e-4, 1.0, 50)
    wider = np.array([float(parallax_difference(np.array(2.0), np.array(5.0), ipd)) for ipd in ipds])
    assert np.all(np.diff(wider) > 0)


def test_float32_depths_are_taken_in_float64():
    near, far = np.float32([1.0, 100.0]), np.float32([1.0000001, 100.00001])
    got = parallax_difference(near, far, 0.065)
    assert got.dtype == np.float64
    expected = [exact_difference(n, f, 0.065) for n, f in zip(near, far, strict=True)]
    np.testing.assert_allclose(got, expected, rtol=RELATIVE_TOLERANCE)


def test_one_arc_minute():
    assert pytest.approx(1.0 / 60.0) == np.degrees(ARC_MINUTE)


# On the screen


def rig(convergence, *, ipd=0.065, width=200):
    """Off-axis eyes with the pivot at the left one; the view is one wide at unit depth."""
    shift = 0.5 * ipd / convergence
    right = np.eye(4)
    right[0, 3] = ipd
    left_eye = PerspectiveCamera(width, 100, np.eye(4), ViewPlane(-0.5, 0.5, -0.25, 0.25))
    plane = ViewPlane(-0.5 - 2.0 * shift, 0.5 - 2.0 * shift, -0.25, 0.25)
    return left_eye, PerspectiveCamera(width, 100, right, plane)


def test_what_is_at_the_convergence_has_no_parallax_and_what_is_behind_it_a_positive_one():
    eyes = rig(2.0)
    assert parallax_at(*eyes, 2.0, 200).pixels == pytest.approx(0.0, abs=1e-9)
    assert parallax_at(*eyes, 1.0, 200).pixels == pytest.approx(-200 * 0.065 * (1.0 - 0.5))
    assert parallax_at(*eyes, 8.0, 200).percent == pytest.approx(100 * 0.065 * (0.5 - 0.125))


def test_the_sky_has_the_greatest_parallax():
    sky = parallax_at(*rig(2.0), np.inf, 200)
    assert sky.percent == pytest.approx(100 * 0.065 / 2.0)


def test_nearest_and_farthest_of_what_is_seen():
    depth = np.array([[0.0, 3.0, np.nan], [-1.0, 1.5, np.inf]])
    near, far = visible_parallax(*rig(2.0), depth, 200)
    assert (near.depth, far.depth) == (1.5, np.inf)
    assert near.pixels < 0.0 < far.pixels
    assert visible_parallax(*rig(2.0), np.array([[np.nan, 0.0]]), 200) is None


def test_a_cut_out_of_the_frame_has_the_frame_s_percent():
    left, right = rig(2.0, width=200)
    assert parallax_at(left, right, 8.0, 400).percent == pytest.approx(0.5 * parallax_at(left, right, 8.0, 200).percent)


def test_eyes_need_not_turn_outwards_on_a_small_screen():
    far = parallax_at(*rig(1.0), np.inf, 200)  # 6.5 % of the width
    assert not is_wider_than_eyes(far, 0.99, 0.065)
    assert is_wider_than_eyes(far, 1.01, 0.065)
    assert not is_wider_than_eyes(parallax_at(*rig(1.0), 0.01, 200), 10.0, 0.065), "in front of the screen eyes cross"
