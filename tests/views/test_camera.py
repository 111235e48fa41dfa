"""The two maps of a camera, and the way from a source pixel to a target pixel, against projection by hand."""

import numpy as np
import pytest

from stereo_reproject.views.camera import (
    OrthographicCamera,
    PerspectiveCamera,
    ViewPlane,
    depth_from_ray_length,
    disparity_per_nearness,
    pixel_size,
    target_from_source,
    target_px_from_source_px,
)
from tests.warp.analytic import camera, focal_px, pixel_centres, pose, px_from_world, rotation, stereo_rig, world_rays

PX_TOLERANCE = 1e-9
"""Pixels: float64 geometry over a picture of some hundred pixels loses about 1e-13 per step; this leaves room."""

OFFSET_TOLERANCE = 1e-6
"""Pixels, for cameras a million units from the origin: their places are rounded to 1e-10 units there, which moves a
point at depth 2 by 1e-8 pixels."""

SIZE = (120, 80)
DEPTHS = [0.3, 1.0, 7.7, 1e3, 1e8]

CAMERAS = {
    "perspective": camera(SIZE),
    "perspective, shifted": camera(SIZE, shift=(0.21, -0.13)),
    "perspective, tall": camera((37, 91)),
    "perspective, pixels not square": PerspectiveCamera(120, 80, np.eye(4), ViewPlane(-0.4, 0.4, -0.5, 0.5)),
    "orthographic": camera(SIZE, orthographic=True),
    "orthographic, shifted": camera(SIZE, orthographic=True, shift=(1.3, 0.4)),
    "orthographic, pixels not square": OrthographicCamera(64, 80, np.eye(4), ViewPlane(-2.0, 3.0, -1.0, 0.5)),
}

GENERAL = pose((0.2, -0.15, 0.1), yaw=0.06, pitch=-0.04, roll=0.1)


def positions(eye, count=200, seed=1):
    rng = np.random.default_rng(seed)
    return rng.uniform(-5, eye.width + 5, count), rng.uniform(-5, eye.height + 5, count)


@pytest.mark.parametrize("eye", CAMERAS.values(), ids=CAMERAS.keys())
def test_lengths_along_rays_are_depths(eye):
    """Some rows are worked out at a time; the pictures have more."""
    x, y = pixel_centres(eye)
    depth = np.random.default_rng(2).uniform(0.5, 20.0, x.shape)
    clip_start = 0.3
    origin, direction = eye.ray_from_px(x, y)
    begin, end = (np.stack([o + d * t + 0.0 * x for o, d in zip(origin, direction, strict=True)]) for t in (0.3, depth))
    length = np.linalg.norm(end - begin, axis=0)
    np.testing.assert_allclose(depth_from_ray_length(eye, length, clip_start), depth, rtol=1e-12)


@pytest.mark.parametrize("eye", CAMERAS.values(), ids=CAMERAS.keys())
@pytest.mark.parametrize("depth", DEPTHS)
def test_project_after_unproject_is_the_identity(eye, depth):
    x, y = positions(eye)
    origin, direction = eye.ray_from_px(x, y)
    point = tuple(o + depth * d for o, d in zip(origin, direction, strict=True))
    back_x, back_y, back_depth = eye.px_from_point(point, np.float64(1.0))
    np.testing.assert_allclose(back_x, x, rtol=0, atol=PX_TOLERANCE)
    np.testing.assert_allclose(back_y, y, rtol=0, atol=PX_TOLERANCE)
    np.testing.assert_allclose(back_depth, depth, rtol=1e-12)


@pytest.mark.parametrize("eye", CAMERAS.values(), ids=CAMERAS.keys())
def test_neighbouring_pixels_are_one_pixel_apart_on_the_view_plane(eye):
    origin, direction = eye.ray_from_px(np.array([10.0, 11.0]), np.array([21.0, 20.0]))
    apart = [float(np.diff(o + d)[0]) for o, d in zip(origin[:2], direction[:2], strict=True)]
    np.testing.assert_allclose(apart, pixel_size(eye), rtol=1e-9)


@pytest.mark.parametrize("eye", CAMERAS.values(), ids=CAMERAS.keys())
def test_the_frame_s_corners_are_the_view_plane_s(eye):
    origin, direction = eye.ray_from_px(np.array([0.0, eye.width]), np.array([0.0, eye.height]))
    x, y = (o + d for o, d in zip(origin[:2], direction[:2], strict=True))
    np.testing.assert_allclose(x, [eye.plane.left, eye.plane.right], rtol=1e-12)
    np.testing.assert_allclose(y, [eye.plane.top, eye.plane.bottom], rtol=1e-12)


