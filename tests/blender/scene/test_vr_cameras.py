"""Cameras for headsets: the lens of a panorama at the place of the scene's own camera, upright, in every frame."""

import itertools
import math
from dataclasses import replace

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from stereo_reproject.blender.scene.rig import stereo_cameras
from stereo_reproject.blender.scene.warnings import scene_warnings
from stereo_reproject.blender.scene.working import evaluated, move_to, working_scene
from stereo_reproject.errors import BadInputError
from stereo_reproject.settings.frame import SceneOverrides
from tests.blender.scene.test_scene import changes, whole_state
from tests.blender.toolbox import add, add_camera, empty_scene, keyframes, px_from_world, set_border

VR180 = SceneOverrides(panorama="vr180", size=(64, 64))
VR360 = SceneOverrides(panorama="vr360", size=(64, 32))

DEGREE = math.pi / 180.0

ROUNDING = 1e-5
"""Blender keeps matrices in single precision."""


@pytest.fixture
def scene():
    scene = empty_scene(64, 36)
    add_camera(scene, interocular=0.07, convergence=3.0)
    scene.camera.location, scene.camera.rotation_euler = (1.0, -2.0, 1.7), (1.2, 0.0, 0.7)
    return scene


def heading(matrix):
    """The direction of the camera's view in the horizontal plane."""
    return -Vector((matrix[0][2], matrix[1][2])).normalized()


def assert_upright_as(working, camera):
    """Upright, where `camera` is, and looking where it looks."""
    ours, own = evaluated(working.camera, working).matrix_world, evaluated(camera, working).matrix_world
    assert (ours.translation - own.translation).length < ROUNDING
    right, up, back = (ours.col[axis].to_3d() for axis in range(3))
    assert (up - Vector((0.0, 0.0, 1.0))).length < ROUNDING
    assert right.cross(up).dot(back) == pytest.approx(1.0, abs=ROUNDING)
    assert (heading(ours) - heading(own)).length < ROUNDING


# The lens


@pytest.mark.parametrize(("overrides", "half", "size"), [(VR180, 90.0, (64, 64)), (VR360, 180.0, (64, 32))])
def test_the_lens_is_that_of_a_headset(scene, overrides, half, size):
    data, render = scene.camera.data, scene.render
    data.shift_x, data.shift_y, data.dof.use_dof = 0.2, -0.1, True
    render.pixel_aspect_x, render.resolution_percentage = 2.0, 50
    with working_scene(scene, overrides) as working:
        lens = evaluated(working.camera, working).data
        assert (lens.type, lens.panorama_type) == ("PANO", "EQUIRECTANGULAR")
        longitudes, latitudes = (lens.longitude_min, lens.longitude_max), (lens.latitude_min, lens.latitude_max)
        np.testing.assert_allclose(longitudes, (-half * DEGREE, half * DEGREE), rtol=ROUNDING)
        np.testing.assert_allclose(latitudes, (-90.0 * DEGREE, 90.0 * DEGREE), rtol=ROUNDING)
        stereo = lens.stereo
        assert (stereo.use_spherical_stereo, stereo.use_pole_merge) == (True, True)
        merge = stereo.pole_merge_angle_from, stereo.pole_merge_angle_to
        np.testing.assert_allclose(merge, (60.0 * DEGREE, 75.0 * DEGREE), rtol=ROUNDING)
        assert (stereo.interocular_distance, stereo.convergence_distance) == pytest.approx((0.07, 3.0))
        assert (lens.shift_x, lens.shift_y, lens.dof.use_dof) == (0.0, 0.0, False)
        ours = working.render
        assert (ours.resolution_x, ours.resolution_y, ours.resolution_percentage) == (*size, 100)
        assert (ours.pixel_aspect_x, ours.pixel_aspect_y) == (1.0, 1.0)


def test_the_middle_of_the_picture_is_where_the_camera_looks(scene):
    """To the horizon, and above it: up in the picture is up in the world."""
    with working_scene(scene, replace(VR180, interocular_distance=0.0)) as working:
        eye = stereo_cameras(evaluated(working.camera, working), working.render)["left"]
    ahead = np.array([-math.sin(0.7), math.cos(0.7), 0.0])
    for point, y in ((ahead, 32.0), (ahead + np.array([0.0, 0.0, 1.0]), 16.0)):
        px = px_from_world(eye, np.array([1.0, -2.0, 1.7]) + point)
        np.testing.assert_allclose(px[:2], (32.0, y), atol=1e-3)


def test_other_options_say_how_far_apart_the_eyes_are(scene):
    asked = SceneOverrides(
        panorama="vr180", interocular_distance=0.065, convergence_distance=5.0, convergence_mode="parallel"
    )
    with working_scene(scene, asked) as working:
        stereo = working.camera.data.stereo
        assert (stereo.interocular_distance, stereo.convergence_distance) == pytest.approx((0.065, 5.0))
        assert stereo.convergence_mode == "PARALLEL"
        assert (working.render.resolution_x, working.render.resolution_y) == (4096, 4096)


