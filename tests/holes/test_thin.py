"""What is thinner than a pixel is found by the mean depth of a pixel's samples."""

import numpy as np
import pytest

from stereo_reproject.holes.thin import target_pixels, thin_things
from stereo_reproject.holes.tuning import TUNING as HOLE_TUNING
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS
from stereo_reproject.images.reasons import Reason
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.views.camera import disparity_per_nearness, see_the_same
from stereo_reproject.warp.discontinuities import disparity_steps
from stereo_reproject.warp.forward import forward_warp, sub_pixel_features
from stereo_reproject.warp.grid import build_grid
from stereo_reproject.warp.tuning import TUNING as WARP_TUNING
from tests.warp.analytic import pixel_centres, px_from_world, stereo_rig
from tests.warp.pairs import reproject_pair

SIZE = (60, 40)
CLIP = 0.1
WALL, CORD = 3.0, 2.6
COLUMN = 30


def rig():
    return stereo_rig(SIZE, mode="off-axis", ipd=0.15, convergence=4.0)


def lengths(camera, depth):
    """(H, W): the way from the clip plane to depths (H, W)."""
    x, y = pixel_centres(camera)
    _, ray = camera.ray_from_px(x, y)
    return ((depth - CLIP) * np.sqrt(sum(np.square(part) for part in ray))).astype(np.float32)


def found(mean, source="left", target="right", *, edges=False):
    eyes = rig()
    assert not see_the_same(eyes[source], eyes[target])
    depth = np.full(SIZE[::-1], WALL, np.float32)
    edges = np.full(depth.shape, edges)
    return thin_things(lengths(eyes[source], mean), depth, eyes[source], eyes[target], edges=edges, clip_start=CLIP)


def wall():
    return np.full(SIZE[::-1], WALL)


def test_a_wall_has_nothing_thin():
    assert not found(wall()).any()


@pytest.mark.parametrize(("source", "target", "aside"), [("left", "right", -1), ("right", "left", 1)])
def test_a_cord_that_depth_misses_is_found_with_the_pixels_that_it_moves_over(source, target, aside):
    mean = wall()
    mean[:, COLUMN] = 0.6 * WALL + 0.4 * CORD
    eyes = rig()
    moves, most = (
        (1.0 / near - 1.0 / WALL) * disparity_per_nearness(eyes[source], eyes[target])
        for near in (CORD, WALL - 0.4 * (WALL - CORD) / HOLE_TUNING.least_covered_share)
    )
    columns = np.unique(np.nonzero(found(mean, source, target))[1])
    assert {COLUMN, COLUMN + aside, COLUMN + aside * int(np.ceil(moves))} <= set(columns)
    assert columns.size <= 2 + min(most, HOLE_TUNING.max_search_pixels)
    assert np.all((columns - COLUMN) * aside >= 0)
    assert found(mean, source, target)[:, COLUMN].all()


def test_a_pixel_on_an_edge_is_a_silhouette_s_business():
    mean = wall()
    mean[:, COLUMN] = 0.5 * WALL
    assert found(mean).any()
    assert not found(mean, edges=True).any()


def test_a_surface_that_is_nearer_as_a_whole_is_not_thin():
    """One that mirrors little of the light: its rays are long, but count little."""
    mean = wall()
    mean[10:30, 10:50] = CORD
    assert not found(mean).any()


def test_what_is_farther_is_seen_in_a_mirror():
    mean = wall()
    mean[:, COLUMN] = 2.0 * WALL
    assert not found(mean).any()


def test_where_there_is_no_surface_nothing_is_thin():
    eyes = rig()
    depth = np.full(SIZE[::-1], np.inf, np.float32)
    length = np.zeros(SIZE[::-1], np.float32)
    edges = np.zeros(depth.shape, bool)
    assert not thin_things(length, depth, eyes["left"], eyes["right"], edges=edges, clip_start=CLIP).any()


def near_by(depth, moved, eyes):
    """The depth of what moves so many pixels more than what is at this one."""
    return 1.0 / (1.0 / depth + moved / disparity_per_nearness(eyes["left"], eyes["right"]))


