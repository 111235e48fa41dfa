"""The shift along rows of equirectangular eyes: what it says is what the cameras say, and its map is that of quads."""

from dataclasses import replace

import numpy as np
import pytest

from stereo_reproject.views.camera import ViewPlane, goes_round, target_px_from_source_px
from stereo_reproject.views.panorama import PanoramicCamera
from stereo_reproject.views.projections import CentralCylindrical, Equirectangular, FisheyeEquidistant
from stereo_reproject.views.spherical import PoleMerge, SphericalStereo
from stereo_reproject.warp.discontinuities import disparity_of, disparity_steps
from stereo_reproject.warp.forward import forward_warp, tear_sides, torn_quads
from stereo_reproject.warp.grid import Grid, build_grid
from stereo_reproject.warp.quads import draw_quads
from stereo_reproject.warp.scanline import row_law_of
from stereo_reproject.warp.tuning import TUNING
from tests.warp.analytic import pose

PX = 1e-3
"""Pixels of a picture 192 pixels wide: float32 holds 1e-5 of them, and a straight line between corners bends less."""

BETWEEN_CORNERS = 2e-2
"""Pixels by which quads and rows may differ between corners: each takes another way through a bent surface."""

HALF, WHOLE = (-np.pi / 2, np.pi / 2), (-np.pi, np.pi)
SIZE = (192, 96)
GENERAL = pose((0.2, -0.15, 0.1), yaw=0.3, pitch=-0.2, roll=0.15)
PICTURE = ViewPlane(0.0, 1.0, 0.0, 1.0)
PROJECTIONS = {
    "VR180": Equirectangular(HALF, HALF),
    "360": Equirectangular(WHOLE, HALF),
    "part of a sphere": Equirectangular((0.3, 2.9), (-0.6, 1.2)),
    "mirrored": Equirectangular(HALF[::-1], HALF),
    "upside down": Equirectangular(HALF, HALF[::-1]),
}
MERGES = {"apart": None, "merged": PoleMerge(np.radians(60.0), np.radians(75.0))}
CONVERGENCES = [0.7, 6.5, np.inf]


def eye(projection, offset, merge=None, convergence=6.5, window=PICTURE):
    stereo = SphericalStereo(offset, convergence, merge)
    return PanoramicCamera(*SIZE, GENERAL, window, projection, stereo)


def pair(projection, merge=None, convergence=6.5, window=PICTURE):
    return tuple(eye(projection, offset, merge, convergence, window) for offset in (-0.0325, 0.0325))


def around(difference, camera):
    """A difference of columns, with whole turns taken off."""
    if not np.isfinite(camera.period_px):
        return difference
    return difference - camera.period_px * np.round(difference / camera.period_px)


@pytest.mark.parametrize("convergence", CONVERGENCES)
@pytest.mark.parametrize("merge", MERGES.values(), ids=MERGES.keys())
@pytest.mark.parametrize("name", PROJECTIONS)
@pytest.mark.parametrize("turned", [False, True], ids=["left to right", "right to left"])
def test_points_move_as_the_cameras_say(name, merge, convergence, turned):
    source, target = pair(PROJECTIONS[name], merge, convergence)[:: -1 if turned else 1]
    law, rows = row_law_of(source, target), np.arange(SIZE[1])
    assert law.wraps == (name == "360")
    x, y = np.array(70.5), rows[:, None] + 0.5
    depth = np.array([0.05, 0.3, 1.0, 4.0, 60.0, np.inf])
    there_x, there_y, away = target_px_from_source_px(source, target, x, y, depth)
    near = np.broadcast_to(source.nearness_from_depth(depth), there_x.shape).astype(np.float32)
    moved = law.moved(near, rows)
    np.testing.assert_allclose(around(there_x - x - moved, source), 0.0, atol=PX)
    np.testing.assert_allclose(there_y, np.broadcast_to(y, there_y.shape), atol=1e-6)
    np.testing.assert_allclose(away, np.broadcast_to(depth, away.shape), rtol=1e-9)
    assert (np.diff(moved[48]) > 0.0).all() != law.grows  # farther and farther


def test_pairs_whose_rows_do_not_match():
    source, target = pair(PROJECTIONS["VR180"])
    assert row_law_of(source, target) is not None
    others = [
        replace(target, stereo=replace(target.stereo, offset=0.02)),
        replace(target, stereo=replace(target.stereo, convergence=2.0)),
        replace(target, stereo=None),
        replace(target, world_from_camera=pose((0.2, -0.15, 0.1), yaw=0.31)),
        replace(target, window=replace(PICTURE, left=0.1)),
        replace(target, projection=FisheyeEquidistant(np.pi)),
    ]
    assert [row_law_of(source, other) for other in others] == [None] * len(others)
    for projection in (FisheyeEquidistant(np.pi), CentralCylindrical((-2.0, 1.5), (-1.5, 1.5))):
        assert row_law_of(*pair(projection)) is None
    # Of a turn that is cut, some may be seen at both ends.
    assert row_law_of(*pair(PROJECTIONS["360"], window=ViewPlane(0.1, 0.9, 0.0, 1.0))) is None
    assert row_law_of(*pair(PROJECTIONS["360"], window=ViewPlane(0.4, 0.6, 0.0, 1.0))) is not None


