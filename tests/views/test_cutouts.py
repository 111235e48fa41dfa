"""Cut-outs of panoramas: the directions that they show, and which of them a panorama has."""

import numpy as np
import pytest

from stereo_reproject.views.camera import PerspectiveCamera, ViewPlane
from stereo_reproject.views.cutouts import cutouts_of, natural_size, px_in_cutout
from stereo_reproject.views.panorama import PanoramicCamera
from stereo_reproject.views.projections import Equirectangular, FisheyeEquidistant, Rectilinear
from stereo_reproject.views.spherical import SphericalStereo
from tests.views.test_panorama import DEGREE, HALF, PICTURE, PX_TOLERANCE, WHOLE, camera

VR360, VR180 = Equirectangular(WHOLE, HALF), Equirectangular(HALF, HALF)
CUBE = {"front": (0, 0), "left": (90, 0), "right": (-90, 0), "up": (0, 90), "down": (0, -90), "back": (180, 0)}
BEFORE = {"front": (0, 0), "left": (45, 0), "right": (-45, 0), "up": (0, 45), "down": (0, -45)}

DOME = Equirectangular(WHOLE, (0.0, 0.5 * np.pi))
NARROW = Equirectangular((-0.5, 0.5), (-0.4, 0.4))


@pytest.mark.parametrize(
    ("projection", "expected"),
    [
        (VR360, CUBE),
        (VR180, BEFORE),
        (FisheyeEquidistant(np.pi), BEFORE),
        (FisheyeEquidistant(2.0 * np.pi), CUBE),
        (FisheyeEquidistant(110.0 * DEGREE), {"front": (0, 0)}),
        (NARROW, {}),
        (Rectilinear(), {}),
    ],
    ids=["360", "VR180", "fisheye 180°", "fisheye 360°", "fisheye 110°", "narrow", "perspective"],
)
def test_sides_are_those_that_the_panorama_shows(projection, expected):
    chosen = cutouts_of(camera(projection, SphericalStereo(-0.03, 2.0, None)))
    assert {cutout.name: (cutout.left_degrees, cutout.up_degrees) for cutout in chosen} == expected


def test_a_plain_camera_has_none():
    assert cutouts_of(PerspectiveCamera(8, 8, np.eye(4), ViewPlane(-1.0, 1.0, -1.0, 1.0))) == ()
    assert cutouts_of(None) == ()


@pytest.mark.parametrize("projection", [VR360, VR180], ids=["360", "VR180"])
def test_vr_cutouts_are_full(projection):
    """Turned by 45°, those of VR180 end at its edge."""
    eye = camera(projection)
    for cutout in cutouts_of(eye):
        assert np.isfinite(px_in_cutout(eye, cutout, 33)).all()


@pytest.mark.parametrize("projection", [VR360, VR180, FisheyeEquidistant(np.pi)], ids=["360", "VR180", "fisheye"])
def test_a_cutout_is_what_a_perspective_camera_sees(projection):
    """A pinhole turned that way sees, in each of its pixels, what the panorama shows at the pixel's place."""
    eye = camera(projection)
    for cutout in cutouts_of(eye):
        x, y = px_in_cutout(eye, cutout, 16)
        at = (np.arange(16) + 0.5) / 8.0 - 1.0
        right, down = np.meshgrid(at, at)
        turn, pitch = np.radians(cutout.left_degrees), np.radians(cutout.up_degrees)
        about_x = [[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]]
        about_y = [[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]]
        seen = np.einsum("ij,j...->i...", np.array(about_y) @ about_x, np.stack([right, -down, -np.ones_like(right)]))
        expected = np.stack(eye.px_from_point(tuple(seen), np.ones_like(right))[:2])
        there = np.isfinite(x)
        difference = np.abs(np.stack([x, y]) - expected)[:, there]
        # Left and right edge of a whole turn are one direction.
        difference[0] = np.minimum(difference[0], np.abs(difference[0] - eye.width))
        assert there.mean() > 0.5
        assert difference.max() < PX_TOLERANCE


def test_the_middle_of_the_picture_is_in_front():
    """Of a whole turn that begins elsewhere than behind the camera too: so players show it."""
    eye = camera(Equirectangular((0.0, 2.0 * np.pi), HALF))
    (front, *_) = cutouts_of(eye)
    x, y = px_in_cutout(eye, front, 1)
    assert (x.item(), y.item()) == pytest.approx((0.5 * eye.width, 0.5 * eye.height))


@pytest.mark.parametrize(
    ("size", "projection"),
    [((400, 200), VR360), ((200, 200), VR180), ((200, 200), FisheyeEquidistant(np.pi)), ((400, 100), DOME)],
    ids=["360", "VR180", "fisheye", "dome"],
)
def test_pixels_in_the_middle_are_as_large_as_the_panorama_s_largest(size, projection):
    """At a pole, at which the first cut-out of a dome looks, pixels have hardly any size."""
    eye = PanoramicCamera(*size, np.eye(4), PICTURE, projection)
    assert natural_size(eye) == round(400 / np.pi)


def test_the_first_cutout_of_a_dome_looks_at_its_pole():
    assert cutouts_of(PanoramicCamera(400, 100, np.eye(4), PICTURE, DOME))[0].title == "up 90°"


def test_rows_are_those_of_the_whole_cutout():
    eye = camera(VR360)
    for cutout in cutouts_of(eye):
        whole, part = px_in_cutout(eye, cutout, 16), px_in_cutout(eye, cutout, 16, slice(3, 9))
        assert all(np.array_equal(some, of_all[3:9]) for some, of_all in zip(part, whole, strict=True))