@pytest.mark.parametrize("moved", [2.5, 4.5])
def test_a_cord_is_looked_for_as_far_aside_as_it_may_have_moved(moved):
    """Seen in so little of a pixel that nothing less would show: it may be as near as that."""
    mean = wall()
    nearest = near_by(WALL, moved, rig())
    mean[:, COLUMN] = (1.0 - HOLE_TUNING.least_covered_share) * WALL + HOLE_TUNING.least_covered_share * nearest
    columns = np.unique(np.nonzero(found(mean))[1])
    np.testing.assert_array_equal(columns, np.arange(COLUMN - np.ceil(moved), COLUMN + 1))


def test_what_hardly_moves_is_not_looked_for():
    mean = wall()
    mean[:, COLUMN] = near_by(WALL, 0.8 * HOLE_TUNING.thin_step_pixels, rig())
    assert not found(mean).any()
    mean[:, COLUMN] = near_by(WALL, 1.2 * HOLE_TUNING.thin_step_pixels, rig())
    assert found(mean)[:, COLUMN].all()


def test_what_is_beside_a_surface_is_its_rim():
    """Of a surface that is nearer as a whole: a pixel beside it that it has half of, and one farther away."""
    mean = wall()
    mean[10:30, 10:20] = CORD
    mean[10:30, 20:22] = 0.5 * (WALL + CORD)
    assert not found(mean).any()


@pytest.mark.parametrize("columns", [[0, 1], [58, 59], [29, 30]])
def test_a_cord_at_the_frame_s_edge_is_one_too(columns):
    mean = wall()
    mean[:, columns] = 0.6 * WALL + 0.4 * CORD
    assert found(mean)[:, columns].all()


def test_a_skyline_is_no_cord():
    """To Blender 4.5 a sample of the sky has no length at all: half of one makes the hill beside it seem near."""
    eyes = rig()
    depth = np.full(SIZE[::-1], 400.0, np.float32)
    depth[:15] = np.inf
    length = lengths(eyes["left"], np.where(np.isfinite(depth), depth, CLIP))
    length[15] *= 0.5
    edges = np.zeros(depth.shape, bool)
    assert not thin_things(length, depth, eyes["left"], eyes["right"], edges=edges, clip_start=CLIP).any()


def test_an_edge_that_is_too_small_to_trace_is_no_cord():
    """Half of it is the nearer side's: its mean is nearer, and a step between the two thresholds is tolerated."""
    eyes = rig()
    accuracy = SETTINGS["balanced"]
    near = near_by(WALL, 0.8 * accuracy.silhouette_step, eyes)
    depth = np.full(SIZE[::-1], WALL, np.float32)
    depth[:, :COLUMN] = near
    length = lengths(eyes["left"], depth)
    length[:, COLUMN] = lengths(eyes["left"], np.full(depth.shape, 0.5 * (near + WALL)))[:, COLUMN]
    source = {
        COLOUR_PASS: np.random.default_rng(1).random((*depth.shape, 4), np.float32),
        DEPTH_PASS: depth[..., None],
        ".Ray Length": length[..., None],
    }
    nothing = np.zeros(depth.shape, bool)
    carried = reproject_pair(source, eyes["left"], eyes["right"], accuracy=accuracy, invalid=nothing)
    assert not (carried.reasons & Reason.SILHOUETTE.bit).any()


def slat(width):
    """Depth of a wall with a slat so many pixels wide before it."""
    depth = np.full(SIZE[::-1], WALL, np.float32)
    depth[:, COLUMN : COLUMN + width] = 1.5
    return depth


def drawn(depth, source, target):
    disparity = (disparity_per_nearness(source, target) / depth).astype(np.float32)
    steps = disparity_steps(disparity)
    cuts = {"cut_right": steps.right > WARP_TUNING.tear_pixels, "cut_down": steps.down > WARP_TUNING.tear_pixels}
    grid = build_grid(depth, source, target, threshold=0.0)
    return forward_warp(depth, source, target, grid, **cuts), sub_pixel_features(depth, **cuts)


