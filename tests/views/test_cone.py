"""Views side by side: the focus plane stands still in all of them, and what is before or behind it moves evenly."""

import numpy as np
import pytest

from stereo_reproject.views.cone import beside, cone_baseline, cone_degrees, offsets_of
from tests.warp.exact import Rig

FOCUS = 5.0


def places(points, offsets):
    """Return x in pixels (views, N) at which cameras at these offsets see points (N, 3)."""
    camera, _ = Rig(size=(300, 200), ipd=0.0, shift=(0.1, -0.05)).eyes
    found = []
    for offset in offsets:
        view = beside(camera, offset, FOCUS)
        inverse = np.linalg.inv(view.world_from_camera)
        local = points @ inverse[:3, :3].T + inverse[:3, 3]
        found.append(view.px_from_point(tuple(local.T), np.ones(len(points))))
    return np.array(found)


def test_the_focus_plane_stands_still_and_all_else_moves_evenly():
    points = np.array([[0.3, 0.2, -FOCUS], [0.3, 0.2, -2.0], [0.3, 0.2, -50.0]])
    x, y, depth = places(points, offsets_of(5, 1.0)).transpose(1, 2, 0)
    np.testing.assert_allclose(x[0], x[0, 0], atol=1e-9)
    near, far = np.diff(x[1]), np.diff(x[2])
    assert (near < -1.0).all()
    assert (far > 1.0).all()
    for steps in (near, far):
        np.testing.assert_allclose(steps, steps[0], rtol=1e-9)
    np.testing.assert_allclose(y, y[:, :1] * np.ones(5), atol=1e-9)
    np.testing.assert_allclose(depth, -points[:, 2:] * np.ones(5), rtol=1e-12)


def test_offsets_go_from_left_to_right_around_the_camera():
    assert offsets_of(2, 3.0) == [-1.5, 1.5]
    np.testing.assert_allclose(offsets_of(5, 2.0), [-1.0, -0.5, 0.0, 0.5, 1.0])


@pytest.mark.parametrize("degrees", [1.0, 40.0, 120.0])
def test_the_cone_is_the_angle_between_the_outermost_cameras(degrees):
    baseline = cone_baseline(degrees, FOCUS)
    sides = np.array([[-0.5 * baseline, FOCUS], [0.5 * baseline, FOCUS]])
    cosine = sides[0] @ sides[1] / np.prod(np.linalg.norm(sides, axis=1))
    assert np.degrees(np.arccos(cosine)) == pytest.approx(degrees)
    assert cone_degrees(baseline, FOCUS) == pytest.approx(degrees)
