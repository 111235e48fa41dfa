"""The table of a packed picture's rays: one direction per pixel from which a shader makes the eye's ray."""

import numpy as np
import pytest

from stereo_reproject.blender.engines import ray_table
from stereo_reproject.blender.engines.packed_camera import PackedTask
from stereo_reproject.blender.engines.packed_views import PackedPixels
from stereo_reproject.blender.engines.ray_table import TEXELS, ray_texels, shares_within_lens
from stereo_reproject.blender.scene.rig import FrameRegion
from stereo_reproject.trace.packing import pack
from stereo_reproject.trace.pixel_filter import sample_offsets
from stereo_reproject.views.camera import ViewPlane
from stereo_reproject.views.panorama import PanoramicCamera
from stereo_reproject.views.projections import Equirectangular, FisheyeEquidistant
from stereo_reproject.views.spherical import SphericalStereo

WIDTH, HEIGHT = 200, 100
WINDOW = ViewPlane(0.0, 1.0, 0.0, 1.0)
VR180 = Equirectangular((-0.5 * np.pi, 0.5 * np.pi), (-0.5 * np.pi, 0.5 * np.pi))
POSE = np.array([[0.0, 0.0, 1.0, 3.0], [0.0, 1.0, 0.0, -2.0], [-1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]])
OFFSET = 0.03

INTERPOLATED = 0.02
"""Pixels: pixels of 1.8 degrees, at their corners."""


def task_of(projection):
    eyes = [
        PanoramicCamera(WIDTH, HEIGHT, POSE, WINDOW, projection, SphericalStereo(o, 3.0)) for o in (-OFFSET, OFFSET)
    ]
    rng = np.random.default_rng(0)
    views = [PackedPixels(eye, np.argwhere(rng.random((HEIGHT, WIDTH)) < 0.3)) for eye in eyes]
    packing = pack([pixels.places for pixels in views])
    region = FrameRegion(WIDTH, HEIGHT, 0, 0, WIDTH, HEIGHT)
    return PackedTask("right", eyes[1], 0.1, views, packing, region, ("BLACKMAN_HARRIS", 1.5))


def test_some_pixels_at_a_time_are_all_at_once(monkeypatch):
    task = task_of(VR180)
    count = task.packing.width * task.packing.height + 20
    turn = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    whole = ray_texels(task, turn, count=count, first=10)
    monkeypatch.setattr(ray_table, "PIXELS_AT_ONCE", 7)
    np.testing.assert_array_equal(ray_texels(task, turn, count=count, first=10), whole)
    assert whole.shape == (4, count, TEXELS)
    assert not whole[:, :10].any()
    assert not whole[:, -10:].any()


@pytest.mark.parametrize("projection", [VR180, FisheyeEquidistant(np.pi)], ids=["VR180", "fisheye"])
def test_directions_within_a_pixel_are_the_cameras(projection):
    """The eye's rays of them are those of the camera model, at the pixel's centre and at its corners."""
    task = task_of(projection)
    texels = ray_texels(task, np.eye(3), count=task.packing.width * task.packing.height)
    for pixels, at, offset in zip(task.views, task.packing.at, (-OFFSET, OFFSET), strict=True):
        looking, right, down = (texels[:3, at, number].astype(np.float64) for number in (1, 2, 3))
        inside = texels[3, at, 1] > 0.05
        assert inside.mean() > 0.7
        np.testing.assert_array_equal(texels[3, at, 0], np.float32(offset))
        np.testing.assert_array_equal(texels[:3, at, 0], 0.0)
        y, x = pixels.places.T + 0.5
        for aside, below in ((0.0, 0.0), (-0.5, 0.5), (0.5, 0.5)):
            found = looking + aside * right + below * down
            found /= np.linalg.norm(found, axis=0)
            expected = np.stack(np.broadcast_arrays(*pixels.camera.looking_in_camera(x + aside, y + below)))
            off = np.linalg.norm(found - expected, axis=0)[inside] * HEIGHT / np.pi
            assert off.max() < (INTERPOLATED if aside else 1e-5)


def test_beyond_the_lens_there_is_no_pixel_or_it_is_told():
    task = task_of(FisheyeEquidistant(np.pi))
    texels = ray_texels(task, np.eye(3), count=task.packing.width * task.packing.height)
    for pixels, at in zip(task.views, task.packing.at, strict=True):
        y, x = pixels.places.T + 0.5
        np.testing.assert_allclose(texels[3, at, 1], pixels.camera.within_lens(x, y), atol=1e-6)
        assert (texels[3, at, 1] < 0.0).mean() > 0.1


def test_shares_within_the_lens_are_those_of_the_filters_samples(monkeypatch):
    monkeypatch.setattr(ray_table, "PIXELS_AT_ONCE", 1000)
    task = task_of(FisheyeEquidistant(np.pi))
    table = sample_offsets(*task.pixel_filter) - 0.5
    right, down = np.random.default_rng(1).choice(table, (2, 4000))
    for index, pixels in enumerate(task.views):
        shares = shares_within_lens(task, index)
        y, x = pixels.places.T[..., None] + 0.5
        expected = (pixels.camera.within_lens(x + right, y + down) > 0.0).mean(axis=1, keepdims=True)
        np.testing.assert_allclose(shares, expected, atol=0.04)
        assert ((shares > 0.1) & (shares < 0.9)).sum() > 50
    assert np.all(shares_within_lens(task_of(VR180), 0) == 1.0)
