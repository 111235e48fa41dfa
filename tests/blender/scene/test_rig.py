"""The rig is Blender's own: a surface point that a multiview render shows at a pixel's centre is projected there."""

import itertools

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.scene.rig import camera_from_eye, stereo_cameras
from stereo_reproject.errors import BadInputError
from stereo_reproject.images.passes import DEPTH_PASS
from stereo_reproject.views.camera import target_px_from_source_px
from tests.blender.toolbox import (
    EYES,
    FINEST_FILTER,
    Material,
    add_camera,
    add_cube,
    add_plane,
    empty_scene,
    evaluated_camera,
    pixel_centres,
    px_from_world,
    render_plain,
    set_border,
)

WIDTH, HEIGHT = 192, 108

PIXELS = 0.01
"""The promise is a hundredth of a pixel. Cycles writes the position that it hit at the centre of the pixel, in single
precision: 1e-6 of the scene's size, here 1e-3 pixels."""

DEPTH = 1e-4
"""Relative; single precision again, with the camera some units from the origin."""


@pytest.fixture
def scene():
    """A wall far behind two cubes, all of it within what any of the rigs below sees."""
    scene = empty_scene(WIDTH, HEIGHT)
    scene.cycles.filter_width = FINEST_FILTER
    scene.view_layers[0].use_pass_position = True
    grey = Material("grey")
    grey.surface(grey.node("BsdfDiffuse"))
    add_plane(scene, grey, size=(60, 60), location=(0, 0, -14), rotation=(0.2, 0.3, 0.0))
    add_cube(scene, grey, size=2.0, location=(-1.0, 0.4, -6))
    add_cube(scene, grey, size=1.0, location=(1.2, -0.5, -4))
    add_camera(scene)
    return scene


def assert_rig_is_blenders(scene, folder):
    """Both eyes of our rig against both views of Blender's render."""
    rendered = render_plain(scene, folder)
    cameras = stereo_cameras(evaluated_camera(scene), scene.render)
    for view, other in (EYES, EYES[::-1]):
        camera, passes = cameras[view], rendered[view]
        assert (camera.height, camera.width) == passes[DEPTH_PASS].shape[:2], view
        assert off_centre(camera, passes) < PIXELS, view
        assert off_other_eye(camera, cameras[other], passes) < PIXELS, view


def off_centre(camera, passes, left=0, top=0):
    """The worst distance, in pixels, from a pixel's centre to where its surface point is projected. The picture may
    stand at (left, top) of the passes."""
    depth = passes[DEPTH_PASS][top : top + camera.height, left : left + camera.width, 0]
    position = passes["Position"][top : top + camera.height, left : left + camera.width]
    hit = np.isfinite(depth) & (depth > 0)
    assert hit.mean() > 0.9, "the scene must fill the picture"
    x, y, ours = px_from_world(camera, position)
    centre_x, centre_y = pixel_centres(depth.shape)
    np.testing.assert_allclose(ours[hit], depth[hit], rtol=DEPTH)
    return float(np.hypot(x - centre_x, y - centre_y)[hit].max())


def off_other_eye(camera, other, passes):
    """The worst distance, in pixels, between where the warp's own formula carries a pixel's centre by its depth, and
    where the surface point that Cycles hit there appears in the other eye."""
    depth = passes[DEPTH_PASS][..., 0]
    hit = np.isfinite(depth) & (depth > 0)
    warped = target_px_from_source_px(camera, other, *pixel_centres(depth.shape), depth)
    expected = px_from_world(other, passes["Position"])
    return float(np.hypot(warped[0] - expected[0], warped[1] - expected[1])[hit].max())


MODES = ("OFFAXIS", "PARALLEL", "TOE")
PIVOTS = ("LEFT", "RIGHT", "CENTER")


