"""Which cells are subdivided: by definition, cell by cell, in plain loops."""

import numpy as np
import pytest

from stereo_reproject.settings.frame import StereoSettings
from stereo_reproject.views.parallax import ARC_MINUTE, parallax_difference
from stereo_reproject.warp.grid import CELL_QUADS, build_grid, lattice_depth
from stereo_reproject.warp.options import WarpOptions
from tests.warp.analytic import stereo_rig

IPD = 0.1
SIZES = [(16, 16), (96, 64), (97, 63), (15, 1), (1, 1), (16, 15), (33, 47)]


def grid_of(depth, *, threshold=1.0, ipd=IPD, orthographic=False, mode="off-axis"):
    height, width = depth.shape
    rig = stereo_rig((width, height), ipd=ipd, orthographic=orthographic, mode=mode)
    return build_grid(depth.astype(np.float32), rig["left"], rig["right"], threshold=threshold)


def cell_vertices(depth, row, column):
    """Depths at the vertices of a cell: pixel centres, with a ring around the frame that repeats the border."""
    height, width = depth.shape
    i = np.clip(np.arange(row * 16, row * 16 + 17) - 1, 0, height - 1)
    j = np.clip(np.arange(column * 16, column * 16 + 17) - 1, 0, width - 1)
    return depth[np.ix_(i, j)]


def subdivided_by_definition(depth, threshold, ipd=IPD):
    """The paper's rule, cell by cell, with the guard of the 4-neighbourhood."""
    rows, columns = -(-(depth.shape[0] + 1) // 16), -(-(depth.shape[1] + 1) // 16)
    steep = np.zeros((rows, columns), bool)
    for row in range(rows):
        for column in range(columns):
            cell = cell_vertices(depth.astype(np.float32).astype(np.float64), row, column)
            difference = parallax_difference(cell.min(), cell.max(), ipd)
            steep[row, column] = not difference <= threshold * ARC_MINUTE
    guarded = steep.copy()
    for row, column in zip(*np.nonzero(steep), strict=True):
        for i, j in ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)):
            if 0 <= i < rows and 0 <= j < columns:
                guarded[i, j] = True
    return guarded


def one_cell(row=2, column=2, shape=(96, 96)):
    """A frontal plane with a spot in the middle of one cell, well inside."""
    depth = np.full(shape, 5.0)
    depth[row * CELL_QUADS + 7, column * CELL_QUADS + 7] = 4.0
    return depth


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("size", SIZES)
def test_a_frontal_plane_is_coarse(size, orthographic):
    grid = grid_of(np.full(size[::-1], 3.0), orthographic=orthographic, mode="toe-in")
    assert not grid.subdivided.any()
    assert grid.cells == grid.subdivided.size
    assert grid.triangles == 2 * grid.cells


@pytest.mark.parametrize("orthographic", [False, True])
def test_a_sky_is_coarse(orthographic):
    assert not grid_of(np.full((64, 96), np.inf), orthographic=orthographic, mode="toe-in").subdivided.any()


@pytest.mark.parametrize("orthographic", [False, True])
def test_a_step_subdivides_its_cell_and_the_four_neighbours(orthographic):
    subdivided = grid_of(one_cell(), orthographic=orthographic, mode="toe-in").subdivided
    expected = np.zeros_like(subdivided)
    expected[2, 1:4] = expected[1:4, 2] = True
    np.testing.assert_array_equal(subdivided, expected)


@pytest.mark.parametrize("corner", [(0, 0), (0, 5), (5, 0), (5, 5)])
def test_the_guard_ends_at_the_frame(corner):
    depth = np.full((95, 95), 5.0)
    depth[corner[0] * 16 + 7, corner[1] * 16 + 7] = 4.0
    grid = grid_of(depth)
    assert grid.subdivided.shape == (6, 6)
    assert grid.subdivided.sum() == 3


@pytest.mark.parametrize("place", [(32 - 1, 40), (40, 48 - 1), (32 - 1, 48 - 1)])
def test_vertices_on_a_border_count_for_every_cell_that_shares_them(place):
    """A spot on a shared vertex makes two cells steep, or four in a corner: the extremes reach over the border."""
    depth = np.full((95, 95), 5.0)
    depth[place] = 4.0
    np.testing.assert_array_equal(grid_of(depth).subdivided, subdivided_by_definition(depth, 1.0))
    # By hand for the first: the cells above and below the border, and what is around them.
    if place == (31, 40):
        assert grid_of(depth).subdivided.sum() == 2 + 6


def test_a_nan_subdivides_its_cell():
    depth = np.full((96, 96), 5.0)
    depth[2 * CELL_QUADS + 7, 2 * CELL_QUADS + 7] = np.nan
    subdivided = grid_of(depth).subdivided
    assert subdivided[2, 2]
    assert subdivided.sum() == 5


