"""The way through cameras placed by hand: along a line, around a thing, and where nothing is regular."""

import math

import numpy as np
import pytest

from stereo_reproject.views.camera import PerspectiveCamera, ViewPlane
from stereo_reproject.views.camera_order import line_order, order_of

PLANE = ViewPlane(-0.5, 0.5, -0.3, 0.3)


def camera(x, y=0.0, z=0.0, turned=0.0, plane=PLANE):
    """A camera that looks along -z, turned around the y axis."""
    pose = np.eye(4)
    pose[0, 0] = pose[2, 2] = math.cos(turned)
    pose[0, 2], pose[2, 0] = math.sin(turned), -math.sin(turned)
    pose[:3, 3] = x, y, z
    return PerspectiveCamera(64, 48, pose, plane)


@pytest.mark.parametrize("places", [(0.0, 1.0, 2.0), (3.0, -1.0, 0.5, 0.0), (0.0, 10.0, 0.1, 9.0), (1.0, 0.0)])
def test_cameras_on_a_line_come_from_left_to_right(places):
    cameras = [camera(x) for x in places]
    expected = list(np.argsort(places))
    assert line_order(cameras) == expected
    assert order_of(cameras) == expected


def test_cameras_that_look_back_have_their_own_left():
    cameras = [camera(x, turned=math.pi) for x in (0.0, 1.0, 2.0)]
    assert line_order(cameras) == order_of(cameras) == [2, 1, 0]


def test_shifted_lenses_are_a_line_too():
    assert line_order([camera(x, plane=ViewPlane(-0.5 - x / 8, 0.5 - x / 8, -0.3, 0.3)) for x in (0.0, 1.0)]) == [0, 1]


@pytest.mark.parametrize(
    "cameras",
    [
        [camera(0.0), camera(1.0, 0.5), camera(2.0)],
        [camera(0.0), camera(1.0, turned=0.3), camera(2.0)],
        [camera(0.0), camera(0.0, z=-1.0), camera(0.0, z=-2.0)],
        [camera(0.0), camera(0.0), camera(0.0)],
    ],
    ids=["off the line", "turned", "one behind the other", "at one place"],
)
def test_other_cameras_are_no_line(cameras):
    assert line_order(cameras) is None
    assert sorted(order_of(cameras)) == [0, 1, 2]


def test_cameras_around_a_thing_come_one_after_the_other():
    angles = [0.9, 0.0, 0.3, 1.2, 0.6]
    cameras = [camera(5.0 * math.sin(a), 0.0, 5.0 * math.cos(a), turned=a) for a in angles]
    assert line_order(cameras) is None
    assert order_of(cameras) == list(np.argsort(angles))


def test_cameras_at_one_place_come_by_their_direction():
    assert order_of([camera(0.0, turned=a) for a in (0.2, 0.0, 0.1)]) in ([0, 2, 1], [1, 2, 0])