@pytest.mark.parametrize("eye", CAMERAS.values(), ids=CAMERAS.keys())
def test_nearness_grows_towards_the_camera_and_has_an_inverse(eye):
    depth = np.array([0.01, 0.5, 3.0, 1e4, 1e7, np.inf])
    nearness = eye.nearness_from_depth(depth)
    assert np.all(np.isfinite(nearness))
    assert np.all(np.diff(nearness) < 0)
    np.testing.assert_allclose(eye.depth_from_nearness(nearness), depth, rtol=1e-12)


@pytest.mark.parametrize("eye", CAMERAS.values(), ids=CAMERAS.keys())
@pytest.mark.parametrize("normal", [(0.3, 0.2, 1.0), (-0.5, 0.1, 0.8)])
def test_nearness_is_linear_over_the_picture_on_a_plane(eye, normal):
    """What allows it to be interpolated along the edges of a triangle."""
    x, y = pixel_centres(eye)
    origin, direction = world_rays(eye, x, y)
    depth = (np.array([0.0, 0.0, -6.0]) - origin) @ normal / (direction @ normal)
    nearness = eye.nearness_from_depth(depth)
    largest = np.abs(nearness).max()
    for axis in (0, 1):
        assert np.abs(np.diff(nearness, n=2, axis=axis)).max() < 1e-12 * largest


@pytest.mark.parametrize("source", CAMERAS.values(), ids=CAMERAS.keys())
@pytest.mark.parametrize("target_kind", ["perspective", "orthographic"])
def test_source_to_target_equals_projection_by_hand(source, target_kind):
    target = camera((90, 70), GENERAL, orthographic=target_kind == "orthographic", shift=(0.03, -0.02))
    x, y = positions(source)
    depth = np.random.default_rng(3).uniform(1.0, 50.0, x.size)
    origin, direction = world_rays(source, x, y)
    expected = px_from_world(target, origin + depth[:, None] * direction)
    for got, wanted in zip(target_px_from_source_px(source, target, x, y, depth), expected, strict=True):
        np.testing.assert_allclose(got, wanted, rtol=1e-11, atol=PX_TOLERANCE)


@pytest.mark.parametrize("orthographic", [False, True])
def test_source_to_target_and_back_is_the_identity(orthographic):
    source = camera(SIZE, pose((3.0, 1.0, -2.0), yaw=0.4), orthographic=orthographic)
    target = camera(SIZE, source.world_from_camera @ GENERAL, orthographic=orthographic)
    x, y = positions(source)
    depth = np.random.default_rng(3).uniform(1.0, 50.0, x.size)
    there = target_px_from_source_px(source, target, x, y, depth)
    back_x, back_y, back_depth = target_px_from_source_px(target, source, *there)
    np.testing.assert_allclose(back_x, x, rtol=0, atol=PX_TOLERANCE)
    np.testing.assert_allclose(back_y, y, rtol=0, atol=PX_TOLERANCE)
    np.testing.assert_allclose(back_depth, depth, rtol=1e-11)


@pytest.mark.parametrize("mode", ["off-axis", "parallel", "toe-in"])
def test_the_sky_is_where_very_far_points_are(mode):
    rig = stereo_rig(SIZE, mode=mode)
    x, y = pixel_centres(rig["left"])
    sky_x, sky_y, sky_depth = target_px_from_source_px(rig["left"], rig["right"], x, y, np.inf)
    far_x, far_y, _ = target_px_from_source_px(rig["left"], rig["right"], x, y, 1e12)
    assert np.all(np.isposinf(sky_depth))
    np.testing.assert_allclose(sky_x, far_x, rtol=0, atol=PX_TOLERANCE)
    np.testing.assert_allclose(sky_y, far_y, rtol=0, atol=PX_TOLERANCE)


def test_orthographic_sky_is_finite_in_the_picture_and_stays_behind_everything():
    rig = stereo_rig(SIZE, mode="parallel", orthographic=True)
    x, y = pixel_centres(rig["left"])
    depth = np.where(x > 60, np.inf, 5.0)
    target_x, target_y, target_depth = target_px_from_source_px(rig["left"], rig["right"], x, y, depth)
    assert np.all(np.isfinite(target_x) & np.isfinite(target_y))
    nearness = rig["right"].nearness_from_depth(target_depth)
    assert nearness[:, :60].min() > nearness[:, 60:].max()
    np.testing.assert_array_equal(np.isinf(rig["right"].depth_from_nearness(nearness)), np.isinf(depth))


