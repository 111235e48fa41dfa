"""What is thinner than a pixel is found by the mean depth of a pixel's samples."""

import numpy as np
import pytest

from stereo_reproject.camera import disparity_per_nearness, see_the_same
from stereo_reproject.thin import FARTHEST, LEAST_COVERED, thin_things

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


def found(mean, source="left", target="right", *, edges=False):
    eyes = rig()
    assert not see_the_same(eyes[source], eyes[target])
    depth = np.full(SIZE[::-1], WALL, np.float32)
    edges = np.full(depth.shape, edges)
    return thin_things(lengths(eyes[source], mean), depth, eyes[source], eyes[target], edges=edges, clip_start=CLIP)


def wall():
    return np.full(SIZE[::-1], WALL)


def test_a_wall_has_nothing_thin():
    assert not found(wall()).any()


@pytest.mark.parametrize(("source", "target", "aside"), [("left", "right", -1), ("right", "left", 1)])
def test_a_cord_that_depth_misses_is_found_with_the_pixels_that_it_moves_over(source, target, aside):
    mean = wall()
    mean[:, COLUMN] = 0.6 * WALL + 0.4 * CORD
    eyes = rig()
    moves, most = (
        (1.0 / near - 1.0 / WALL) * disparity_per_nearness(eyes[source], eyes[target])
        for near in (CORD, WALL - 0.4 * (WALL - CORD) / LEAST_COVERED)
    )
    columns = np.unique(np.nonzero(found(mean, source, target))[1])
    assert {COLUMN, COLUMN + aside, COLUMN + aside * int(np.ceil(moves))} <= set(columns)
    assert columns.size <= 2 + min(most, FARTHEST)
    assert np.all((columns - COLUMN) * aside >= 0)
    assert found(mean, source, target)[:, COLUMN].all()


def test_a_pixel_on_an_edge_is_a_silhouette_s_business():
    mean = wall()
    mean[:, COLUMN] = 0.5 * WALL
    assert found(mean).any()
    assert not found(mean, edges=True).any()


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
    edges = np.zeros(depth.shape, bool)
    assert not thin_things(length, depth, eyes["left"], eyes["right"], edges=edges, clip_start=CLIP).any()
