"""Lookups of cut-outs: a smooth panorama is what it is, the seam of a whole turn is none, and noise stays noise."""

import numpy as np
import pytest

from stereo_reproject.images.cutouts import block_mean, cutout_pixels
from stereo_reproject.images.metrics import honest_ratio
from stereo_reproject.views.cutouts import cutouts_of, natural_size
from stereo_reproject.views.panorama import PanoramicCamera
from stereo_reproject.views.projections import Equirectangular, FisheyeEquidistant
from tests.views.test_panorama import HALF, PICTURE, WHOLE
from tests.warp.analytic import pixel_centres

INTERPOLATED = 1e-3
"""Most error between pixels of a picture with slopes of 0.5 and bends of 0.5 per radian, sampled 57 times a radian. At
a seam with the first or last column repeated it would be some 4e-3."""

NEAREST = 1.5e-2
"""The change over half a pixel's diagonal, 0.5 * 0.7 / 57, and near a pole some more."""

SMALLER = 5e-3
"""Half a pixel at the seam, where the last block is half as wide: 0.5 * 0.5 / 57."""

CHANCE = 0.01
"""Five times the standard deviation, 0.0018, that the honest ratio of a cut-out of 229 x 229 pixels has over 12 seeds;
interpolated it is 1.034 on average."""


def panorama(width=360, height=180, projection=None):
    return PanoramicCamera(width, height, np.eye(4), PICTURE, projection or Equirectangular(WHOLE, HALF))


def directions(eye, x, y):
    return np.stack(eye.looking_from_px(x, y), axis=-1).astype(np.float32)


def test_cutouts_of_a_smooth_panorama_are_smooth_over_its_seam():
    """A picture of the directions themselves, whose colours are continuous all around."""
    eye = panorama()
    picture = 0.5 + 0.5 * directions(eye, *pixel_centres(eye))
    for cutout in cutouts_of(eye):
        pixels = cutout_pixels(eye, cutout, 101)
        expected = 0.5 + 0.5 * directions(eye, pixels.x, pixels.y)
        # Beyond the last row there is none to interpolate with.
        inner = np.abs(pixels.y - 90.0) < 89.5
        assert np.abs(pixels.linear(picture) - expected)[inner].max() < INTERPOLATED
        assert np.abs(pixels.nearest(picture) - expected).max() < NEAREST


def test_what_is_not_shown_is_black():
    eye = panorama(100, 100, FisheyeEquidistant(100.0 * np.pi / 180.0))
    (front,) = cutouts_of(eye)
    pixels = cutout_pixels(eye, front, 64)
    assert 0.9 < pixels.shown.mean() < 1.0
    picture = np.ones((100, 100, 3), np.float32)
    for seen in (pixels.linear(picture), pixels.nearest(picture), pixels.nearest(picture[..., 0])):
        assert np.array_equal(seen != 0.0, pixels.shown if seen.ndim == 2 else np.repeat(pixels.shown[..., None], 3, 2))


def test_flags_are_not_mixed():
    eye = panorama()
    flags = np.random.default_rng(1).choice(np.array([0, 1, 64, 512], np.uint16), (180, 360))
    pixels = cutout_pixels(eye, cutouts_of(eye)[0], 50)
    seen = pixels.nearest(flags)
    assert seen.dtype == np.uint16
    assert set(np.unique(seen)) == {0, 1, 64, 512}


def test_noise_cancels_in_the_honest_ratio_of_a_cutout():
    """A pair whose pixels were looked up halfway between two of another noisy picture has half of the noise, and
    neighbours that are alike: without bias its ratio is 1 in the nearest pixels, and not in interpolated ones."""
    eye, rng = panorama(720, 360), np.random.default_rng(2)
    light = 1.0 + 0.1 * rng.standard_normal((3, 360, 720, 3)).astype(np.float32)
    source, reference, again = light
    ours = 0.5 * (source + np.roll(source, 1, axis=1))
    share = np.full((360, 720), 0.5, np.float32)
    pixels = cutout_pixels(eye, cutouts_of(eye)[0], natural_size(eye))
    near = honest_ratio(*(pixels.nearest(part) for part in (ours, reference, again)), pixels.nearest(share))
    assert near == pytest.approx(1.0, abs=CHANCE)
    smooth = honest_ratio(*(pixels.linear(part) for part in (ours, reference, again)), pixels.nearest(share))
    assert smooth > 1.0 + 2.0 * CHANCE


def test_a_bias_is_found_in_the_cutout_that_shows_it():
    eye, rng = panorama(720, 360), np.random.default_rng(3)
    light = 1.0 + 0.1 * rng.standard_normal((3, 360, 720, 3)).astype(np.float32)
    ours, reference, again = light
    ours[150:210, 340:380] += 0.4
    share, ratios = np.ones((360, 720), np.float32), {}
    for cutout in cutouts_of(eye):
        pixels = cutout_pixels(eye, cutout, 150)
        three = (pixels.nearest(part) for part in (ours, reference, again))
        ratios[cutout.name] = honest_ratio(*three, pixels.nearest(share))
    assert ratios.pop("front") > 1.1
    assert list(ratios.values()) == pytest.approx([1.0] * 5, abs=2.0 * CHANCE)


def test_block_mean():
    picture = np.arange(24, dtype=np.float32).reshape(4, 6, 1)
    assert block_mean(picture, 2)[..., 0].tolist() == [[3.5, 5.5, 7.5], [15.5, 17.5, 19.5]]


def test_block_mean_at_the_edges():
    """Where blocks do not fit, those at the edges are the mean of what there is of them."""
    picture = np.random.default_rng(4).random((7, 11, 2)).astype(np.float32)
    expected = [[picture[y : y + 3, x : x + 3].mean(axis=(0, 1)) for x in range(0, 11, 3)] for y in range(0, 7, 3)]
    assert block_mean(picture, 3) == pytest.approx(np.array(expected), abs=1e-6)


@pytest.mark.parametrize("width", [720, 721])
def test_places_in_a_panorama_that_was_made_smaller(width):
    """Colours are the directions themselves: those of blocks are the middle one, near enough."""
    eye = panorama(width, 360)
    picture = 0.5 + 0.5 * directions(eye, *pixel_centres(eye))
    smaller = block_mean(picture, 2)
    for cutout in cutouts_of(eye):
        fine, coarse = cutout_pixels(eye, cutout, 50), cutout_pixels(eye, cutout, 50, coarser=2)
        inner = np.abs(coarse.y - 90.0) < 89.0
        assert np.abs(coarse.linear(smaller) - fine.linear(picture))[inner].max() < SMALLER
