"""The comparison of the two packed cameras, by what it makes of given pictures and turns."""

import numpy as np
import pytest

from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS
from tests.bench.packed_cameras import Measured, Turn, pass_errors, rows

SHAPE = (40, 60)


def noisy(seed, *, off=0.0):
    rng = np.random.default_rng(seed)
    colour = 0.5 + off + 0.05 * rng.standard_normal((*SHAPE, 4))
    return {COLOUR_PASS: colour.astype(np.float32), DEPTH_PASS: np.full((*SHAPE, 1), 3.0, np.float32)}


def test_another_plain_render_has_the_error_of_one_and_no_bias():
    errors = pass_errors(noisy(1), [noisy(2), noisy(3)], np.ones(SHAPE, bool))
    colour = errors[COLOUR_PASS]
    assert colour.error == pytest.approx(1.0, abs=0.05)
    assert abs(colour.bias) < 4.0 * colour.bias_error
    assert errors[DEPTH_PASS].error == 1.0


def test_what_is_brighter_at_traced_pixels_is_biased():
    traced = np.zeros(SHAPE, bool)
    traced[::2] = True
    ours = noisy(1, off=0.1)
    colour = pass_errors(ours, [noisy(2), noisy(3)], traced)[COLOUR_PASS]
    assert colour.error > 1.2
    assert colour.bias > 10.0 * colour.bias_error
    ours[COLOUR_PASS][traced] = noisy(1)[COLOUR_PASS][traced]
    assert abs(pass_errors(ours, [noisy(2), noisy(3)], traced)[COLOUR_PASS].bias) < 0.01


def test_a_row_has_the_medians_of_a_camera_and_the_portals_speedup_over_osl():
    turns = [
        Turn("osl", 10.0, 16.0, 1.0, 0.1, 0.12, 1.01, 0.99, 1.1, None),
        Turn("portal", 12.5, 18.0, 3.0, 0.1, 0.12, 1.02, None, 1.2, (1.01, 1.0, 1.02)),
    ]
    osl, portal = rows(Measured("room", 9.0, 1.0, 8.0, 14.4, turns), ["osl", "portal"])
    assert osl.startswith("| room | osl | 1.60 | 1.80 | 1.010 | 0.990 |")
    assert portal.startswith("| room | portal | 1.28 | 1.44 | 1.020 | – |")
    # 3 s, where 1.25 x 0.12 x 8 s + 1 s are allowed.
    assert portal.endswith("| 10.0% | 3.00 s | 1.36 | 0.800 | 1.60 | 0.889 |")