def test_what_is_animated_of_a_lens_does_not_come_back(scene):
    """But the distance of the eyes may change with time."""
    data = scene.camera.data
    keyframes(data, "shift_x", {1: 0.1, 11: 0.5})
    data.driver_add("shift_y").driver.expression = "0.3"
    data.dof.use_dof = True
    data.keyframe_insert("dof.use_dof", frame=1)
    for frame, distance in ((1, 0.1), (11, 0.5)):
        data.stereo.interocular_distance = distance
        data.keyframe_insert("stereo.interocular_distance", frame=frame)
    with working_scene(scene, VR180) as working:
        for frame, distance in ((1, 0.1), (11, 0.5)):
            move_to(working, frame)
            lens = evaluated(working.camera, working).data
            assert (lens.shift_x, lens.shift_y, lens.dof.use_dof) == (0.0, 0.0, False)
            assert lens.stereo.interocular_distance == pytest.approx(distance)


# Its place


@pytest.mark.parametrize(
    "rotation", [(1.2, 0.0, 0.7), (0.3, 0.0, -2.0), (2.9, 0.0, 3.0), (1.1, 0.9, 0.4), (1.6, 0.0, math.pi)]
)
@pytest.mark.parametrize("parent", [None, (1.0, 1.0, 1.0), (-2.0, 1.0, 1.0)], ids=["alone", "parent", "mirrored"])
def test_the_camera_stands_upright_and_keeps_its_heading(scene, rotation, parent):
    scene.camera.rotation_euler = rotation
    if parent is not None:
        scene.camera.parent = add(scene, bpy.data.objects.new("Parent", None))
        scene.camera.parent.scale, scene.camera.parent.rotation_euler = parent, (0.2, -0.3, 1.1)
    with working_scene(scene, VR180) as working:
        assert_upright_as(working, scene.camera)


@pytest.mark.parametrize("roll", [0.0, 90.0, 180.0, -120.0])
def test_a_roll_turns_no_heading(scene, roll):
    upright = Matrix.Rotation(0.7, 4, "Z") @ Matrix.Rotation(80.0 * DEGREE, 4, "X")
    scene.camera.matrix_world = upright @ Matrix.Rotation(roll * DEGREE, 4, "Z")
    with working_scene(scene, VR180) as working:
        assert_upright_as(working, scene.camera)


@pytest.mark.parametrize("pitch", [0.0, 180.0], ids=["down", "up"])
@pytest.mark.parametrize("turn", [0.0, 0.7, -2.0])
def test_straight_down_or_up_the_heading_is_that_of_a_camera_without_roll(scene, pitch, turn):
    scene.camera.rotation_euler = (pitch * DEGREE, 0.0, turn)
    with working_scene(scene, VR180) as working:
        ours = heading(evaluated(working.camera, working).matrix_world)
    assert (ours - Vector((-math.sin(turn), math.cos(turn)))).length < ROUNDING


@pytest.mark.parametrize("moving", ["the camera", "its parent", "what it looks at"])
def test_the_heading_follows_an_animation(scene, moving):
    camera = scene.camera
    if moving == "the camera":
        keyframes(camera, "location", {1: (0.0, 0.0, 0.0), 11: (1.0, 2.0, 3.0)})
        keyframes(camera, "rotation_euler", {1: (1.0, 0.1, 0.0), 11: (1.8, -0.4, 2.5)})
    elif moving == "its parent":
        camera.parent = add(scene, bpy.data.objects.new("Parent", None))
        keyframes(camera.parent, "rotation_euler", {1: (0.0, 0.2, 0.0), 11: (0.3, 0.0, 2.5)})
    else:
        target = add(scene, bpy.data.objects.new("Target", None))
        keyframes(target, "location", {1: (5.0, 0.0, 0.0), 11: (0.0, 5.0, 3.0)})
        track = camera.constraints.new("TRACK_TO")
        track.target, track.track_axis, track.up_axis = target, "TRACK_NEGATIVE_Z", "UP_Y"
    seen = []
    with working_scene(scene, VR180) as working:
        for frame, subframe in ((1, 0.0), (4, 0.5), (11, 0.0), (6, 0.0)):
            move_to(working, frame, subframe=subframe)
            assert_upright_as(working, camera)
            seen.append(heading(evaluated(working.camera, working).matrix_world))
    assert min((a - b).length for a, b in itertools.pairwise(seen)) > 0.1


def test_nothing_of_it_stays(scene):
    scene.camera.data.dof.use_dof = True
    keyframes(scene.camera.data, "shift_x", {1: 0.1, 11: 0.5})
    before = whole_state(scene)
    with working_scene(scene, VR180):
        pass
    assert changes(before, whole_state(scene)) == {}


# A camera that is a panorama already