def boxes(camera, seed=3):
    """Depths (H, W) of a bent wall with things before it, some of them across the edge of a whole turn."""
    x, y = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    depth = 4.0 + np.cos(4.0 * np.pi * x / camera.width) * np.cos(y / 20.0)
    rng = np.random.default_rng(seed)
    for column in (0, 40, 95, 150, 186):
        high = slice(*sorted(rng.integers(5, 90, 2)))
        depth[high, np.arange(column, column + 14) % camera.width] = rng.uniform(0.3, 2.0)
    depth[:8] = np.inf
    return depth.astype(np.float32)


def both_maps(source, target, depth, grid):
    cut_right, cut_down = disparity_steps(disparity_of(depth, source, target)).torn()
    warp = forward_warp(depth, source, target, grid, cut_right=cut_right, cut_down=cut_down)
    torn = torn_quads(cut_right, cut_down, depth)
    if goes_round(source):
        tear_sides(torn, depth, source, target)
    return warp, draw_quads(depth, source, target, grid, torn)


@pytest.mark.parametrize("merge", MERGES.values(), ids=MERGES.keys())
@pytest.mark.parametrize("name", PROJECTIONS)
@pytest.mark.parametrize("fine", [True, False], ids=["every pixel", "grid"])
def test_the_map_is_that_of_quads(name, merge, fine):
    source, target = pair(PROJECTIONS[name], merge)
    depth = boxes(source)
    grid = build_grid(depth, source, target, threshold=0.25, most=TUNING.tear_pixels)
    grid = Grid(np.ones_like(grid.subdivided), grid.width, grid.height) if fine else grid
    warp, (x, _, nearness) = both_maps(source, target, depth, grid)
    covered = nearness > -np.inf
    assert np.mean(covered != warp.covered) < 2e-3
    both = covered & warp.covered
    off = np.abs(around(warp.x - x, source))[both]
    assert np.mean(off < BETWEEN_CORNERS) > 0.995
    near = np.abs(warp.nearness[both] - nearness[both])
    assert np.mean(near < 1e-3) > 0.995


def test_a_whole_turn_has_no_edge():
    """The picture turned by a third of a turn gives the map turned as far."""
    source, target = pair(PROJECTIONS["360"])
    depth = boxes(source)
    grid = Grid(np.ones((7, 13), bool), *SIZE)
    turn = SIZE[0] // 3
    plain, turned = (both_maps(source, target, np.roll(depth, by, axis=1), grid)[0] for by in (0, turn))
    covered = np.roll(plain.covered, turn, axis=1)
    assert np.mean(covered != turned.covered) < 1e-3
    off = around(np.roll(plain.x, turn, axis=1) + turn - turned.x, source)[covered & turned.covered]
    assert np.mean(np.abs(off) < PX) > 0.999
    places = turned.x[turned.covered]
    assert places.min() >= 0.0
    assert places.max() <= SIZE[0]


def test_what_is_near_hides_what_is_far_across_the_edge_of_a_turn():
    source, target = pair(PROJECTIONS["360"])
    depth = np.full((SIZE[1], SIZE[0]), 5.0, np.float32)
    depth[40:56, -6:] = 0.2
    warp = both_maps(source, target, depth, Grid(np.ones((7, 13), bool), *SIZE))[0]
    moved = row_law_of(source, target).moved(np.full((1, 1), 5.0, np.float32), np.array([48]))[0, 0]
    columns = np.arange(np.ceil(SIZE[0] - 5.5 + moved), np.floor(SIZE[0] - 1.0 + moved)).astype(int) % SIZE[0]
    np.testing.assert_allclose(warp.nearness[48, columns], 5.0, rtol=1e-5)
    assert moved < -1.0


def test_unknown_depth_is_left_out():
    source, target = pair(PROJECTIONS["360"])
    depth = boxes(source)
    depth[30:40, -4:] = depth[30:40, :4] = np.nan
    warp = both_maps(source, target, depth, Grid(np.ones((7, 13), bool), *SIZE))[0]
    assert not np.isin(np.floor(warp.x[33]), [188, 189, 190, 191, 0, 1, 2, 3])[warp.covered[33]].any()
    assert 0.7 < warp.covered[33].mean() < 1.0