@pytest.mark.parametrize(("mode", "pivot"), list(itertools.product(MODES, PIVOTS)))
def test_mode_and_pivot(scene, tmp_path, mode, pivot):
    stereo = scene.camera.data.stereo
    stereo.convergence_mode, stereo.pivot = mode, pivot
    assert_rig_is_blenders(scene, tmp_path)


@pytest.mark.parametrize(("mode", "pivot"), [("OFFAXIS", "CENTER"), ("PARALLEL", "LEFT"), ("TOE", "RIGHT")])
def test_orthographic(scene, tmp_path, mode, pivot):
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 7.0
    scene.camera.data.shift_x, scene.camera.data.shift_y = 0.1, -0.05
    scene.camera.data.stereo.convergence_mode, scene.camera.data.stereo.pivot = mode, pivot
    assert_rig_is_blenders(scene, tmp_path)


def tall(scene):
    scene.render.resolution_x, scene.render.resolution_y = 90, 160


def square(scene):
    scene.render.resolution_x = scene.render.resolution_y = 120


def odd_percentage(scene):
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 321, 183, 47


def wide_pixels(scene):
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = 2.0, 1.0


def tall_pixels(scene):
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = 1.0, 2.5


FITS = ("AUTO", "HORIZONTAL", "VERTICAL")


@pytest.mark.parametrize("shape", [None, tall, square, odd_percentage, wide_pixels, tall_pixels])
@pytest.mark.parametrize("fit", FITS)
def test_sensor_fit_and_shape_of_the_picture(scene, tmp_path, fit, shape):
    data = scene.camera.data
    data.sensor_fit, data.sensor_width, data.sensor_height = fit, 36.0, 20.0
    data.shift_x, data.shift_y = -0.07, 0.04
    if shape is not None:
        shape(scene)
    assert_rig_is_blenders(scene, tmp_path)


@pytest.mark.parametrize("unit", ["MILLIMETERS", "FOV"])
def test_lens(scene, tmp_path, unit):
    data = scene.camera.data
    data.lens_unit, data.lens = unit, 61.0
    data.sensor_width = 23.0
    assert_rig_is_blenders(scene, tmp_path)


BORDERS = [(0.25, 0.8, 0.1, 0.65), (0.0, 0.5, 0.0, 1.0), (0.333, 0.667, 0.111, 0.999), (0.501, 1.0, 0.499, 1.0)]


@pytest.mark.parametrize("border", BORDERS)
def test_render_border_cropped(scene, tmp_path, border):
    set_border(scene, border)
    scene.render.use_crop_to_border = True
    assert_rig_is_blenders(scene, tmp_path)


@pytest.mark.parametrize("border", BORDERS)
def test_render_border_within_the_whole_frame(scene, tmp_path, border):
    """Without cropping, Blender's picture is the whole frame, black outside: ours is the part that it rendered."""
    set_border(scene, border)
    rendered = render_plain(scene, tmp_path)
    cameras = stereo_cameras(evaluated_camera(scene), scene.render)
    for view in EYES:
        depth = rendered[view][DEPTH_PASS][..., 0]
        assert depth.shape == (HEIGHT, WIDTH)
        rows, columns = np.nonzero(np.isfinite(depth) & (depth > 0))
        top, left = rows.min(), columns.min()
        assert (rows.max() - top + 1, columns.max() - left + 1) == (cameras[view].height, cameras[view].width)
        assert off_centre(cameras[view], rendered[view], left, top) < PIXELS


def moved(scene):
    scene.camera.location, scene.camera.rotation_euler = (0.4, -0.3, 1.0), (0.1, -0.15, 0.3)


def scaled(scene):
    moved(scene)
    scene.camera.scale = (3.0, 0.5, 2.0)


def parented(scene):
    """Under a parent that is itself turned, moved and scaled."""
    parent = bpy.data.objects.new("Parent", None)
    scene.collection.objects.link(parent)
    parent.location, parent.rotation_euler, parent.scale = (0.2, 0.1, 0.5), (0.05, 0.1, -0.2), (2.0, 2.0, 2.0)
    scene.camera.parent = parent
    moved(scene)


