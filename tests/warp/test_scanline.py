"""A rectified pair, warped row by row: the same as when its quads are drawn, and calm where numbers are not."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from stereo_reproject.views.camera import target_px_from_source_px
from stereo_reproject.warp.forward import Warp, forward_warp, torn_quads
from stereo_reproject.warp.grid import CELL_QUADS, build_grid, lattice_depth
from stereo_reproject.warp.quads import draw_quads
from stereo_reproject.warp.scanline import row_disparity_of
from tests.warp.analytic import camera, pixel_centres, pose, stereo_rig

SIZE = (93, 70)
RECTIFIED = ["off-axis", "parallel", "orthographic parallel"]

TIES = 2e-4
"""Share of pixels whose centre lies on a corner, and which rounding gives to one side or the other."""


def pair(kind, *, swapped=False, size=SIZE):
    orthographic = kind.startswith("orthographic ")
    mode = kind.removeprefix("orthographic ")
    rig = stereo_rig(size, mode=mode, ipd=0.12, convergence=3.5, orthographic=orthographic)
    return (rig["right"], rig["left"]) if swapped else (rig["left"], rig["right"])


def steps(seed, size=SIZE):
    """A wall that slants and waves, with slabs before it, and which of them each pixel shows."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(size[0]) / size[0], np.arange(size[1]) / size[1])
    depth = 5.0 + rng.uniform(-1, 1) * x + rng.uniform(-1, 1) * y + 0.02 * np.sin(9 * x + 5 * y)
    index = np.zeros(depth.shape, int)
    for k in range(1, 9):
        left, top, wide, high = rng.uniform(0, 0.9), rng.uniform(-0.2, 0.8), rng.uniform(0.02, 0.3), rng.uniform(0.1, 1)
        inside = (x > left) & (x < left + wide) & (y > top) & (y < top + high)
        near = rng.uniform(1.0, 4.0) + 0.5 * (x - left)
        inside &= near < depth
        depth, index = np.where(inside, near, depth), np.where(inside, k, index)
    return depth.astype(np.float32), index


def both(depth, index, source, target, threshold):
    """The warp row by row, and that of its quads."""
    grid = build_grid(depth, source, target, threshold=threshold)
    cuts = {"cut_right": np.diff(index, axis=1) != 0, "cut_down": np.diff(index, axis=0) != 0}
    torn = torn_quads(*cuts.values(), depth)
    return forward_warp(depth, source, target, grid, **cuts), Warp(*draw_quads(depth, source, target, grid, torn))


@pytest.mark.parametrize("kind", RECTIFIED)
@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_it_is_what_drawing_the_quads_gives(kind, swapped, seed):
    source, target = pair(kind, swapped=swapped)
    ours, drawn = both(*steps(seed), source, target, threshold=0.0)
    assert np.mean(ours.covered != drawn.covered) <= TIES
    there = ours.covered & drawn.covered
    close = np.abs(ours.x[there] - drawn.x[there]) < 2e-3
    assert np.mean(~close) <= TIES
    np.testing.assert_allclose(ours.y[there][close], drawn.y[there][close], atol=2e-3)
    # Where a centre lies on a corner at which a surface ends, either side may have it.
    apart = np.abs(ours.nearness[there] - drawn.nearness[there]) > 1e-4 * np.abs(drawn.nearness[there])
    # Nothing moves in an orthographic pair, so all cells are coarse, and their two triangles are not what rows have.
    if "orthographic" not in kind:
        assert np.mean(apart[close]) <= 0.01
    assert 0.5 < there.mean() < 1.0


@pytest.mark.parametrize("kind", RECTIFIED[:2])
@pytest.mark.parametrize("seed", range(4))
def test_coarse_cells_have_their_nearness_from_their_corners_linearly(kind, seed):
    source, target = pair(kind)
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(SIZE[0]) / SIZE[0], np.arange(SIZE[1]) / SIZE[1])
    depth = (5.0 + rng.uniform(-1, 1) * x + rng.uniform(-1, 1) * y + 0.2 * np.sin(9 * x + 5 * y)).astype(np.float32)
    whole = np.zeros(depth.shape, int)
    coarse = both(depth, whole, source, target, threshold=1000.0)[0]
    native = both(depth, whole, source, target, threshold=0.0)[0]
    flat = both(from_the_corners(depth), whole, source, target, threshold=0.0)[0]
    there = coarse.covered & flat.covered & native.covered
    assert np.mean(coarse.covered != flat.covered) <= 4 * TIES
    # The outermost half pixels have the depth of those before them, but in coarse cells.
    there &= (native.x > 1.0) & (native.x < SIZE[0] - 1.0)
    assert np.abs(coarse.x[there] - flat.x[there]).max() < 1e-3 < np.abs(coarse.x[there] - native.x[there]).max()


