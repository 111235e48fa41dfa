"""Drawing quad by quad: how much is drawn at a time, and what is settled by the order."""

from __future__ import annotations

import numpy as np
import pytest

from stereo_reproject import bands, quads
from stereo_reproject.grid import build_grid
from stereo_reproject.holes import TEAR
from stereo_reproject.quads import draw_quads

from .analytic import Plane, World, pixel_centres
from .exact import Rig

SIZE = (160, 90)
AT_ONCE = 256
"""Pixels: of which a picture has 56 times as many."""


def drawn():
    """x, y and nearness of a floor that reaches up to the plane in which the target's camera stands."""
    source, target = Rig(size=SIZE, mode="toe-in", lens=20.0, ipd=6.0, convergence=3.0).eyes
    floor = Plane((0.0, -0.6, 0.0), normal=(0.0, 1.0, 0.0))
    depth = World((floor,)).hit(source, *pixel_centres(source))[0].astype(np.float32)
    grid = build_grid(depth, source, target, threshold=0.0, most=TEAR)
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
    monkeypatch.setattr(bands, "PIXELS", AT_ONCE)
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
