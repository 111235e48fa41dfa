"""The way of a frame whose eyes are panoramas: pixels count by what they show, and a whole turn has no sides."""

import numpy as np
import pytest

from stereo_reproject.images.metrics import honest_ratio
from stereo_reproject.images.passes import NOISY_PASS
from stereo_reproject.images.tuning import TUNING
from stereo_reproject.pipeline.frame import render_stereo_frame
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.views.camera import ViewPlane
from stereo_reproject.views.panorama import PanoramicCamera
from stereo_reproject.views.projections import Equirectangular
from stereo_reproject.views.spherical import SphericalStereo
from tests.pipeline.test_pipeline import IPD, Caster, Denoiser, settings
from tests.warp.analytic import World

HALF, WHOLE = 0.5 * np.pi, np.pi

SIZE = (144, 144)
ALTITUDE = (0.5 - (np.arange(SIZE[1]) + 0.5) / SIZE[1]) * np.pi
POLES = np.abs(ALTITUDE) > 1.1
MIDDLE = np.abs(np.arange(SIZE[1]) + 0.5 - 0.5 * SIZE[1]) < 0.5 * POLES.sum()
"""As many rows."""

NOISE = 0.05
WRONG = 2.5 * NOISE
"""Added to a colour: in the middle as much breaks the frame's promise by far, beside the poles it hardly does."""

OUTSIDE_PROMISE = 0.02
"""Honest ratio: a frame keeps its promise by an estimate."""


class BallAround:
    """The inside of a large ball around both eyes."""

    radius = 6.0

    def depth_along(self, origin, direction):
        a, b = np.sum(direction**2, -1), np.sum(origin * direction, -1)
        return (np.sqrt(b * b - a * (np.sum(origin**2, -1) - self.radius**2)) - b) / a


def panorama(longitude, size, **options):
    """A renderer of both eyes of spherical stereo within a ball, as far to either side as `longitude` in radians."""
    window, projection = ViewPlane(0.0, 1.0, 0.0, 1.0), Equirectangular((-longitude, longitude), (-HALF, HALF))
    rig = {
        view: PanoramicCamera(*size, np.eye(4), window, projection, SphericalStereo(side * IPD, 4.0))
        for view, side in (("left", -0.5), ("right", 0.5))
    }
    return Caster(World((BallAround(),), frequency=0.3), rig, **options)


def refined_of(rows):
    """The share of these rows' pixels that is refined where their colours alone are wrong, and the honest ratio of the
    frame by weight."""
    renderer = panorama(HALF, SIZE, noise=NOISE, view_dependent=("mirror",))

    def spoil(passes):
        passes["Combined"][rows, :, :3] += WRONG

    renderer.spoil = spoil
    frame = render_stereo_frame(renderer, settings())
    pictures = frame.eyes["right"]["Combined"], *(renderer.picture("right", seed)["Combined"] for seed in (91, 92))
    weight = np.broadcast_to(np.cos(ALTITUDE)[:, None], SIZE[::-1])
    return frame.refinement.pixels[rows].mean(), honest_ratio(*pictures, frame.variance_share, weight)


def test_errors_beside_the_poles_are_traced_as_far_as_their_solid_angle_asks():
    """They show a fifth of what as many pixels in the middle show, and the promise is of what is seen."""
    beside_poles, left_there = refined_of(POLES)
    in_the_middle, left_in_the_middle = refined_of(MIDDLE)
    assert beside_poles < 0.5 * in_the_middle
    assert max(left_there, left_in_the_middle) < SETTINGS["balanced"].promise + OUTSIDE_PROMISE


@pytest.mark.parametrize(("longitude", "beyond"), [(WHOLE, 2 * TUNING.denoise_sides_px), (HALF, 0)])
def test_a_denoiser_sees_beyond_the_sides_of_a_whole_turn(longitude, beyond):
    """Of both eyes."""
    widths = []

    class Watched(Denoiser):
        def __call__(self, pictures):
            widths.extend(picture[NOISY_PASS].shape[1] for picture in pictures)
            return super().__call__(pictures)

    renderer = panorama(longitude, (160, 80), noise=NOISE, view_dependent=("mirror",))
    renderer.denoise = Watched()
    frame = render_stereo_frame(renderer, settings(accuracy="exact"))
    assert frame.traced.any()
    assert widths.count(160 + beyond) >= 2
    assert max(widths) == 160 + beyond