def test_a_sky_seen_in_perspective_has_a_place_in_an_orthographic_picture():
    x, y, depth = target_px_from_source_px(
        camera(SIZE), camera(SIZE, pose((0.5, 0.0, 0.0)), orthographic=True), 60.0, 40.0, np.array([2.0, np.inf])
    )
    assert np.all(np.isfinite(x) & np.isfinite(y))
    assert depth[0] == pytest.approx(2.0)
    assert depth[1] >= 1e8


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("mode", ["off-axis", "toe-in"])
def test_a_world_offset_of_a_million_units_changes_nothing(orthographic, mode):
    away = pose((1e6 + 0.1, -1e6 - 0.7, 1e6 / 3.0), yaw=0.5, pitch=0.2)
    here = pose(yaw=0.5, pitch=0.2)
    x, y = pixel_centres(camera(SIZE))
    depth = np.random.default_rng(3).uniform(2.0, 50.0, x.shape)
    positions_of = []
    for world in (here, away):
        rig = stereo_rig(SIZE, mode=mode, orthographic=orthographic, world=world)
        positions_of.append(target_px_from_source_px(rig["left"], rig["right"], x, y, depth))
    for got, expected in zip(positions_of[1], positions_of[0], strict=True):
        np.testing.assert_allclose(got, expected, rtol=0, atol=OFFSET_TOLERANCE)


def test_the_step_between_two_eyes_keeps_all_its_digits_far_from_the_origin():
    """The places are exact in binary; their difference is, if it is taken before anything is turned."""
    step = np.array([0.125, 0.0625, -0.03125])
    source, target = pose((2.0**20 + 1, -(2.0**20) + 3, 2.0**19), yaw=0.5, pitch=0.2), pose(yaw=0.5, pitch=0.2)
    target[:3, 3] = source[:3, 3] + step
    result = target_from_source(camera(SIZE, source), camera(SIZE, target))
    np.testing.assert_allclose(result[:3, 3], -step @ target[:3, :3], rtol=0, atol=1e-16)
    np.testing.assert_allclose(result[:3, :3], np.eye(3), rtol=0, atol=1e-15)


def test_target_from_source_is_the_relative_pose():
    here, step = pose((3.0, -2.0, 5.0), yaw=1.0, pitch=0.3, roll=-0.2), GENERAL
    result = target_from_source(camera(SIZE, here @ step), camera(SIZE, here))
    np.testing.assert_allclose(result, step, rtol=0, atol=1e-14)


@pytest.mark.parametrize("ipd", [0.001, 0.065, 2.0])
@pytest.mark.parametrize("convergence", [0.5, 4.0, 1e4])
def test_off_axis_disparity_has_its_closed_form(ipd, convergence):
    rig = stereo_rig(SIZE, mode="off-axis", ipd=ipd, convergence=convergence)
    x, y = pixel_centres(rig["left"])
    depth = np.geomspace(0.5, 1e5, x.size).reshape(x.shape)
    target_x, _, target_depth = target_px_from_source_px(rig["left"], rig["right"], x, y, depth)
    expected = focal_px(SIZE) * ipd * (1.0 / depth - 1.0 / convergence)
    np.testing.assert_allclose(x - target_x, expected, rtol=0, atol=PX_TOLERANCE * max(1.0, ipd / convergence * 100))
    np.testing.assert_allclose(target_depth, depth, rtol=1e-13)


def test_a_point_at_the_convergence_distance_does_not_move():
    for mode in ("off-axis", "toe-in"):
        rig = stereo_rig(SIZE, mode=mode, convergence=4.0)
        depth = 4.0 if mode == "off-axis" else np.hypot(4.0, 0.05)
        x, y, _ = target_px_from_source_px(rig["left"], rig["right"], 60.0, 40.0, depth)
        assert abs(x - 60.0) < PX_TOLERANCE, mode
        assert abs(y - 40.0) < PX_TOLERANCE, mode


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("mode", ["off-axis", "parallel"])
def test_rows_are_unchanged_where_the_image_planes_coincide(mode, orthographic):
    rig = stereo_rig(SIZE, mode=mode, orthographic=orthographic, world=pose(yaw=0.7, pitch=-0.3, roll=0.4))
    x, y = pixel_centres(rig["left"])
    depth = np.random.default_rng(3).uniform(0.5, 50.0, x.shape)
    _, target_y, _ = target_px_from_source_px(rig["left"], rig["right"], x, y, depth)
    np.testing.assert_allclose(target_y, y, rtol=0, atol=PX_TOLERANCE)


def test_toe_in_moves_rows_in_the_corners_and_not_on_the_horizon():
    """The keystone that off-axis avoids: the eye that is nearer to a side sees it taller."""
    rig = stereo_rig(SIZE, mode="toe-in", ipd=0.4, convergence=4.0)
    x = np.array([1.0, 119.0, 60.0])
    _, corner_y, _ = target_px_from_source_px(rig["left"], rig["right"], x[:2], np.array([1.0, 1.0]), 4.0)
    _, horizon_y, _ = target_px_from_source_px(rig["left"], rig["right"], x, np.full(3, 40.0), 4.0)
    assert np.all(np.abs(corner_y - 1.0) > 0.5)
    assert np.sign(corner_y[0] - 1.0) == -np.sign(corner_y[1] - 1.0)
    np.testing.assert_allclose(horizon_y, 40.0, rtol=0, atol=PX_TOLERANCE)


