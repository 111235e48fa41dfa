"""Panoramic cameras: their two maps undo each other, and spherical stereo is what its definition says."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from stereo_reproject.views.camera import (
    ViewPlane,
    disparity_per_nearness,
    eye_distance,
    planar,
    see_the_same,
    target_px_from_source_px,
)
from stereo_reproject.views.panorama import PanoramicCamera
from stereo_reproject.views.projections import (
    CentralCylindrical,
    EquiangularCubeFace,
    Equirectangular,
    FisheyeEquidistant,
    FisheyeEquisolid,
    FisheyePolynomial,
    Rectilinear,
)
from stereo_reproject.views.spherical import PoleMerge, SphericalStereo
from tests.warp.analytic import pixel_centres, pose

PX_TOLERANCE = 1e-6
"""Pixels: float64 geometry; the poles of a picture of some hundred pixels and the search for a merged one lose
digits."""

SIZE = (120, 60)
DEGREE = np.pi / 180.0
HALF, WHOLE = (-np.pi / 2, np.pi / 2), (-np.pi, np.pi)
PICTURE = ViewPlane(0.0, 1.0, 0.0, 1.0)

PROJECTIONS = {
    "VR180": Equirectangular(HALF, HALF),
    "360": Equirectangular(WHOLE, HALF),
    "part of a sphere": Equirectangular((0.3, 2.9), (-0.6, 1.2)),
    "equidistant": FisheyeEquidistant(220.0 * DEGREE),
    "equisolid": FisheyeEquisolid(9.0, 170.0 * DEGREE, (36.0, 18.0)),
    "polynomial": FisheyePolynomial((-1.17e-5, -0.02, -3.4e-6, 3.1e-6, -2.6e-8), np.pi, (36.0, 18.0)),
    "cube face": EquiangularCubeFace(),
    "cylinder": CentralCylindrical((-2.0, 1.5), (-1.5, 3.0)),
    "cylinder, unit": CentralCylindrical((-2.0, 1.5), (-1.5, 3.0), is_unit=True),
    "perspective": Rectilinear(),
}
MERGES = {"apart": None, "merged": PoleMerge(60.0 * DEGREE, 75.0 * DEGREE), "soon": PoleMerge(0.0, 5.0 * DEGREE)}
STEREOS = {"plain": None} | {
    f"{side}, {convergence:g}, {name}": SphericalStereo(side * 0.05, convergence, merge)
    for side, convergence, (name, merge) in itertools.product((-1, 1), (0.7, np.inf), MERGES.items())
}


def camera(projection, stereo=None, turned=None):
    window = ViewPlane(-1.2, 1.1, -0.7, 0.9) if isinstance(projection, Rectilinear) else PICTURE
    world = np.eye(4) if turned is None else turned
    return PanoramicCamera(*SIZE, world, window, projection, stereo, isinstance(projection, Rectilinear))


GENERAL = pose((0.2, -0.15, 0.1), yaw=0.3, pitch=-0.2, roll=0.15)


def moved(origin, direction, depth):
    return tuple(o + depth * d for o, d in zip(origin, direction, strict=True))


@pytest.mark.parametrize("stereo", STEREOS.values(), ids=STEREOS.keys())
@pytest.mark.parametrize("projection", PROJECTIONS.values(), ids=PROJECTIONS.keys())
@pytest.mark.parametrize("depth", [0.4, 3.0, 1e4])
def test_project_after_unproject_is_the_identity(projection, stereo, depth):
    eye = camera(projection, stereo, GENERAL)
    x, y = pixel_centres(eye)
    origin, direction = eye.ray_from_px(x, y)
    back_x, back_y, back_depth = eye.px_from_point(moved(origin, direction, depth), np.ones_like(x))
    shown = np.isfinite(direction[0])
    assert shown.mean() > 0.3
    assert np.array_equal(np.isfinite(back_x), shown)
    off = back_x - x
    if np.isfinite(eye.period_px):
        off -= eye.period_px * np.round(off / eye.period_px)
    np.testing.assert_allclose(off[shown], 0.0, atol=PX_TOLERANCE)
    np.testing.assert_allclose(back_y[shown], y[shown], rtol=0.0, atol=PX_TOLERANCE)
    np.testing.assert_allclose(back_depth[shown], depth, rtol=1e-9)


@pytest.mark.parametrize("stereo", STEREOS.values(), ids=STEREOS.keys())
@pytest.mark.parametrize("projection", PROJECTIONS.values(), ids=PROJECTIONS.keys())
def test_the_sky_is_where_very_far_points_are(projection, stereo):
    eye = camera(projection, stereo, GENERAL)
    x, y = pixel_centres(eye)
    _, direction = eye.ray_from_px(x, y)
    sky_x, sky_y, sky_depth = eye.px_from_point(direction, np.zeros_like(x))
    far_x, far_y, _ = eye.px_from_point(direction, np.full_like(x, 1e-11))
    shown = np.isfinite(direction[0])
    assert np.all(np.isposinf(sky_depth[shown]))
    np.testing.assert_allclose(sky_x[shown], far_x[shown], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(sky_y[shown], far_y[shown], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("stereo", STEREOS.values(), ids=STEREOS.keys())
@pytest.mark.parametrize("projection", PROJECTIONS.values(), ids=PROJECTIONS.keys())
def test_rays_are_of_length_one_and_begin_on_the_circle(projection, stereo):
    eye = camera(projection, stereo)
    x, y = pixel_centres(eye)
    origin, direction = (np.array(np.broadcast_arrays(*part, x)[:3]) for part in eye.ray_from_px(x, y))
    shown = np.isfinite(direction[0])
    np.testing.assert_allclose(np.linalg.norm(direction, axis=0)[shown], 1.0, rtol=1e-12)
    reach = np.linalg.norm(origin, axis=0)[shown]
    assert reach.max() <= (0.0 if stereo is None else 0.05 * (1.0 + 1e-12))
    if stereo is not None and stereo.poles is None:
        np.testing.assert_allclose(reach, 0.05, rtol=1e-12)


@pytest.mark.parametrize("name", ["VR180", "360", "cylinder, unit"])
def test_both_eyes_meet_at_the_convergence_distance(name):
    eyes = [camera(PROJECTIONS[name], SphericalStereo(side * 0.05, 0.7)) for side in (-1.0, 1.0)]
    x, y = pixel_centres(eyes[0])
    for eye in eyes:
        origin, direction = eye.ray_from_px(x, y)
        met = np.array(moved(origin, direction, np.hypot(0.05, 0.7)))
        np.testing.assert_allclose(np.linalg.norm(met, axis=0), 0.7, rtol=1e-9)
    there = target_px_from_source_px(eyes[0], eyes[1], x, y, np.hypot(0.05, 0.7))
    off = there[0] - x
    off -= np.round(off / SIZE[0]) * SIZE[0] if name == "360" else 0.0
    np.testing.assert_allclose(off, 0.0, atol=PX_TOLERANCE)


@pytest.mark.parametrize("convergence", [0.7, np.inf])
def test_rows_of_an_equirectangular_pair_match(convergence):
    """Nearer than the convergence distance too, and near the poles."""
    left, right = (camera(PROJECTIONS["VR180"], SphericalStereo(side * 0.05, convergence)) for side in (-1.0, 1.0))
    x, y = pixel_centres(left)
    for depth in (0.3, 1.0, 20.0, np.inf):
        _, row, _ = target_px_from_source_px(left, right, x, y, depth)
        seen = np.isfinite(row)
        assert seen.mean() > 0.8
        np.testing.assert_allclose(row[seen], y[seen], rtol=0.0, atol=PX_TOLERANCE)


def test_a_pole_merge_without_a_width():
    eye = camera(PROJECTIONS["VR180"], SphericalStereo(0.05, np.inf, PoleMerge(0.8, 0.8)))
    x, y = pixel_centres(eye)
    origin, direction = eye.ray_from_px(x, y)
    back_x, back_y, _ = eye.px_from_point(moved(origin, direction, 2.0), np.ones_like(x))
    np.testing.assert_allclose(back_x, x, rtol=0.0, atol=PX_TOLERANCE)
    np.testing.assert_allclose(back_y, y, rtol=0.0, atol=PX_TOLERANCE)


def test_a_fisheye_shows_nothing_beyond_its_circle():
    x, y = pixel_centres(camera(PROJECTIONS["equidistant"]))
    _, direction = camera(PROJECTIONS["equidistant"]).ray_from_px(x, y)
    inside = np.hypot(x / SIZE[0] - 0.5, y / SIZE[1] - 0.5) <= 0.5
    for part in direction:
        assert np.array_equal(np.isfinite(part), inside)


def test_what_lies_within_the_circle_of_the_eyes_is_seen_by_no_parallel_ray():
    eye = camera(PROJECTIONS["360"], SphericalStereo(0.05, np.inf))
    zero, one = np.array(0.0), np.array(1.0)
    assert np.isnan(eye.px_from_point((np.array(0.03), one, zero), one)[0])
    assert np.isfinite(eye.px_from_point((np.array(0.06), one, zero), one)[0])


def test_nearness_has_an_inverse():
    eye = camera(PROJECTIONS["360"])
    depth = np.array([0.01, 3.0, 1e7, np.inf])
    np.testing.assert_allclose(eye.depth_from_nearness(eye.nearness_from_depth(depth)), depth)


def test_cameras_see_the_same_if_lens_and_place_are_the_same():
    stereo = SphericalStereo(0.05, 2.0)
    eye = camera(PROJECTIONS["360"], stereo)
    assert see_the_same(eye, camera(Equirectangular(WHOLE, HALF), SphericalStereo(0.05, 2.0)))
    assert not see_the_same(eye, camera(PROJECTIONS["VR180"], stereo))
    assert not see_the_same(eye, camera(PROJECTIONS["360"], SphericalStereo(-0.05, 2.0)))
    assert not see_the_same(eye, camera(PROJECTIONS["360"], stereo, GENERAL))


def test_a_panorama_has_no_view_plane():
    with pytest.raises(TypeError, match="PanoramicCamera has no view plane"):
        planar(camera(PROJECTIONS["360"]))


@pytest.mark.parametrize("shift", [-0.4, 0.3, 0.8])
def test_a_shifted_panorama_shows_all_within_its_own_window(shift):
    eye = replace(camera(PROJECTIONS["360"]), window=ViewPlane(shift, 1.0 + shift, 0.0, 1.0))
    x, y = pixel_centres(eye)
    _, direction = eye.ray_from_px(x, y)
    np.testing.assert_allclose(eye.px_from_point(direction, np.ones_like(x))[0], x, rtol=0.0, atol=PX_TOLERANCE)


def test_parallax_of_a_panorama_whose_middle_has_none():
    """Above all but its lowest part the eyes are in one place."""
    upwards, merge = Equirectangular(HALF, (0.8, np.pi / 2)), PoleMerge(0.8, 0.95)
    left, right = (camera(upwards, SphericalStereo(side * 0.05, np.inf, merge)) for side in (-1.0, 1.0))
    assert eye_distance(left, right) > 0.03
    # At some 0.88 radians upwards, and of the nearness along the ray.
    moved = 0.1 * merge.share(np.array(0.877)) / np.cos(0.877) * SIZE[0] / np.pi
    assert disparity_per_nearness(left, right) == pytest.approx(moved, rel=0.05)


@pytest.mark.parametrize("edge", [0.3 - 0.004, 0.3 + 0.004])
def test_parallax_of_a_panorama_around_its_edge(edge):
    """A far point and a farther one on either side of the edge are not a whole picture apart. Near the poles they are
    more of the narrow pixels apart, but as wide an angle."""
    left, right = (camera(PROJECTIONS["360"], SphericalStereo(side * 0.05, np.inf)) for side in (-1.0, 1.0))
    right = replace(right, window=ViewPlane(edge, 1.0 + edge, 0.0, 1.0))
    widest = 0.1 * SIZE[0] / (2.0 * np.pi)
    assert disparity_per_nearness(left, right) == pytest.approx(widest, rel=0.05)


@pytest.mark.parametrize("name", ["equidistant", "360"])
@pytest.mark.parametrize("stereo", [None, SphericalStereo(0.05, 0.7)], ids=["plain", "spherical"])
def test_the_depth_pass_is_the_skys_beyond_a_lens(name, stereo):
    eye = camera(PROJECTIONS[name], stereo)
    x, y = pixel_centres(eye)
    shown = eye.within_lens(x, y) >= 0.0
    assert shown.all() == (name == "360")
    value = np.full_like(x, 2.0)
    depth = eye.depth_from_pass(x, y, value)
    assert np.array_equal(np.isfinite(depth), shown)
    np.testing.assert_allclose(eye.pass_from_depth(x, y, depth), np.where(shown, 2.0, np.inf), rtol=1e-12)
