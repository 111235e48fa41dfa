"""Edges out of focus: as wide as the lens blurs them, and traced where that shows."""

import numpy as np
import pytest

from stereo_reproject.holes.defocus import blurred_edges, circle_of_confusion, in_focus, nearer_side
from stereo_reproject.images.contrast import contrast_of, gradient_of
from stereo_reproject.views.camera import OrthographicCamera, PerspectiveCamera, ViewPlane
from stereo_reproject.views.frustum import Lens
from stereo_reproject.warp.discontinuities import disparity_steps

CAMERA = PerspectiveCamera(200, 100, np.eye(4), ViewPlane(-0.5, 0.5, -0.25, 0.25))
LENS = Lens(aperture=0.05, focus=4.0)
SIZE = (60, 120)
EDGE = 60


def test_the_circle_of_confusion_is_where_the_lens_s_rim_sees_a_point():
    """Through the point from the rim and from the middle, on the plane at distance 1: traced by hand."""
    for depth in (0.5, 2.0, 9.0, np.inf):
        at_focus = LENS.aperture * (1.0 - LENS.focus / depth)  # height at which a ray rim-point crosses the focal plane
        expected = abs(at_focus) / LENS.focus * 200.0
        blur = circle_of_confusion(np.full((2, 2), depth), CAMERA, LENS)
        assert blur == pytest.approx(expected, rel=1e-5)
    assert circle_of_confusion(np.full((2, 2), 4.0), CAMERA, LENS).max() < 1e-5


def test_without_an_aperture_nothing_is_blurred():
    depth = np.full((3, 3), 0.7)
    assert not circle_of_confusion(depth, CAMERA, Lens()).any()
    assert not circle_of_confusion(depth, OrthographicCamera(200, 100, np.eye(4), CAMERA.plane), LENS).any()
    assert np.isfinite(circle_of_confusion(np.array([[np.nan, 0.0]]), CAMERA, LENS)).all()


def edge(*, blur, step, difference, noise=0.0):
    """A near side on the left, blurred over `blur` pixels each way, and a far side that is another grey."""
    x = np.arange(SIZE[1]) + 0.5 - EDGE
    share = np.clip(0.5 - x / (2.0 * blur), 0.0, 1.0)
    grey = 0.3 + difference * np.broadcast_to(share, SIZE)
    colour = np.repeat(grey[..., None], 4, axis=2).astype(np.float32)
    colour += np.random.default_rng(1).normal(0.0, noise, (*SIZE, 1)).astype(np.float32)
    disparity = np.where(x < 0, 10.0 + step, 10.0) + np.zeros(SIZE)
    radius = nearer_side(np.where(x < 0, blur, 0.0).astype(np.float32) + np.zeros(SIZE, np.float32), disparity)
    known = np.ones(SIZE, bool)
    return disparity_steps(disparity.astype(np.float32)), radius, gradient_of(colour, known), contrast_of(colour, known)


def test_as_far_as_the_blur_reaches_an_edge_is_traced():
    flagged = blurred_edges(*edge(blur=8.0, step=6.0, difference=0.5), threshold=0.25, tolerance=0.5)
    across = flagged[30]
    assert across[EDGE - 6 : EDGE + 6].all()
    assert not across[: EDGE - 12].any()
    assert not across[EDGE + 12 :].any()


def test_a_blur_that_shows_nothing_is_left_alone():
    for same in ({"step": 6.0, "difference": 0.0}, {"step": 0.0, "difference": 0.5}):
        assert not blurred_edges(*edge(blur=8.0, **same), threshold=0.25, tolerance=0.5).any()


def test_a_blur_within_the_noise_is_left_alone():
    noisy = edge(blur=8.0, step=2.0, difference=0.1, noise=0.1)
    assert blurred_edges(*noisy, threshold=0.25, tolerance=0.5).mean() < 0.02
    assert blurred_edges(*edge(blur=8.0, step=2.0, difference=0.1), threshold=0.25, tolerance=0.5).any()


def test_a_sharp_edge_is_a_silhouette_and_none_of_this():
    assert not blurred_edges(*edge(blur=0.5, step=6.0, difference=0.5), threshold=0.25, tolerance=0.5).any()


def test_steps_out_of_focus_count_less_and_those_in_focus_as_ever():
    steps = disparity_steps(np.where(np.arange(20) < 10, 3.0, 1.0) + np.zeros((8, 20), np.float32))
    same = in_focus(steps, np.zeros((8, 20), np.float32))
    np.testing.assert_array_equal(same.right, steps.right)
    less = in_focus(steps, np.full((8, 20), 3.0, np.float32))
    np.testing.assert_allclose(less.right, steps.right / 4.0)


def test_the_nearer_side_s_blur_is_taken():
    disparity = np.array([[5.0, 5.0, 1.0, 1.0, np.nan]])
    blur = np.array([[7.0, 7.0, 2.0, 2.0, 9.0]], np.float32)
    np.testing.assert_array_equal(nearer_side(blur, disparity)[0, 1:4], [7.0, 7.0, 2.0])
