"""Motion vectors as another eye sees them, held against points that are projected by themselves."""

import numpy as np
import pytest

from stereo_reproject.views.camera import ViewPlane
from stereo_reproject.views.motion import Moving, moving, standing_still
from stereo_reproject.warp.forward import Warp
from stereo_reproject.warp.motion import motion_from_directions, warp_motion
from tests.warp.analytic import camera, pixel_centres, pose, px_from_world, stereo_rig, world_rays

SIZE = (13, 9)

EXACT = 2e-4
"""Pixels: what is left of single precision."""

FARTHER = 0.3

WORLDS = {
    "now": None,
    "before": pose((-0.2, 0.1, 0.3), yaw=0.05, pitch=-0.02),
    "after": pose((0.4, 0.0, -0.2), yaw=-0.08, roll=0.03),
}


def eyes_of(moves, **options):
    """Moving eyes by view name."""
    rigs = {
        when: stereo_rig(SIZE, ipd=0.4, world=world if moves else None, **options) for when, world in WORLDS.items()
    }
    return {view: moving(rigs["now"][view], rigs["before"][view], rigs["after"][view]) for view in ("left", "right")}


def vectors_of(eye, points, before, after):
    """(H, W, 4) of points (H, W, 3) in the world, which are elsewhere in the frames around this one."""
    (x, y, _), (bx, by, _), (ax, ay, _) = (
        px_from_world(one, place) for one, place in ((eye.now, points), (eye.before, before), (eye.after, after))
    )
    return np.stack([bx - x, y - by, x - ax, ay - y], axis=-1).astype(np.float32)


def seen(eye, depth):
    """(H, W, 3): the points that the eye's pixel centres see at depth (H, W)."""
    origin, direction = world_rays(eye.now, *pixel_centres(eye.now))
    return origin + depth[..., None] * direction


def bumps():
    rows, columns = np.indices(SIZE[::-1])
    return 5.0 + np.sin(0.4 * columns) + 0.5 * np.cos(0.7 * rows)


def standing(eye, points):
    """The vectors of points that do not move themselves."""
    return vectors_of(eye, points, points, points)


def convert(vector, depth, source, target):
    """The source's every pixel in the target's, which are at another depth."""
    depths = depth[..., None].astype(np.float32)
    return warp_motion(vector, depths, every_pixel_of(source.now), source, target, (depth + FARTHER).astype(np.float32))


def every_pixel_of(camera):
    x, y = (values.astype(np.float32) for values in pixel_centres(camera))
    return Warp(x, y, np.ones_like(x))


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("mode", ["off-axis", "toe-in"])
def test_what_stands_still_moves_by_the_target_s_own_motion(mode, orthographic):
    eyes = eyes_of(True, mode=mode, orthographic=orthographic)
    source, target = eyes["left"], eyes["right"]
    depth = bumps()
    points = seen(source, depth)
    vector = standing(source, points)
    result = convert(vector, depth, source, target)
    expected = standing(target, seen(target, depth + FARTHER))
    np.testing.assert_allclose(result, expected, atol=EXACT)
    if not orthographic:
        assert np.abs(expected - vector).max() > 0.05, "the eyes do not see the same motion"


@pytest.mark.parametrize("moves", [False, True])
def test_what_moves_parallel_to_the_picture_is_exact(moves):
    """Of a turned camera too, where parallel is to its own picture in each frame."""
    eyes = eyes_of(moves)
    source, target = eyes["left"], eyes["right"]
    depth = bumps()
    points = seen(source, depth)
    slide = np.array([0.3, -0.2, 0.0])
    before, after = (points + one.world_from_camera[:3, :3] @ slide for one in (source.before, source.after))
    vector = vectors_of(source, points, before, after)
    expected = vectors_of(target, points, before, after)
    # The target's pixel is not quite where the point is: what its own motion does in between is made up for.
    expected += standing(target, seen(target, depth + FARTHER)) - standing(target, points)
    np.testing.assert_allclose(convert(vector, depth, source, target), expected, atol=EXACT)


def test_vectors_are_those_of_the_nearest_sample_and_none_where_nothing_landed():
    eye = standing_still(stereo_rig(SIZE)["left"])
    vector = np.random.default_rng(0).normal(size=(*SIZE[::-1], 4)).astype(np.float32)
    depth = np.full((*SIZE[::-1], 1), 4.0, np.float32)
    warp = every_pixel_of(eye.now)
    x, nearness = warp.x + 0.4, warp.nearness.copy()
    x[3, 5], nearness[3, 5] = np.nan, -np.inf
    result = warp_motion(vector, depth, Warp(x, warp.y, nearness), eye, eye, depth[..., 0])
    expected = vector.copy()
    expected[3, 5] = 0.0
    np.testing.assert_allclose(result, expected, atol=EXACT)


