"""Steps in disparity, masks, and why a target pixel is empty."""

from dataclasses import replace

import numpy as np
import pytest

from stereo_reproject.images.masks import dilate
from stereo_reproject.images.reasons import Reason
from stereo_reproject.views.camera import disparity_per_nearness
from stereo_reproject.warp.discontinuities import disparity_steps
from stereo_reproject.warp.empty import empty_reasons
from stereo_reproject.warp.forward import forward_warp
from stereo_reproject.warp.grid import build_grid
from tests.warp.analytic import Plane, World, camera, focal_px, pixel_centres, pose, stereo_rig

SIZE = (120, 80)

NO_STEP = 1e-3
"""Pixels of disparity: float32 disparities of some tens of pixels are rounded to 4e-6, and second differences add up
four of them; a thousandth is what no threshold of ours comes near."""

TORN = 1.0
"""Pixels: what counts as a tear, and more than any crease below."""


def disparity_of(world, rig):
    depth = world.render(rig["left"])["Depth"][..., 0].astype(np.float64)
    nearness = rig["left"].nearness_from_depth(depth)
    return (nearness * disparity_per_nearness(rig["left"], rig["right"])).astype(np.float32)


# Steps


def test_a_floor_to_the_horizon_has_no_step():
    """However steep its depth is: the sky begins where its disparity has come down to zero."""
    rig = stereo_rig(SIZE, ipd=0.3, world=pose(pitch=-0.05))
    disparity = disparity_of(World((Plane((0.0, -1.6, 0.0), (0.0, 1.0, 0.0)),)), rig)
    slope = np.abs(np.diff(disparity, axis=0)).max()
    horizon = int(np.argmax(disparity[:, 0] > 0))
    assert 5 < horizon < SIZE[1] - 5, "both are in the picture"
    depth_ratio = disparity[horizon + 2, 0] / disparity[horizon, 0]
    assert depth_ratio > 1.5, "and a threshold on depth would tear the floor"
    steps = disparity_steps(disparity)
    assert steps.right.max() < NO_STEP
    away = np.abs(np.arange(SIZE[1] - 1) - (horizon - 1)) > 1
    assert steps.down[away].max() < NO_STEP
    # At the horizon itself the surface has a crease: a row may lie anywhere on it, half a slope is the most it shows.
    assert steps.down.max() <= 0.5 * slope + NO_STEP
    assert not steps.mask(TORN).any()


@pytest.mark.parametrize("normal", [(0.9, 0.0, 0.3), (-0.5, 0.7, 0.4), (0.0, 0.99, 0.1)])
def test_a_slanted_wall_has_no_step(normal):
    rig = stereo_rig(SIZE, ipd=0.3)
    disparity = disparity_of(World((Plane((0.0, 0.0, -5.0), normal),)), rig)
    steps = disparity_steps(np.where(disparity > 0, disparity, np.nan).astype(np.float32))
    assert max(steps.right.max(), steps.down.max()) < NO_STEP


@pytest.mark.parametrize("step", [0.3, 1.5, 20.0])
def test_a_step_between_frontal_walls_is_found_in_its_place_with_its_size(step):
    disparity = np.full((40, 50), 3.0, np.float32)
    disparity[10:30, 20:35] += step
    steps = disparity_steps(disparity)
    expected_right, expected_down = np.zeros((40, 49)), np.zeros((39, 50))
    expected_right[10:30, [19, 34]] = step
    expected_down[[9, 29], 20:35] = step
    np.testing.assert_allclose(steps.right, expected_right, atol=NO_STEP)
    np.testing.assert_allclose(steps.down, expected_down, atol=NO_STEP)


@pytest.mark.parametrize("slope", [-0.4, 0.25, 0.6])
def test_a_step_between_parallel_slanted_walls_keeps_its_size(slope):
    """The slope of either side is taken out, and no more than that."""
    columns = np.arange(50, dtype=np.float32)
    disparity = np.broadcast_to(slope * columns + np.where(columns >= 20, 3.0, 0.0), (12, 50)).astype(np.float32)
    right = disparity_steps(disparity).right
    assert np.all(np.abs(right[:, 19] - 3.0) <= abs(slope) + NO_STEP)
    assert np.delete(right, 19, axis=1).max() <= abs(slope) + NO_STEP
    assert np.all(right[:, np.r_[:17, 23:49]] < NO_STEP)


