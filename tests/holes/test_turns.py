"""The holes of a whole turn are the same wherever its sides lie."""

from dataclasses import replace

import numpy as np
import pytest

from stereo_reproject.holes.reprojection import reproject
from stereo_reproject.images.passes import DEPTH_PASS, NOISY_PASS
from stereo_reproject.images.reasons import Reason
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.views.camera import ViewPlane
from stereo_reproject.views.panorama import PanoramicCamera
from stereo_reproject.views.projections import Equirectangular
from stereo_reproject.views.spherical import SphericalStereo
from stereo_reproject.views.view import View
from stereo_reproject.warp.options import WarpOptions
from stereo_reproject.warp.rendered_view import RenderedView

WIDTH, HEIGHT = 256, 128
NEAR = np.s_[40:90, 100:140]
WIRE = np.s_[20:110, 170]

ROUNDING = 1e-4
"""Share of the pixels whose flag may hang on the last digit of a place in float32."""


def view(name, offset):
    projection = Equirectangular((-np.pi, np.pi), (-np.pi / 2, np.pi / 2))
    stereo = SphericalStereo(offset, 6.0, None)
    return View(name, PanoramicCamera(WIDTH, HEIGHT, np.eye(4), ViewPlane(0.0, 1.0, 0.0, 1.0), projection, stereo))


def source(*, noisy):
    """A board, a wire and a square of hair before a wall with stripes."""
    rng = np.random.default_rng(0)
    depth = np.full((HEIGHT, WIDTH), 4.0, np.float32)
    colour = np.ones((HEIGHT, WIDTH, 4), np.float32)
    colour[..., :3] = 0.4 + 0.2 * (np.arange(WIDTH) // 4 % 2)[:, None]
    for place, away, light in ((NEAR, 0.8, 0.1), (WIRE, 1.5, 1.5)):
        depth[place], colour[(*place, np.s_[:3])] = away, light
    # Edges are filtered.
    colour = 0.5 * colour + 0.25 * (np.roll(colour, 1, axis=1) + np.roll(colour, -1, axis=1))
    colour[..., :3] += 0.01 * rng.standard_normal(colour[..., :3].shape)
    passes = {"Combined": colour.astype(np.float32), DEPTH_PASS: depth[..., None]}
    return passes if noisy else {**passes, NOISY_PASS: passes["Combined"].copy()}


def judged(passes, turn, accuracy, interpolations):
    passes = {name: np.ascontiguousarray(np.roll(image, turn, axis=1)) for name, image in passes.items()}
    left, right = view("left", -0.0325), view("right", 0.0325)
    result = reproject([RenderedView(left, passes)], right, accuracy, options=WarpOptions(0.25, *interpolations))
    return np.roll(result.reasons, -turn, axis=1), np.roll(result.passes["Combined"], -turn, axis=1)


@pytest.mark.parametrize("interpolations", [("linear", "adaptive"), ("linear", "cubic")], ids=["noisy", "denoised"])
@pytest.mark.parametrize("accuracy", ["balanced", "exact"])
def test_holes_do_not_depend_on_where_the_sides_are(accuracy, interpolations):
    passes = source(noisy=interpolations[1] == "adaptive")
    setting = replace(SETTINGS[accuracy], silhouette_radius=max(SETTINGS[accuracy].silhouette_radius, 1))
    plain, colour = judged(passes, 0, setting, interpolations)
    assert {Reason.SILHOUETTE.bit, Reason.DISOCCLUDED.bit} <= set(plain[plain > 0].tolist())
    # At the left and right end of the board, in it, at the wire, and elsewhere.
    for column in (100, 101, 98, 140, 139, 120, 170, 171, 220):
        turned, its_colour = judged(passes, WIDTH - column, setting, interpolations)
        assert np.mean((turned > 0) != (plain > 0)) <= ROUNDING, column
        differs = np.abs(its_colour - colour).max(axis=-1) > 1e-3
        assert np.mean(differs & (plain == 0)) <= ROUNDING, column
