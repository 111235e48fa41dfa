"""The warp of panoramic pairs in a plain room: all that the source shows arrives where it belongs, all around and up to
the poles."""

import numpy as np
import pytest

from stereo_reproject.views.camera import ViewPlane, target_px_from_source_px
from stereo_reproject.views.panorama import PanoramicCamera
from stereo_reproject.views.projections import (
    CentralCylindrical,
    EquiangularCubeFace,
    Equirectangular,
    FisheyeEquidistant,
)
from stereo_reproject.views.spherical import PoleMerge, SphericalStereo
from stereo_reproject.warp.discontinuities import disparity_of, disparity_steps
from stereo_reproject.warp.empty import empty_reasons
from stereo_reproject.warp.forward import forward_warp
from stereo_reproject.warp.grid import build_grid
from stereo_reproject.warp.quads import _beside_first, _Quads
from stereo_reproject.warp.tuning import TUNING

PX = 0.02
"""Pixels: between corners a pixel apart a map bends by so much, where the ceiling is near."""

HALF, WHOLE = (-np.pi / 2, np.pi / 2), (-np.pi, np.pi)
PROJECTIONS = {
    "VR180": Equirectangular(HALF, HALF),
    "360": Equirectangular(WHOLE, HALF),
    "fisheye": FisheyeEquidistant(np.pi),
    "cube face": EquiangularCubeFace(),
    "cylinder": CentralCylindrical((-2.0, 1.5), (-1.5, 1.5)),
}
MERGES = {"apart": None, "merged": PoleMerge(np.radians(60.0), np.radians(75.0))}


def eye(projection, offset, merge):
    stereo = SphericalStereo(offset, 6.5, merge)
    return PanoramicCamera(192, 96, np.eye(4), ViewPlane(0.0, 1.0, 0.0, 1.0), projection, stereo)


def room(camera):
    """Depths (H, W) in a ball of radius 4, with a ceiling and a floor 1.6 above and below the eye."""
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    origin, direction = (np.array(part) for part in camera.ray_from_px(x, y))
    ahead = (origin * direction).sum(axis=0)
    ball = np.sqrt(ahead**2 - (origin**2).sum(axis=0) + 16.0) - ahead
    return np.fmin(ball, 1.6 / np.maximum(np.abs(direction[1]), 1e-9)).astype(np.float32)


@pytest.mark.parametrize("merge", MERGES.values(), ids=MERGES.keys())
@pytest.mark.parametrize("name", PROJECTIONS)
def test_a_room_arrives_whole(name, merge):
    source, target = (eye(PROJECTIONS[name], offset, merge) for offset in (-0.0325, 0.0325))
    depth = room(source)
    grid = build_grid(depth, source, target, threshold=0.25, most=TUNING.tear_pixels)
    cut_right, cut_down = disparity_steps(disparity_of(depth, source, target)).torn()
    warp = forward_warp(depth, source, target, grid, cut_right=cut_right, cut_down=cut_down)

    x, y = np.meshgrid(np.arange(target.width) + 0.5, np.arange(target.height) + 0.5)
    there = target_px_from_source_px(target, source, x, y, room(target))
    shown = np.isfinite(there[0]) & (there[0] >= 0) & (there[0] <= source.width) & (there[1] <= source.height)
    shown &= (there[1] >= 0) & np.isfinite(source.ray_from_px(there[0], there[1])[1][0])
    # At the pole itself a pixel is stretched over half of the row, and a fisheye's edge is traced.
    answered = empty_reasons(warp, source, target) == 0
    assert np.mean(answered[shown]) > (0.97 if name != "fisheye" else 0.92)
    off_x = warp.x - there[0]
    if np.isfinite(source.period_px):
        off_x -= source.period_px * np.round(off_x / source.period_px)
    off = np.hypot(off_x, warp.y - there[1])
    inner = answered & shown & (y > 3.0) & (y < target.height - 3.0)
    assert np.percentile(off[inner], 99) < PX


@pytest.mark.parametrize("unseen", [0, 4])
def test_a_corner_that_is_not_seen_loses_its_own_quads_alone(unseen):
    """Of a cell of two by two quads across the edge of a picture 100 pixels wide."""
    x = np.array([[[98.0, 99.0, 1.0], [98.0, 99.0, 1.0], [98.0, 99.0, 1.0]]])
    x.ravel()[unseen] = np.nan
    one = np.ones((1, 2, 2), bool)
    placed = _beside_first(_Quads(x, x, x, one, one, one, one, one, one), 100.0).x
    expected = np.array([[[98.0, 99.0, 101.0]] * 3])
    expected.ravel()[unseen] = np.nan
    np.testing.assert_array_equal(placed, expected)