@pytest.mark.parametrize("along", ["right", "down"])
def test_a_post_one_pixel_wide_has_a_step_on_either_side(along):
    disparity = np.full((30, 40), 2.0, np.float32)
    disparity[:, 17] = 7.0
    steps = disparity_steps(disparity if along == "right" else disparity.T)
    found = steps.right if along == "right" else steps.down.T
    np.testing.assert_allclose(found[:, [16, 17]], 5.0, atol=NO_STEP)
    np.testing.assert_allclose(np.delete(found, [16, 17], axis=1), 0.0, atol=NO_STEP)


@pytest.mark.parametrize("column", [0, 39])
def test_a_step_at_the_frame_s_edge_is_found(column):
    disparity = np.full((30, 40), 2.0, np.float32)
    disparity[:, column] = 7.0
    np.testing.assert_allclose(disparity_steps(disparity).right[:, 0 if column == 0 else 38], 5.0, atol=NO_STEP)


def test_no_step_is_seen_beside_what_is_unknown_and_none_is_lost_near_it():
    disparity = np.full((20, 30), 2.0, np.float32)
    disparity[:, 15:] = 9.0
    disparity[5, 10] = disparity[12, 14] = disparity[8, 13] = disparity[9, 16] = np.nan
    steps = disparity_steps(disparity)
    assert np.all(np.isfinite(steps.right))
    assert np.all(np.isfinite(steps.down))
    assert steps.right[5, 9] == steps.right[5, 10] == steps.down[4, 10] == steps.down[5, 10] == 0.0
    torn = steps.right > TORN
    expected = np.zeros_like(torn)
    expected[:, 14] = True
    expected[12, 14] = False
    np.testing.assert_array_equal(torn, expected)


def test_beside_marks_every_2x2_block_that_a_step_runs_through():
    disparity = np.zeros((9, 12), np.float32)
    disparity[3:6, 4:8] = 5.0
    marked = disparity_steps(disparity).mask(TORN)
    expected = np.zeros_like(marked)
    expected[2:7, 3:9] = True
    expected[4, 5:7] = False
    np.testing.assert_array_equal(marked, expected)
    assert not disparity_steps(disparity).mask(5.0).any(), "above the threshold, not at it"


# Masks


@pytest.mark.parametrize("radius", [0, 1, 2, 5])
@pytest.mark.parametrize("shape", [(1, 1), (7, 4), (20, 31)])
def test_dilate_by_brute_force(radius, shape):
    mask = np.random.default_rng(radius).random(shape) < 0.04
    mask[0, -1] = True
    given = mask.copy()
    expected = np.zeros_like(mask)
    for i, j in np.argwhere(mask):
        expected[max(i - radius, 0) : i + radius + 1, max(j - radius, 0) : j + radius + 1] = True
    np.testing.assert_array_equal(dilate(mask, radius), expected)
    np.testing.assert_array_equal(mask, given, err_msg="the mask that was given is left as it is")


# Reasons of empty pixels


def post_before_a_wall(rig, source, target, middle=60):
    """A wall and a post before it, warped; the reasons, and where on the wall a target pixel looks."""
    wall, front = 6.0, 2.0
    x, _ = pixel_centres(rig[source])
    index = (np.abs(x - middle) < 10).astype(int)
    depth = np.where(index, front, wall)
    grid = build_grid(depth.astype(np.float32), rig[source], rig[target], threshold=1.0)
    cuts = {"cut_right": np.diff(index, axis=1) != 0, "cut_down": np.diff(index, axis=0) != 0}
    warp = forward_warp(depth.astype(np.float32), rig[source], rig[target], grid, **cuts)
    sign = 1.0 if source == "left" else -1.0
    convergence = np.inf if rig["left"].plane == rig["right"].plane else 4.0
    wall_x = x + sign * focal_px(SIZE) * 0.3 * (1.0 / wall - 1.0 / convergence)
    return warp, empty_reasons(warp, rig[source], rig[target]), wall_x