def test_what_is_a_pixel_or_two_wide_has_next_to_no_area():
    eyes = rig()
    one, two, three = (drawn(slat(width), eyes["left"], eyes["right"])[1] for width in (1, 2, 3))
    np.testing.assert_array_equal(np.nonzero(one.all(axis=0))[0], [COLUMN])
    assert one.sum() == SIZE[1]
    np.testing.assert_array_equal(np.nonzero(two.all(axis=0))[0], [COLUMN, COLUMN + 1])
    assert two.sum() == 2 * SIZE[1]
    assert not three.any()
    across, down = slat(1).T.copy(), slat(1)
    eyes = stereo_rig(SIZE[::-1], ipd=0.15, convergence=4.0)
    assert drawn(across, eyes["left"], eyes["right"])[1][COLUMN].all()
    down[20] = np.nan
    assert not drawn(down, *(rig()[view] for view in ("left", "right")))[1][20].any()


@pytest.mark.parametrize(("source", "target"), [("left", "right"), ("right", "left")])
def test_where_it_lands_is_traced(source, target):
    eyes, depth = rig(), slat(1)
    x, y = pixel_centres(eyes[source])
    origin, ray = eyes[source].ray_from_px(x[:, COLUMN], y[:, COLUMN])
    places = np.stack([1.5 * part + start for part, start in zip(np.broadcast_arrays(*ray), origin, strict=True)], -1)
    at = px_from_world(eyes[target], places + eyes[source].world_from_camera[:3, 3])[0]
    warp, alone = drawn(depth, eyes[source], eyes[target])
    landed = target_pixels(alone, depth, eyes[source], eyes[target], warp)
    np.testing.assert_array_equal(np.argmax(landed, axis=1), at.astype(int))
    assert landed.sum() == SIZE[1]
    picture = np.random.default_rng(1).random((*depth.shape, 4), np.float32)
    carried = reproject_pair(
        {COLOUR_PASS: picture, DEPTH_PASS: depth[..., None]},
        eyes[source],
        eyes[target],
        accuracy=SETTINGS["balanced"],
        invalid=np.zeros(depth.shape, bool),
    )
    middle = int(at[0])
    assert (carried.reasons[:, middle - 1 : middle + 2] & Reason.SILHOUETTE.bit).all()
    alone_now = reproject_pair(
        {COLOUR_PASS: picture, DEPTH_PASS: depth[..., None]},
        eyes[source],
        eyes[target],
        accuracy=SETTINGS["balanced"].__class__(silhouette_step=1.0, silhouette_radius=0, colour_tolerance=0.0),
        invalid=np.zeros(depth.shape, bool),
    )
    assert not (alone_now.reasons & Reason.SILHOUETTE.bit).any()


def test_what_something_nearer_hides_lands_nowhere():
    eyes, depth = rig(), slat(1)
    warp, alone = drawn(depth, eyes["left"], eyes["right"])
    warp.nearness[:] = 1.0
    assert not target_pixels(alone, depth, eyes["left"], eyes["right"], warp).any()


@pytest.mark.parametrize("width", [1, 2])
def test_a_wire_of_one_colour_before_a_wall_of_another_stays_whole(width):
    """With noise, of which by chance some pixel of the wire looks like the wall: none of it is left to be warped."""
    eyes, depth = rig(), slat(width)
    picture = np.where(depth[..., None] < WALL, np.float32(0.8), np.float32(0.3)) * np.ones(4, np.float32)
    picture += np.random.default_rng(6).normal(0.0, 0.1, picture.shape).astype(np.float32)
    carried = reproject_pair(
        {COLOUR_PASS: picture, DEPTH_PASS: depth[..., None]},
        eyes["left"],
        eyes["right"],
        accuracy=SETTINGS["balanced"],
        invalid=np.zeros(depth.shape, bool),
    )
    warp, alone = drawn(depth, eyes["left"], eyes["right"])
    landed = target_pixels(alone, depth, eyes["left"], eyes["right"], warp)
    assert landed.any(axis=1).all()
    columns = np.flatnonzero(landed.any(axis=0))
    wire = (carried.reasons & Reason.SILHOUETTE.bit)[:, columns.min() - 1 : columns.max() + 2]
    assert wire.all(), "and what is right beside it"
