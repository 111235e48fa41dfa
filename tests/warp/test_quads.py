"""Drawing quad by quad: how much is drawn at a time, and what is settled by the order."""

from __future__ import annotations

import numpy as np
import pytest

from stereo_reproject.images import bands
from stereo_reproject.views.camera import target_px_from_source_px
from stereo_reproject.warp import quads
from stereo_reproject.warp.grid import build_grid
from stereo_reproject.warp.quads import draw_quads
from stereo_reproject.warp.tuning import TUNING as WARP_TUNING
from tests.warp.analytic import Plane, World, pixel_centres
from tests.warp.exact import Rig, passes_of, reprojected

SIZE = (160, 90)
AT_ONCE = 256
"""Pixels: of which a picture has 56 times as many."""


def drawn():
    """x, y and nearness of a floor that reaches up to the plane in which the target's camera stands."""
    source, target = Rig(size=SIZE, mode="toe-in", lens=20.0, ipd=6.0, convergence=3.0).eyes
    floor = Plane((0.0, -0.6, 0.0), normal=(0.0, 1.0, 0.0))
    depth = World((floor,)).hit(source, *pixel_centres(source))[0].astype(np.float32)
    grid = build_grid(depth, source, target, threshold=0.0, most=WARP_TUNING.tear_pixels)
    return draw_quads(depth, source, target, grid, np.zeros((SIZE[1] + 1, SIZE[0] + 1), bool))


@pytest.fixture
def at_once(monkeypatch):
    """How many pixels were tried each time, of all quads and of the largest."""
    counts, candidates = [], quads._candidates

    def counted(count_x, count_y, rows):
        counts.append((int(np.sum(count_x * count_y)), int(np.max(count_x * count_y))))
        return candidates(count_x, count_y, rows)

    monkeypatch.setattr(quads, "_candidates", counted)
    return counts


def test_quads_that_cover_the_picture_are_drawn_in_parts(at_once, monkeypatch):
    whole = drawn()
    assert max(largest for _, largest in at_once) > AT_ONCE, "the scene has such quads, or nothing is shown here"
    tried = sum(pixels for pixels, _ in at_once)
    at_once.clear()
    monkeypatch.setattr(bands, "BAND_PIXELS", AT_ONCE)
    parts = drawn()
    assert max(pixels for pixels, _ in at_once) <= 2 * AT_ONCE
    assert sum(pixels for pixels, _ in at_once) == tried
    for part, one in zip(parts, whole, strict=True):
        np.testing.assert_array_equal(part, one)


@pytest.mark.parametrize("at_a_time", [1, 2, 5])
def test_of_what_is_as_near_the_first_is_kept(at_a_time):
    surface = quads._Surface((1, 2))
    pixel, nearness, x = np.array([0, 1, 0, 0, 1]), np.array([0.5, 0.1, 0.7, 0.7, 0.1]), np.arange(5.0)
    for start in range(0, 5, at_a_time):
        part = slice(start, start + at_a_time)
        surface._store(pixel[part], nearness[part], x[part], x[part])
    assert surface.x.tolist() == [2.0, 1.0]


def parallel_rays(size, scale):
    """Eyes toed in around the middle: they leave every row where it is, so that pixel centres lie on quads' sides."""
    return Rig(size=size, mode="toe-in", scale=scale, ipd=0.02 * scale, convergence=scale).eyes


def warped(world, source, target):
    depth = world.hit(source, *pixel_centres(source))[0]
    return reprojected(passes_of(depth), source, target)


@pytest.mark.parametrize("scale", 10.0 ** np.arange(1, 7))
@pytest.mark.parametrize("swapped", [False, True])
def test_no_crack_is_left_where_coarse_cells_meet_fine_ones(scale, swapped):
    """A wall and a card before it: beside the card, the wall's cells are fine."""
    card = Plane((0.1 * scale, 0.0, -scale), half=0.2 * scale)
    world = World((Plane((0.0, 0.0, -2.0 * scale), (0.1, 0.05, 1.0)), card))
    result = warped(world, *parallel_rays((640, 360), scale)[:: -1 if swapped else 1])
    assert 0.1 < result.grid.subdivided.mean() < 0.9
    # What is uncovered is as high as the card or the picture: a crack is a row.
    empty = np.pad(~result.warp.covered, ((1, 1), (0, 0)), mode="edge")
    assert not (empty[1:-1] & ~empty[:-2] & ~empty[2:]).any()


def test_the_last_row_before_what_is_behind_the_camera_is_whole():
    """Its pixel centres lie on the sides of quads: in them, whatever rounding says of the sides."""
    source, target = parallel_rays((150, 90), 5.0)
    near = np.full((90, 150), 1e-6)
    behind = np.isnan(target_px_from_source_px(source, target, *pixel_centres(source), near)[0])
    columns = np.flatnonzero(behind.all(axis=0))[5:-5]
    assert columns.size > 50
    for row in range(2, 88):
        depth = np.float32(np.where(np.arange(90)[:, None] < row, 1.0, near))
        grid = build_grid(depth, source, target, threshold=0.0, most=WARP_TUNING.tear_pixels)
        x, _, _ = draw_quads(depth, source, target, grid, np.zeros((91, 151), bool))
        shown = ~np.isnan(x[:, columns])
        assert shown[:row].all(), row
        assert not shown[row:].any(), row


def test_of_what_all_but_coincides_the_fine_quads_are_seen():
    surface, pixel, place = quads._Surface((1, 4)), np.arange(4), np.arange(4.0)
    surface._store(pixel[:3], np.array([1.0, -1.0, 0.0]), place[:3], place[:3])
    surface.prefer_what_is_drawn()
    nearer = np.array([1.0 + 1e-6, -1.0 + 1e-6, 0.0, -1.0])
    surface._store(pixel, nearer, 10.0 + place, 10.0 + place)
    assert surface.x.tolist() == [0.0, 1.0, 2.0, 13.0]
    surface._store(pixel[:2], np.array([1.0 + 1e-4, -1.0 + 1e-4]), 20.0 + place[:2], 20.0 + place[:2])
    assert surface.x.tolist() == [20.0, 21.0, 2.0, 13.0]
