"""Solid angles of pixels: of an equirectangular picture they are known, and any whole sphere holds 4 pi."""

import numpy as np
import pytest

from stereo_reproject.views.camera import ViewPlane
from stereo_reproject.views.panorama import PanoramicCamera
from stereo_reproject.views.projections import EquiangularCubeFace, FisheyeEquidistant, FisheyeEquisolid, Rectilinear
from stereo_reproject.views.solid_angle import LEAST_WEIGHT, pixel_weights
from stereo_reproject.views.spherical import SphericalStereo
from tests.views.test_panorama import HALF, PICTURE, PROJECTIONS, WHOLE, camera
from tests.warp.analytic import stereo_rig

FLAT = 2e-3
"""Relative: a pixel of three degrees, as flat as it is taken to be, is by so much smaller than the curved one."""


def square(projection):
    return PanoramicCamera(60, 60, np.eye(4), PICTURE, projection)


@pytest.mark.parametrize("name", ["VR180", "360"])
def test_a_pixel_of_an_equirectangular_picture_counts_by_the_cosine_of_its_altitude(name):
    weights = pixel_weights(camera(PROJECTIONS[name]))
    rows = weights.shape[0]
    altitude = (0.5 - (np.arange(rows) + 0.5) / rows) * np.pi
    expected = np.broadcast_to(np.cos(altitude)[:, None], weights.shape) / np.cos(altitude).max()
    np.testing.assert_allclose(weights, expected, rtol=FLAT)


def test_a_part_of_a_sphere_counts_by_its_own_largest_pixel():
    weights = pixel_weights(camera(PROJECTIONS["part of a sphere"]))
    assert weights.max() == 1.0
    assert weights[0].max() == pytest.approx(np.cos(1.2), rel=0.05)


def test_the_middle_of_an_equidistant_fisheye_shows_most_and_beyond_its_edge_there_is_nothing():
    weights = pixel_weights(square(FisheyeEquidistant(np.pi)))
    # sin t / t at 45 degrees off the axis, halfway to the edge.
    assert weights[30, 45] == pytest.approx(np.sin(np.pi / 4) / (np.pi / 4), rel=0.02)
    assert weights[0, 0] == np.float32(LEAST_WEIGHT)


def test_all_pixels_within_an_equisolid_lens_show_as_much():
    weights = pixel_weights(square(FisheyeEquisolid(9.0, np.pi, (28.0, 28.0))))
    inside = weights > LEAST_WEIGHT
    assert 0.4 < inside.mean() < 0.8
    np.testing.assert_allclose(weights[inside], 1.0, rtol=FLAT)


def test_a_corner_of_a_cube_face_shows_less_than_its_middle():
    weights = pixel_weights(square(EquiangularCubeFace()))
    # Of the plane's area per solid angle (1 + x² + y²)^(3/2), the columns' own spacing has (1 + x²)(1 + y²).
    assert weights[0, 0] == pytest.approx(4.0 / 3.0**1.5, rel=0.02)


def test_a_lens_that_shows_no_pixels_centre_has_even_weights():
    tiny = PanoramicCamera(64, 64, np.eye(4), PICTURE, FisheyeEquisolid(0.1, np.pi, (36.0, 36.0)))
    np.testing.assert_array_equal(pixel_weights(tiny), 1.0)


def test_a_picture_on_a_flat_screen_counts_evenly():
    window = ViewPlane(-1.2, 1.1, -0.7, 0.9)
    turning = PanoramicCamera(
        60, 40, np.eye(4), window, Rectilinear(), SphericalStereo(0.03, 2.0), around_world=True, ends_at_lens=False
    )
    assert pixel_weights(turning) == 1.0
    assert pixel_weights(stereo_rig((60, 40), ipd=0.065, convergence=2.0)["left"]) == 1.0


def test_spherical_stereo_changes_no_weight():
    for longitudes in (HALF, WHOLE):
        projection = PROJECTIONS["VR180" if longitudes is HALF else "360"]
        plain, eye = (pixel_weights(camera(projection, stereo)) for stereo in (None, SphericalStereo(0.03, 2.0)))
        np.testing.assert_array_equal(plain, eye)