@pytest.mark.parametrize("source", ["left", "right"])
@pytest.mark.parametrize("mode", ["off-axis", "parallel"])
def test_empty_pixels_are_outside_at_the_frame_and_disoccluded_by_the_post(source, mode):
    """Off-axis, a wall beyond the convergence distance leaves the frame on the other side than it does in parallel."""
    target = "right" if source == "left" else "left"
    warp, reasons, wall_x = post_before_a_wall(stereo_rig(SIZE, mode=mode, ipd=0.3), source, target)
    rim = warp.covered & ((warp.x < 0) | (warp.x > SIZE[0]))
    np.testing.assert_array_equal(reasons > 0, ~warp.covered | rim)
    beyond = (wall_x < 0) | (wall_x > SIZE[0])
    outside, disoccluded = reasons == Reason.OUTSIDE, reasons == Reason.DISOCCLUDED
    assert outside.sum() >= 3 * SIZE[1]
    assert disoccluded.sum() >= 4 * SIZE[1]
    np.testing.assert_array_equal(outside, (beyond & ~warp.covered) | rim)
    columns = np.nonzero(outside.any(axis=0))[0]
    on_the_left = (source == "left") == (mode == "off-axis")
    assert columns.max() < 20 if on_the_left else columns.min() > 100
    hidden = np.abs(wall_x[disoccluded] - 60)
    assert hidden.max() <= 10 + 1, "what the post hid from the source, and the torn pixel beside it"


@pytest.mark.parametrize("source", ["left", "right"])
def test_what_an_empty_pixel_shows_lies_behind_the_post_beside_it(source):
    """A post near the frame's edge: at its depth the empty pixels would look out of the frame, at the wall's not."""
    target, middle = ("right", 100) if source == "left" else ("left", 20)
    warp, reasons, wall_x = post_before_a_wall(stereo_rig(SIZE, mode="parallel", ipd=0.3), source, target, middle)
    hidden = ~warp.covered & (np.abs(wall_x - middle) < 10)
    assert hidden.sum() >= 10 * SIZE[1]
    assert np.all(reasons[hidden] == Reason.DISOCCLUDED)


def test_a_frame_that_sees_nothing_of_the_source_is_outside():
    source, target = camera(SIZE), camera(SIZE, pose(yaw=1.2))
    depth = np.full(SIZE[::-1], 5.0, np.float32)
    grid = build_grid(depth, source, target, threshold=1.0)
    cuts = {"cut_right": np.zeros((80, 119), bool), "cut_down": np.zeros((79, 120), bool)}
    warp = forward_warp(depth, source, target, grid, **cuts)
    reasons = empty_reasons(warp, source, target)
    assert np.mean(reasons == Reason.OUTSIDE) == 1.0


def test_a_full_warp_has_no_empty_pixel():
    rig = stereo_rig(SIZE, ipd=0.0)
    depth = np.full(SIZE[::-1], 5.0, np.float32)
    grid = build_grid(depth, rig["left"], rig["right"], threshold=1.0)
    cuts = {"cut_right": np.zeros((80, 119), bool), "cut_down": np.zeros((79, 120), bool)}
    warp = forward_warp(depth, rig["left"], rig["right"], grid, **cuts)
    assert not empty_reasons(warp, rig["left"], rig["right"]).any()
    # One lost pixel, in the middle of what the source saw.
    nearness = warp.nearness.copy()
    nearness[40, 50] = -np.inf
    reasons = empty_reasons(replace(warp, nearness=nearness), rig["left"], rig["right"])
    assert reasons[40, 50] == Reason.DISOCCLUDED
    assert np.count_nonzero(reasons) == 1


def test_reasons_are_single_bits_that_a_mask_holds():
    bits = [int(reason.bit) for reason in Reason]
    assert all(bit.bit_count() == 1 for bit in bits)
    assert len(set(bits)) == len(bits)
    assert np.bitwise_or.reduce([reason.bit for reason in Reason]) <= np.iinfo(np.uint16).max
    assert Reason.VIEW_DEPENDENT.label == "view-dependent"
    assert len({reason.words for reason in Reason}) == len(bits)
    labels = {reason.label for reason in Reason}
    named = {"disoccluded", "outside", "silhouette", "transparent", "view-dependent", "volume", "defocus"}
    assert named | {"refined", "probe"} <= labels
