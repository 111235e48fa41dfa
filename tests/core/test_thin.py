"""What is thinner than a pixel is found by the mean depth of a pixel's samples."""

import numpy as np
import pytest

from stereo_reproject.camera import see_the_same
from stereo_reproject.thin import thin_things

from .analytic import pixel_centres, stereo_rig

SIZE = (60, 40)
CLIP = 0.1
WALL, CORD = 3.0, 2.6
COLUMN = 30


def rig():
    return stereo_rig(SIZE, mode="off-axis", ipd=0.15, convergence=4.0)


def lengths(camera, depth):
    """(H, W): the way from the clip plane to depths (H, W)."""
    x, y = pixel_centres(camera)
    _, ray = camera.ray_from_px(x, y)
    return ((depth - CLIP) * np.sqrt(sum(np.square(part) for part in ray))).astype(np.float32)


def found(mean, source="left", target="right"):
    eyes = rig()
    assert not see_the_same(eyes[source], eyes[target])
    depth = np.full(SIZE[::-1], WALL, np.float32)
    return thin_things(lengths(eyes[source], mean), depth, eyes[source], eyes[target], clip_start=CLIP)


def wall():
    return np.full(SIZE[::-1], WALL)


def test_a_wall_has_nothing_thin():
    assert not found(wall()).any()


@pytest.mark.parametrize(("source", "target", "beside"), [("left", "right", -1), ("right", "left", 1)])
def test_a_cord_that_depth_misses_is_found_with_the_pixel_that_it_moves_to(source, target, beside):
    mean = wall()
    mean[:, COLUMN] = 0.6 * WALL + 0.4 * CORD
    columns = np.unique(np.nonzero(found(mean, source, target))[1])
    assert sorted(columns) == sorted([COLUMN, COLUMN + beside])
    assert found(mean, source, target)[:, COLUMN].all()


def test_a_surface_that_is_nearer_as_a_whole_is_not_thin():
    """One that mirrors little of the light: its rays are long, but count little."""
    mean = wall()
    mean[10:30, 10:50] = CORD
    assert not found(mean).any()


def test_what_is_farther_is_seen_in_a_mirror():
    mean = wall()
    mean[:, COLUMN] = 2.0 * WALL
    assert not found(mean).any()


def test_where_there_is_no_surface_nothing_is_thin():
    eyes = rig()
    depth = np.full(SIZE[::-1], np.inf, np.float32)
    length = np.zeros(SIZE[::-1], np.float32)
    assert not thin_things(length, depth, eyes["left"], eyes["right"], clip_start=CLIP).any()