def from_the_corners(depth):
    """depth (H, W), its inverse bilinear between the corners of cells."""
    height, width = depth.shape
    near = 1.0 / lattice_depth(depth).astype(np.float64)[: height + 2, : width + 2]
    for axis in (0, 1):
        size = near.shape[axis]
        edges = np.append(np.arange(0, size - 1, CELL_QUADS), size - 1)
        lines = np.moveaxis(near, axis, 0)
        near = np.moveaxis(np.array([np.interp(np.arange(size), edges, line) for line in lines[edges].T]).T, 0, axis)
    return (1.0 / near[1:-1, 1:-1]).astype(np.float32)


@pytest.mark.parametrize("kind", RECTIFIED)
@pytest.mark.parametrize("wider", [0, 30])
def test_the_shift_is_where_points_go(kind, wider):
    source, target = pair(kind)
    if wider:
        plane = target.plane
        size = (plane.right - plane.left) / target.width
        target = replace(target, width=target.width + wider, plane=replace(plane, right=plane.right + wider * size))
    shift = row_disparity_of(source, target)
    x, y = pixel_centres(source)
    depth = np.random.default_rng(1).uniform(0.5, 50.0, x.shape)
    target_x, target_y, _ = target_px_from_source_px(source, target, x, y, depth)
    moved = shift.offset + shift.per_nearness * source.nearness_from_depth(depth)
    np.testing.assert_allclose(x + moved, target_x, atol=1e-9)
    np.testing.assert_allclose(y, target_y, atol=1e-9)


@pytest.mark.parametrize(
    "change",
    [
        {"world_from_camera": pose((0.12, 0.01, 0.0))},
        {"world_from_camera": pose((0.12, 0.0, 0.1))},
        {"world_from_camera": pose((0.12, 0.0, 0.0), yaw=0.01)},
        {"height": SIZE[1] + 1},
        {"width": SIZE[0] + 1},
    ],
)
def test_whatever_else_differs_it_is_no_rectified_pair(change):
    left, right = pair("off-axis")
    assert row_disparity_of(left, right) is not None
    assert row_disparity_of(left, replace(right, **change)) is None


def test_neither_are_eyes_that_are_toed_in_or_of_two_kinds():
    assert row_disparity_of(*pair("toe-in")) is None
    left, right = pair("off-axis")
    assert row_disparity_of(left, replace(right, plane=replace(right.plane, top=1.01 * right.plane.top))) is None
    assert row_disparity_of(left, camera(SIZE, orthographic=True)) is None


@pytest.mark.parametrize("kind", RECTIFIED)
@pytest.mark.parametrize("swapped", [False, True])
def test_no_depth_disturbs_it(kind, swapped):
    """Side by side: next to nothing, denormal, far, the sky, and nothing that is known."""
    values = np.array([1e-45, 1e-6, 1e-3, 1.0, 3.5, 1e4, 1e9, 3e38, np.inf, np.nan], np.float32)
    depth = np.random.default_rng(2).choice(values, (SIZE[1], SIZE[0])).astype(np.float32)
    source, target = pair(kind, swapped=swapped)
    grid = build_grid(depth, source, target, threshold=1.0)
    cuts = {"cut_right": np.zeros((SIZE[1], SIZE[0] - 1), bool), "cut_down": np.zeros((SIZE[1] - 1, SIZE[0]), bool)}
    with np.errstate(all="raise", under="ignore", divide="ignore"):
        ours = forward_warp(depth, source, target, grid, **cuts)
    assert np.array_equal(np.isnan(ours.x), ~ours.covered)
    assert np.array_equal(np.isnan(ours.y), ~ours.covered)
    assert not np.isnan(ours.nearness).any()
    x = ours.x[ours.covered]
    assert np.all((x >= -0.5) & (x <= SIZE[0] + 0.5))


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (16, 16), (17, 33), (15, 2)])
def test_pictures_of_any_size(size):
    source, target = pair("off-axis", size=size)
    depth = np.full(size[::-1], 3.5, np.float32)
    ours, drawn = both(depth, np.zeros(depth.shape, int), source, target, threshold=1.0)
    assert np.array_equal(ours.covered, drawn.covered)
    np.testing.assert_allclose(ours.x[ours.covered], drawn.x[ours.covered], atol=2e-3)