@pytest.mark.parametrize("depth", [np.inf, np.nan])
def test_what_has_no_depth_keeps_a_vector(depth):
    """The sky is as far in both eyes; and of an unknown depth nothing but the vector itself is known."""
    eyes = eyes_of(False)
    vector = np.full((*SIZE[::-1], 4), 2.0, np.float32)
    depths = np.full((*SIZE[::-1], 1), depth, np.float32)
    warp = every_pixel_of(eyes["left"].now)
    result = warp_motion(vector, depths, warp, eyes["left"], eyes["right"], depths[..., 0])
    np.testing.assert_allclose(result, vector, atol=EXACT)


def test_a_lens_that_zooms_scales_the_plane_of_the_frame_that_is_rendered():
    """As Cycles has it: the plane's shift is scaled as well, and an orthographic camera keeps its scale."""
    now, then = camera(SIZE, shift=(0.1, 0.0)), camera(SIZE, shift=(0.3, 0.2))
    wide = ViewPlane(*(2.0 * side for side in (then.plane.left, then.plane.right, then.plane.bottom, then.plane.top)))
    zoomed = moving(now, type(now)(*SIZE, then.world_from_camera, wide), now).before.plane
    np.testing.assert_allclose(
        [zoomed.left, zoomed.right, zoomed.bottom, zoomed.top],
        [2.0 * side for side in (now.plane.left, now.plane.right, now.plane.bottom, now.plane.top)],
    )
    flat = camera(SIZE, orthographic=True)
    other = type(flat)(*SIZE, flat.world_from_camera, wide)
    assert moving(flat, other, other).after.plane == flat.plane


def directions_of(one, points):
    """(N, 3) unit directions to points in the world, in the camera's space."""
    turn, place = one.world_from_camera[:3, :3], one.world_from_camera[:3, 3]
    local = (points - place) @ turn
    return local / np.linalg.norm(local, axis=-1, keepdims=True)


def turned_of(eye, points):
    """(N, 4) what Cycles gives for a custom camera."""
    now, before, after = (directions_of(one, points)[:, :2] for one in (eye.now, eye.before, eye.after))
    return np.concatenate([before - now, now - after], axis=-1).astype(np.float32)


def test_differences_of_directions_become_pixels():
    eye = eyes_of(True)["right"]
    points = seen(eye, bumps())
    x, y = (values.ravel() for values in pixel_centres(eye.now))
    result = motion_from_directions(
        turned_of(eye, points.reshape(-1, 3)), eye.now, x, y, sky=np.zeros(x.size, bool), corner=(0.0, SIZE[1])
    )
    np.testing.assert_allclose(result, vectors_of(eye, points, points, points).reshape(-1, 4), atol=1e-3)


def test_where_the_sky_has_no_vectors_a_pixel_s_is_that_of_what_else_is_in_it():
    """Blender 4.5 gives the sky none."""
    eye = eyes_of(True)["right"]
    points = seen(eye, bumps()).reshape(-1, 3)
    x, y = (values.ravel() for values in pixel_centres(eye.now))
    turned, sky = turned_of(eye, points), np.zeros(x.size, bool)
    turned[:3], sky[:6] = 0.0, True
    result = motion_from_directions(turned, eye.now, x, y, sky=sky, corner=(0.0, SIZE[1]))
    np.testing.assert_allclose(result[3:], standing(eye, points)[3:], atol=1e-3)
    np.testing.assert_allclose(result[:3], 0.0, atol=1e-6)


def test_the_sky_s_positions_are_times_its_depth_as_cycles_has_it():
    """Without the division: what a pixel's direction is worth counts from the corner of the whole frame."""
    now = camera(SIZE)
    eye = Moving(now, camera(SIZE, pose(yaw=0.1)), camera(SIZE, pose(pitch=0.1)))
    far = seen(eye, np.full(SIZE[::-1], 1e9)).reshape(-1, 3)
    x, y = (values.ravel() for values in pixel_centres(now))
    corner = (-3.0, SIZE[1] + 5.0)
    result = motion_from_directions(turned_of(eye, far), now, x, y, sky=np.ones(x.size, bool), corner=corner)
    places = []
    for one in (eye.before, eye.now, eye.after):
        px, py, _ = px_from_world(one, far)
        ahead = -directions_of(one, far)[:, 2:]
        places.append(ahead * np.stack([px - corner[0], corner[1] - py], axis=-1))
    expected = np.concatenate([places[0] - places[1], places[1] - places[2]], axis=-1)
    np.testing.assert_allclose(result, expected, atol=1e-3)