def mirrored(scene):
    moved(scene)
    scene.camera.scale = (-1.0, 1.0, 1.0)


def sheared(scene):
    """Turned under a parent that is scaled unevenly: the camera's axes are no longer at right angles."""
    parented(scene)
    scene.camera.parent.scale = (1.0, 1.3, 1.0)


def constrained(scene):
    target = bpy.data.objects.new("Target", None)
    scene.collection.objects.link(target)
    target.location = (0.8, 0.3, -5.0)
    constraint = scene.camera.constraints.new("TRACK_TO")
    constraint.target, constraint.track_axis, constraint.up_axis = target, "TRACK_NEGATIVE_Z", "UP_Y"


@pytest.mark.parametrize("place", [moved, scaled, parented, mirrored, constrained])
@pytest.mark.parametrize("mode", MODES)
def test_camera_in_the_world(scene, tmp_path, mode, place):
    place(scene)
    scene.camera.data.stereo.convergence_mode, scene.camera.data.stereo.pivot = mode, "CENTER"
    assert_rig_is_blenders(scene, tmp_path)


def test_sheared_camera(scene, tmp_path):
    sheared(scene)
    assert_rig_is_blenders(scene, tmp_path)


def test_far_from_the_origin(scene, tmp_path):
    """The promise holds where single precision still resolves it: a kilometre away, 6e-5 units, some 1e-3 pixels."""
    for item in bpy.data.objects:
        item.location.x += 1000.0
    assert_rig_is_blenders(scene, tmp_path)


def test_equal_eyes_without_interocular_distance(scene):
    for mode, pivot in itertools.product(MODES, PIVOTS):
        stereo = scene.camera.data.stereo
        stereo.interocular_distance, stereo.convergence_mode, stereo.pivot = 0.0, mode, pivot
        cameras = stereo_cameras(evaluated_camera(scene), scene.render)
        np.testing.assert_array_equal(cameras["left"].world_from_camera, cameras["right"].world_from_camera)
        assert cameras["left"].plane == cameras["right"].plane


@pytest.mark.parametrize(("mode", "pivot"), list(itertools.product(MODES, PIVOTS)))
def test_eyes_stand_apart_by_the_interocular_distance(scene, mode, pivot):
    stereo = scene.camera.data.stereo
    stereo.interocular_distance, stereo.convergence_mode, stereo.pivot = 0.25, mode, pivot
    left, right = (camera_from_eye(scene.camera.data, view)[:3, 3] for view in EYES)
    # Distances are single precision in Blender.
    assert np.linalg.norm(right - left) == pytest.approx(0.25, rel=1e-6)
    assert right[0] > left[0]


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"type": "ORTHO", "ortho_scale": 0.0}, "orthographic scale is 0: raise it"),
        ({"lens": 1e30}, "check focal length, sensor and shift"),
        ({"shift_y": 1e20}, "check focal length, sensor and shift"),
        ({"stereo.interocular_distance": 1e20}, "take a smaller interocular one"),
        ({"sensor_width": 0.0, "sensor_height": 0.0}, None),
        ({"lens": 0.0}, None),
        ({"type": "ORTHO", "ortho_scale": 1e-30}, None),
        ({"stereo.convergence_distance": 0.0}, None),
        ({"clip_start": 100.0, "clip_end": 1.0}, None),
    ],
)
def test_a_camera_without_a_view_is_said(scene, settings, words):
    data = scene.camera.data
    for name, value in settings.items():
        item, _, last = name.rpartition(".")
        setattr(getattr(data, item) if item else data, last, value)
    if words is None:
        for eye in stereo_cameras(evaluated_camera(scene), scene.render).values():
            assert np.isfinite([eye.plane.left, eye.plane.right, eye.plane.bottom, eye.plane.top]).all()
    else:
        with pytest.raises(BadInputError, match=words):
            stereo_cameras(evaluated_camera(scene), scene.render)
