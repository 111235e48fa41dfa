"""The warp of panoramic pairs in a plain room: all that the source shows arrives where it belongs, all around and up to
the poles."""

import numpy as np
import pytest

from stereo_reproject.holes.reprojection import reproject
from stereo_reproject.images.lookup import lookup
from stereo_reproject.images.reasons import Reason
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.views.camera import ViewPlane, target_px_from_source_px
from stereo_reproject.views.panorama import PanoramicCamera
from stereo_reproject.views.projections import (
    CentralCylindrical,
    EquiangularCubeFace,
    Equirectangular,
    FisheyeEquidistant,
)
from stereo_reproject.views.spherical import PoleMerge, SphericalStereo
from stereo_reproject.views.view import View
from stereo_reproject.warp.discontinuities import disparity_of, disparity_steps
from stereo_reproject.warp.empty import empty_reasons
from stereo_reproject.warp.forward import forward_warp
from stereo_reproject.warp.grid import build_grid
from stereo_reproject.warp.options import WarpOptions
from stereo_reproject.warp.quads import _beside_first, _Quads
from stereo_reproject.warp.rendered_view import RenderedView
from stereo_reproject.warp.tuning import TUNING
from stereo_reproject.warp.warper import warp_view

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


TURN = {
    "equirectangular": Equirectangular(WHOLE, HALF),
    "cylinder": CentralCylindrical(WHOLE, (-1.5, 1.5)),
}
"""Projections that close a whole turn: one is warped along its rows, the other quad by quad."""


def turned_source(projection):
    """A room all around whose colours are noise, and the view of the other eye."""
    source, target = (eye(projection, offset, None) for offset in (-0.0325, 0.0325))
    colour = np.random.default_rng(1).random((source.height, source.width, 4), np.float32)
    passes = {"Combined": colour, "Depth": room(source)[..., None], "An AOV": colour}
    return RenderedView(View("source", source), passes), View("target", target)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("projection", TURN.values(), ids=TURN.keys())
def test_colours_are_looked_up_across_the_seam_of_a_whole_turn(projection, interpolation):
    source, target = turned_source(projection)
    options = WarpOptions(interpolation=interpolation, colour_interpolation=interpolation)
    result = warp_view(source, target, options)
    x, y = result.warp.x, result.warp.y
    seam = (result.empty == 0) & ((x < 0.5) | (x > source.camera.width - 0.5))
    assert seam.sum() > 20
    around = {name: np.pad(image, ((0, 0), (8, 8), (0, 0)), mode="wrap") for name, image in source.passes.items()}
    for name in ("Combined", "An AOV"):
        expected = lookup(around[name], x + 8, y, interpolation=interpolation)
        np.testing.assert_allclose(result.passes[name][seam], expected[seam], atol=1e-4)
    nearness = lookup(1.0 / around["Depth"], x + 8, y)[..., 0]
    if isinstance(projection, Equirectangular):
        np.testing.assert_allclose(1.0 / result.passes["Depth"][..., 0][seam], nearness[seam], rtol=1e-4)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_what_is_no_number_is_traced_on_both_sides_of_the_seam(interpolation):
    source, target = turned_source(PROJECTIONS["360"])
    invalid = np.zeros(source.depth.shape, bool)
    invalid[:, 0] = True
    source = RenderedView(source.view, source.passes, invalid=invalid)
    options = WarpOptions(interpolation=interpolation, colour_interpolation=interpolation)
    found = reproject([source], target, SETTINGS["balanced"], options=options)
    reach = 1.5 if interpolation == "cubic" else 0.5
    seam = found.warp.x > source.camera.width - reach
    assert seam.sum() > 20
    assert ((found.reasons[seam] & (Reason.INVALID.bit | Reason.OUTSIDE.bit | Reason.DISOCCLUDED.bit)) > 0).all()


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
