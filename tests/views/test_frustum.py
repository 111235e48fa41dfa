"""What a camera may see of a box: everything that one of its rays meets, and little else."""

import numpy as np
import pytest

from stereo_reproject.views.camera import OrthographicCamera, PerspectiveCamera, ViewPlane
from stereo_reproject.views.frustum import Frustum, Lens, covered_by
from stereo_reproject.views.panorama import PanoramicCamera
from stereo_reproject.views.projections import Equirectangular
from stereo_reproject.views.spherical import SphericalStereo

PLACE = np.array([[0.0, 0.0, 1.0, 3.0], [0.0, 1.0, 0.0, -2.0], [-1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]])
PLANE = ViewPlane(-0.5, 0.7, -0.3, 0.4)
CAMERAS = [PerspectiveCamera(400, 300, PLACE, PLANE), OrthographicCamera(400, 300, PLACE, PLANE)]


def box(centre, size=0.1):
    """Corners, in the world and in Blender's order, of a box in camera space."""
    face = [(-1, -1), (-1, 1), (1, 1), (1, -1)]
    offsets = np.array([(x, y, z) for x in (-1, 1) for y, z in face]) * size / 2.0
    return (np.array(centre) + offsets) @ PLACE[:3, :3].T + PLACE[:3, 3]


@pytest.mark.parametrize("camera", CAMERAS, ids=["perspective", "orthographic"])
def test_no_box_that_a_ray_meets_is_left_out(camera):
    rng = np.random.default_rng(3)
    frustum = Frustum(camera, Lens(near=0.1, far=50.0))
    for _ in range(500):
        x, y = rng.uniform(0, 400), rng.uniform(0, 300)
        origin, direction = camera.ray_from_px(np.array(x), np.array(y))
        depth = rng.uniform(0.1, 50.0)
        centre = [float(o + depth * d) for o, d in zip(origin, direction, strict=True)]
        assert frustum.may_meet(box(centre, size=rng.uniform(0.0, 2.0)))


@pytest.mark.parametrize("camera", CAMERAS, ids=["perspective", "orthographic"])
@pytest.mark.parametrize(
    "centre", [(0.0, 0.0, 1.0), (0.0, 0.0, -60.0), (9.0, 0.0, -5.0), (-9.0, 0.0, -5.0), (0.0, 9.0, -5.0), (0, -9, -5)]
)
def test_a_box_beside_the_view_is_left_out(camera, centre):
    assert not Frustum(camera, Lens(near=0.1, far=50.0)).may_meet(box(centre))


@pytest.mark.parametrize("camera", CAMERAS, ids=["perspective", "orthographic"])
def test_a_box_around_the_camera_is_seen(camera):
    assert Frustum(camera, Lens(near=0.1)).may_meet(box((0.0, 0.0, 0.0), size=5.0))


WHOLE_SPHERE = Equirectangular((-np.pi, np.pi), (-0.5 * np.pi, 0.5 * np.pi))


@pytest.mark.parametrize("near", [0.001, 0.1, 0.5])
@pytest.mark.parametrize("convergence", [0.15, 3.0, np.inf])
@pytest.mark.parametrize("offset", [None, 0.1, -0.1])
def test_what_is_within_the_near_clip_of_a_panorama(offset, convergence, near):
    """No ray meets what is left out, and some ray meets what is little farther away."""
    stereo = None if offset is None else SphericalStereo(offset, convergence)
    camera = PanoramicCamera(400, 300, PLACE, ViewPlane(0.0, 1.0, 0.0, 1.0), WHOLE_SPHERE, stereo)
    frustum = Frustum(camera, Lens(near=near))
    rng = np.random.default_rng(5)
    origin, direction = camera.ray_from_px(rng.uniform(0, 400, 500), rng.uniform(1, 299, 500))
    length = near * (1.0 + rng.exponential(1.0, 500))
    points = np.stack([np.broadcast_to(o + length * d, 500) for o, d in zip(origin, direction, strict=True)], axis=-1)
    corners = points[:, None] + np.zeros((1, 8, 1))
    assert frustum.may_meet(corners @ PLACE[:3, :3].T + PLACE[:3, 3]).all()
    least = min(near, np.linalg.norm(points, axis=-1).min())
    assert not frustum.may_meet(box((0.0, 0.0, 0.0), size=2.0 * 0.55 * least))
    assert frustum.may_meet(box((0.0, 0.0, -2.0 * max(near, 0.1)), size=0.0))


def test_every_ray_from_the_lens_is_within_the_view():
    """From a point of the aperture through the point in focus, at any depth."""
    rng = np.random.default_rng(4)
    lens = Lens(near=0.1, aperture=0.4, focus=3.0)
    wide, narrow = Frustum(CAMERAS[0], lens), Frustum(CAMERAS[0], Lens(near=0.1))
    missed = 0
    for _ in range(500):
        angle, depth = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.1, 50.0)
        start = lens.aperture * np.array([np.cos(angle), np.sin(angle), 0.0])
        _, direction = CAMERAS[0].ray_from_px(rng.choice([0.0, 400.0]), rng.uniform(0, 300))
        in_focus = lens.focus * np.array([float(d) for d in direction])
        point = box(start + (in_focus - start) * depth / lens.focus, size=0.0)
        assert wide.may_meet(point)
        missed += not narrow.may_meet(point)
    assert missed > 100


@pytest.mark.parametrize("camera", CAMERAS, ids=["perspective", "orthographic"])
def test_the_pixels_of_a_box_cover_all_that_it_shows(camera):
    corners = box((0.1, 0.05, -4.0), size=0.4)
    covered = covered_by([corners], camera, Lens(near=0.1))
    rng = np.random.default_rng(1)
    inside = corners.min(axis=0) + rng.random((200, 3)) * np.ptp(corners, axis=0)
    local = (inside - PLACE[:3, 3]) @ PLACE[:3, :3]
    x, y, _ = camera.px_from_point(tuple(local.T), np.ones(200))
    seen = (x >= 0) & (x < 400) & (y >= 0) & (y < 300)
    assert covered[y[seen].astype(int), x[seen].astype(int)].all()
    assert seen.any()
    assert covered.mean() < 0.5


@pytest.mark.parametrize("camera", CAMERAS, ids=["perspective", "orthographic"])
def test_a_box_that_does_not_tell_where_it_is_covers_all_or_nothing(camera):
    """Nothing where it may be anywhere or all around: then probes tell."""
    assert not covered_by([np.full((8, 3), np.inf)], camera, Lens()).any()
    around = covered_by([box((0.3, -0.2, 0.5), size=5.0)], camera, Lens(near=0.1))
    assert around.all() if isinstance(camera, OrthographicCamera) else not around.any()
    assert covered_by([box((2.6, 0.0, 0.0), size=5.0)], camera, Lens(near=0.1)).all(), "beside the camera and behind"
    assert not covered_by([], camera, Lens()).any()
    for beside in ((90.0, 0.0, -5.0), (0.0, 0.0, 60.0), (50.0, 0.0, 0.0)):
        assert not covered_by([box(beside, size=2.0)], camera, Lens(near=0.1)).any()