def test_points_behind_the_target_have_no_pixel():
    source = camera(SIZE)
    ahead = camera(SIZE, pose((0.0, 0.0, -5.0)))
    x, y, depth = target_px_from_source_px(source, ahead, 50.0, 30.0, np.array([4.0, 4.999, 5.001, 8.0]))
    np.testing.assert_array_equal(np.isnan(x), [True, True, False, False])
    np.testing.assert_array_equal(np.isnan(y), [True, True, False, False])
    np.testing.assert_array_equal(np.isnan(depth), [True, True, False, False])
    turned = camera(SIZE, pose(yaw=np.pi))
    assert np.all(np.isnan(target_px_from_source_px(source, turned, 50.0, 30.0, np.inf)[0]))


def test_an_unknown_depth_has_no_pixel():
    for orthographic in (False, True):
        rig = stereo_rig(SIZE, orthographic=orthographic)
        x, _, depth = target_px_from_source_px(rig["left"], rig["right"], 50.0, 30.0, np.array([np.nan, 2.0]))
        np.testing.assert_array_equal(np.isnan(x), [True, False])
        np.testing.assert_array_equal(np.isnan(depth), [True, False])


@pytest.mark.parametrize("mode", ["off-axis", "parallel"])
@pytest.mark.parametrize("ipd", [1e-4, 0.065, 3.0])
def test_disparity_per_nearness_is_focal_length_times_baseline(mode, ipd):
    rig = stereo_rig(SIZE, mode=mode, ipd=ipd)
    per_nearness = disparity_per_nearness(rig["left"], rig["right"])
    assert per_nearness == pytest.approx(focal_px(SIZE) * ipd, rel=1e-9)


def test_disparity_per_nearness_of_a_toe_in_rig_is_close_to_that_of_a_parallel_one():
    """A first-order estimate: at 50 to 100 baselines the axes' 1.4 degrees move it by well under 5 %."""
    rig = stereo_rig(SIZE, mode="toe-in", ipd=0.1, convergence=4.0)
    per_nearness = disparity_per_nearness(rig["left"], rig["right"])
    assert per_nearness == pytest.approx(focal_px(SIZE) * 0.1, rel=0.05)


def test_disparity_per_nearness_of_an_orthographic_rig():
    """Side by side nothing moves with depth; turned by an angle, depth moves a point by its sine."""
    parallel = stereo_rig(SIZE, mode="parallel", orthographic=True)
    assert disparity_per_nearness(parallel["left"], parallel["right"]) == pytest.approx(0.0, abs=PX_TOLERANCE)
    toed = stereo_rig(SIZE, mode="toe-in", orthographic=True, ipd=0.1, convergence=4.0)
    expected = SIZE[0] / 5.0 * np.sin(2 * np.arctan(0.05 / 4.0))
    assert disparity_per_nearness(toed["left"], toed["right"]) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("mode", ["off-axis", "parallel", "toe-in"])
@pytest.mark.parametrize("orthographic", [False, True])
def test_without_a_baseline_nothing_moves(mode, orthographic):
    rig = stereo_rig(SIZE, mode=mode, ipd=0.0, orthographic=orthographic)
    assert disparity_per_nearness(rig["left"], rig["right"]) == pytest.approx(0.0, abs=PX_TOLERANCE)
    x, y = pixel_centres(rig["left"])
    depth = np.random.default_rng(3).uniform(0.5, 50.0, x.shape)
    depth[::7] = np.inf
    target_x, target_y, target_depth = target_px_from_source_px(rig["left"], rig["right"], x, y, depth)
    np.testing.assert_allclose(target_x, x, rtol=0, atol=PX_TOLERANCE)
    np.testing.assert_allclose(target_y, y, rtol=0, atol=PX_TOLERANCE)
    seen = np.isfinite(depth)
    np.testing.assert_allclose(target_depth[seen], depth[seen], rtol=1e-13)


def test_rotation_is_the_helper_that_it_says():
    """The tests stand on it: yaw to the left, pitch up, roll counter-clockwise, in Blender's camera space."""
    np.testing.assert_allclose(rotation(yaw=np.pi / 2) @ [0, 0, -1], [-1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(rotation(pitch=np.pi / 2) @ [0, 0, -1], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(rotation(roll=np.pi / 2) @ [1, 0, 0], [0, 1, 0], atol=1e-15)