def test_a_horizon_is_subdivided_only_where_sky_meets_ground():
    depth = np.full((96, 96), 50.0)
    depth[:40] = np.inf
    subdivided = grid_of(depth).subdivided
    np.testing.assert_array_equal(np.nonzero(subdivided.any(axis=1))[0], [1, 2, 3])
    assert subdivided[2].all()


@pytest.mark.parametrize("threshold", [0.25, 1.0, 10.0])
def test_the_threshold_is_in_arc_minutes_and_not_subdivided_when_met(threshold):
    """At a parallax of a thousandth less than the threshold a step stays coarse, of a thousandth more it does not."""
    far = 5.0
    for factor, expected in ((0.999, False), (1.001, True)):
        angle = 2.0 * np.arctan(0.5 * IPD / far) + factor * threshold * ARC_MINUTE
        depth = np.full((64, 64), far)
        depth[24, 24] = 0.5 * IPD / np.tan(0.5 * angle)
        assert grid_of(depth, threshold=threshold).subdivided.any() == expected


@pytest.mark.parametrize("threshold", [StereoSettings().grid_threshold, WarpOptions().grid_threshold])
def test_by_default_relief_is_flattened_only_below_what_stereo_acuity_tells(threshold):
    """Sharp eyes tell differences of 0.2 to 0.5 arc minutes: what is finer may go, nearly all that is seen stays."""
    far = 5.0
    for arc_minutes, kept in ((0.2, False), (0.3, True)):
        angle = 2.0 * np.arctan(0.5 * IPD / far) + arc_minutes * ARC_MINUTE
        depth = np.full((64, 64), far)
        depth[24, 24] = 0.5 * IPD / np.tan(0.5 * angle)
        assert grid_of(depth, threshold=threshold).subdivided.any() == kept


def test_threshold_zero_subdivides_whatever_is_not_frontal():
    depth = np.full((64, 64), 5.0)
    assert not grid_of(depth, threshold=0.0).subdivided.any()
    depth += np.linspace(0.0, 1e-3, 64)
    assert grid_of(depth, threshold=0.0).subdivided.all()


def test_without_interocular_distance_only_unknown_depths_are_subdivided():
    depth = np.random.default_rng(2).uniform(1.0, 90.0, (64, 64))
    depth[10:20] = np.inf
    assert not grid_of(depth, ipd=0.0, threshold=0.0).subdivided.any()


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("threshold", [0.5, 3.0])
def test_random_depths_are_subdivided_by_the_definition(size, threshold):
    rng = np.random.default_rng(sum(size))
    for _ in range(5):
        i, j = np.meshgrid(np.arange(size[1]), np.arange(size[0]), indexing="ij")
        depth = 5.0 + rng.uniform(0.0, 0.02) * i + rng.uniform(0.0, 0.002) * j
        spots = rng.random(depth.shape) < 0.001
        depth[spots] = rng.uniform(1.0, 90.0, spots.sum())
        depth[rng.random(depth.shape) < 0.0005] = np.inf
        grid = grid_of(depth, threshold=threshold)
        np.testing.assert_array_equal(grid.subdivided, subdivided_by_definition(depth, threshold))


@pytest.mark.parametrize("size", SIZES)
def test_triangles_by_count(size):
    """Two per coarse cell, two per pair of neighbouring pixels and rows: a cell at the frame's end is cut short."""
    rng = np.random.default_rng(sum(size))
    width, height = size
    depth = np.where(rng.random((height, width)) < 0.003, 4.0, 5.0)
    grid = grid_of(depth)
    rows, columns = grid.subdivided.shape
    triangles = 0
    for row in range(rows):
        for column in range(columns):
            if grid.subdivided[row, column]:
                down = sum(1 for i in range(row * 16, row * 16 + 16) if i < height + 1)
                right = sum(1 for j in range(column * 16, column * 16 + 16) if j < width + 1)
                triangles += 2 * down * right
            else:
                triangles += 2
    assert grid.triangles == triangles
    assert (grid.width, grid.height, grid.cells) == (width, height, rows * columns)


@pytest.mark.parametrize("size", SIZES)
def test_the_lattice_is_the_pixels_and_a_ring_that_repeats_the_border(size):
    depth = np.random.default_rng(1).uniform(1.0, 9.0, size[::-1]).astype(np.float32)
    lattice = lattice_depth(depth)
    assert lattice.shape[0] % 16 == lattice.shape[1] % 16 == 1
    height, width = depth.shape
    np.testing.assert_array_equal(lattice[1 : height + 1, 1 : width + 1], depth)
    np.testing.assert_array_equal(lattice[0, 1 : width + 1], depth[0])
    np.testing.assert_array_equal(lattice[height + 1, 1 : width + 1], depth[-1])
    np.testing.assert_array_equal(lattice[1 : height + 1, 0], depth[:, 0])
    np.testing.assert_array_equal(lattice[1 : height + 1, width + 1], depth[:, -1])
