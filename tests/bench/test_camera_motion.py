import math

import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix, Vector  # noqa: E402

from tests.bench.camera_motion import moved  # noqa: E402


def test_a_dolly_goes_where_the_camera_looks():
    pose = Matrix.Translation((1.0, 2.0, 3.0)) @ Matrix.Rotation(math.pi / 2.0, 4, "X")
    assert tuple(moved(pose, 4, 0.25, 0.0).translation) == pytest.approx((1.0, 3.0, 3.0))


def test_a_pan_turns_to_the_left_in_place():
    pose = Matrix.Translation((1.0, 2.0, 3.0)) @ Matrix.Rotation(math.pi / 2.0, 4, "X")
    turned = moved(pose, 3, 0.0, 30.0)
    assert tuple(turned.translation) == pytest.approx((1.0, 2.0, 3.0))
    assert tuple(turned.to_3x3() @ Vector((0.0, 0.0, -1.0))) == pytest.approx((-1.0, 0.0, 0.0), abs=1e-6)


def test_the_first_frame_is_the_scenes_own():
    pose = Matrix.Translation((1.0, 2.0, 3.0))
    assert moved(pose, 0, 0.25, 30.0) == pose