def test_a_panorama_keeps_its_own_place_and_stereo(scene):
    data = scene.camera.data
    data.type, data.panorama_type, data.longitude_max, data.latitude_min = "PANO", "EQUIRECTANGULAR", 1.0, -0.5
    data.dof.use_dof, data.shift_x = True, 0.25
    with working_scene(scene, VR180) as working:
        ours = evaluated(working.camera, working)
        own = evaluated(scene.camera, working)
        np.testing.assert_allclose(ours.matrix_world, own.matrix_world)
        angles = (ours.data.longitude_min, ours.data.longitude_max, ours.data.latitude_min, ours.data.latitude_max)
        np.testing.assert_allclose(angles, np.array([-90.0, 90.0, -90.0, 90.0]) * DEGREE, rtol=ROUNDING)
        assert (ours.data.dof.use_dof, ours.data.shift_x) == (True, 0.25)
        assert (ours.data.stereo.use_spherical_stereo, ours.data.stereo.use_pole_merge) == (False, False)
    assert data.longitude_max == 1.0
    assert scene_warnings(scene, VR180) == []


# What is said


@pytest.mark.parametrize(("overrides", "said"), [(VR180, "VR180"), (VR360, "360°"), (SceneOverrides(), None)])
def test_depth_of_field_that_is_lost_is_warned_of(scene, overrides, said):
    scene.camera.data.stereo.convergence_mode = "PARALLEL"
    assert not any("depth of field" in line for line in scene_warnings(scene, overrides))
    scene.camera.data.dof.use_dof = True
    expected = f"depth of field is switched off: the {said} panorama is sharp everywhere, since a headset cannot focus"
    assert scene_warnings(scene, overrides) == ([] if said is None else [expected])


@pytest.mark.parametrize(
    ("mode", "convergence", "asked", "degrees"),
    [
        ("OFFAXIS", 3.0, {}, None),
        ("OFFAXIS", 3.0, {"convergence_mode": "off-axis"}, "1.3"),
        ("OFFAXIS", 3.0, {"convergence_mode": "toe-in", "interocular_distance": 0.06}, "1.1"),
        ("OFFAXIS", 3.0, {"convergence_distance": 1.0}, "4.0"),
        ("OFFAXIS", 4.5, {"convergence_mode": "off-axis"}, None),
        ("OFFAXIS", 3.0, {"convergence_mode": "parallel"}, None),
        ("PARALLEL", 3.0, {}, None),
    ],
)
def test_eyes_that_turn_apart_are_warned_of(scene, mode, convergence, asked, degrees):
    stereo = scene.camera.data.stereo
    stereo.convergence_mode, stereo.convergence_distance = mode, convergence
    said = [line for line in scene_warnings(scene, replace(VR180, **asked)) if "turn apart" in line]
    assert [line.split(" by ")[1].split("°")[0] for line in said] == ([] if degrees is None else [degrees])
    assert not any("turn apart" in line for line in scene_warnings(scene, SceneOverrides()))


@pytest.mark.parametrize(
    ("asked", "mode"),
    [({}, "PARALLEL"), ({"convergence_mode": "toe-in"}, "TOE"), ({"convergence_distance": 9.0}, "OFFAXIS")],
)
def test_a_perspective_camera_gets_parallel_eyes_unless_their_convergence_is_asked_for(scene, asked, mode):
    scene.camera.data.stereo.convergence_mode = "OFFAXIS"
    with working_scene(scene, replace(VR180, **asked)) as working:
        assert working.camera.data.stereo.convergence_mode == mode
    assert scene.camera.data.stereo.convergence_mode == "OFFAXIS"


def orthographic(scene):
    scene.camera.data.type = "ORTHO"


def fisheye(scene):
    scene.camera.data.type, scene.camera.data.panorama_type = "PANO", "FISHEYE_EQUIDISTANT"
    scene.camera.data.stereo.use_spherical_stereo = True


def by_eevee(scene):
    scene.render.engine = "BLENDER_EEVEE" if bpy.app.version >= (5, 0) else "BLENDER_EEVEE_NEXT"


def cropped(scene):
    set_border(scene, (0.25, 0.75, 0.0, 1.0))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (orthographic, "camera 'Camera' is orthographic: a VR180 panorama needs a perspective or an equirectangular"),
        (fisheye, "camera 'Camera' is a panorama of another type: for VR180 set it to Equirectangular, or Perspective"),
        (by_eevee, "a VR180 panorama is rendered by Cycles alone: set Cycles as engine"),
        (cropped, "a headset shows whole VR180 panoramas: switch Render Region off in Output properties"),
    ],
)
def test_what_cannot_be_one_is_refused_in_a_line(scene, change, said):
    change(scene)
    before = whole_state(scene)
    with pytest.raises(BadInputError) as raised, working_scene(scene, VR180):
        pass
    assert str(raised.value).startswith(said)
    assert "\n" not in str(raised.value)
    assert changes(before, whole_state(scene)) == {}
    assert scene_warnings(scene, VR180) == [], "of what is not rendered nothing else is said"


def test_a_border_around_all_is_no_crop(scene):
    set_border(scene, (0.0, 1.0, 0.0, 1.0))
    with working_scene(scene, VR180) as working:
        assert working.render.resolution_x == 64