@pytest.mark.parametrize("kind", RECTIFIED[:2])
@pytest.mark.parametrize("swapped", [False, True])
def test_a_card_that_moves_by_whole_pixels_keeps_both_its_edges(kind, swapped):
    """Then every centre lies on a corner, the last of which is torn from what comes next."""
    source, target = pair(kind, swapped=swapped)
    shift = row_disparity_of(source, target)
    whole = np.round(shift.offset + shift.per_nearness / 2.0)
    depth, index = np.full(SIZE[::-1], np.inf, np.float32), np.zeros(SIZE[::-1], int)
    depth[20:50, 40:60], index[20:50, 40:60] = shift.per_nearness / (whole - shift.offset), 1
    ours, drawn = both(depth, index, source, target, threshold=0.0)
    row = slice(int(40 + whole), int(60 + whole))
    np.testing.assert_allclose(ours.x[30, row], np.arange(40.5, 60.0), atol=2e-3)
    assert np.array_equal(ours.covered[30], drawn.covered[30])


@pytest.mark.parametrize("swapped", [False, True])
def test_what_is_hardly_wide_in_the_target_shows_nothing_from_elsewhere(swapped):
    """Two pixels that all but fall into one: how far a centre within the tolerance is off must not be blown up."""
    source, target = pair("off-axis", swapped=swapped)
    shift, rng = row_disparity_of(source, target), np.random.default_rng(4)
    near = (np.float64(1.0) / 3.0, np.sign(shift.per_nearness))
    for _ in range(200):
        depth, index = np.full(SIZE[::-1], 3.0, np.float32), np.zeros(SIZE[::-1], int)
        first = 12.0 + rng.choice([0.0, -1e-3, 1e-3, 5e-4]) + rng.normal(0.0, 3e-4)
        moves = np.array([first, first - near[1] * (1.0 + rng.normal(0.0, 1e-5))]) * near[1]
        depth[20:40, 50:52], index[20:40, 50:52] = shift.per_nearness / (moves - shift.offset), 1
        with np.errstate(all="raise", under="ignore", divide="ignore"):
            ours = both(depth, index, source, target, threshold=0.0)[0]
        card = ours.nearness > 0.5
        assert np.all((ours.x[card] >= 49.5) & (ours.x[card] <= 52.5))
        assert np.all(ours.nearness[ours.covered] <= 1.0 / depth.min() + 1e-3)
        assert np.array_equal(np.isnan(ours.y), ~ours.covered)


def test_depth_that_goes_to_and_fro_takes_no_more_memory():
    """By as much from one pixel to the next twice, which is no step: intervals that cover much and show nothing."""
    size = (3840, 64)
    source, target = pair("off-axis", size=size)
    shift = row_disparity_of(source, target)
    moves = np.tile([0.0, 900.0, 1800.0, 900.0], size[0] // 4) * np.sign(shift.per_nearness)
    row = (1.0 / (1.0 / 3.0 + moves / shift.per_nearness)).astype(np.float32)
    depth = np.broadcast_to(row, size[::-1]).copy()
    whole = np.zeros(size[::-1], int)
    grid = build_grid(depth, source, target, threshold=0.0)
    cuts = {"cut_right": np.diff(whole, axis=1) != 0, "cut_down": np.diff(whole, axis=0) != 0}
    tracemalloc.start()
    warp = forward_warp(depth, source, target, grid, **cuts)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 100 * 2**20
    assert warp.covered.mean() < 0.1
