"""Places of a picture at which its depth is looked at, the range of what is found, and what the frame cuts."""

import numpy as np
import pytest

from stereo_reproject.views.depth_range import (
    CUT_SHARE,
    EdgeHit,
    FramePixels,
    cut_in_front,
    edge_positions,
    frame_corners,
    grid_positions,
    hits_of_pair,
    named,
    typical_range,
)
from tests.warp.analytic import camera, pose

FRAME = FramePixels(-10.0, -4.0, 120.0, 80.0)


def test_the_grid_covers_the_whole_frame_evenly():
    x, y = grid_positions(FRAME, 12, 8)
    assert (x.min(), x.max(), y.min(), y.max()) == (-5.0, 105.0, 1.0, 71.0)
    assert x.mean() == pytest.approx(50.0)
    assert len(set(zip(x, y, strict=True))) == 96


def test_edges_are_the_frame_s_own():
    for side, x in (("left", -10.0), ("right", 110.0)):
        across, down = edge_positions(FRAME, side, 4)
        assert across.tolist() == [x] * 4
        assert down.tolist() == [6.0, 26.0, 46.0, 66.0]


def test_a_twig_and_a_gap_do_not_decide():
    depth = np.full(1000, 5.0)
    depth[:4], depth[4:8] = 0.1, np.inf
    assert typical_range(depth) == (5.0, 5.0)
    depth[:20], depth[20:40] = 0.1, np.inf
    assert typical_range(depth) == (0.1, np.inf)


def test_a_small_thing_before_the_sky_is_the_nearest():
    depth = np.full(1000, np.inf)
    depth[3] = 7.0
    assert typical_range(depth) == (7.0, np.inf)
    assert typical_range(np.full(9, np.inf)) is None


def hits(name, count, depth=1.0, side="left"):
    return [EdgeHit(side, name, depth)] * count


def test_what_an_edge_cuts_in_front_is_named_largest_first():
    rows = 20
    few = int(CUT_SHARE * rows) - 1
    seen = hits("Door", 5) + hits("Lamp", 8, side="right") + hits("Wall", 12, depth=9.0) + hits("Twig", few)
    assert cut_in_front(seen, 2.0, rows) == [("Lamp", "right"), ("Door", "left")]
    assert cut_in_front(seen, 1.0, rows) == []


def test_what_has_no_name_counts_as_a_part_of_the_largest_thing_that_has_one():
    rows = 20
    few = int(CUT_SHARE * rows) - 1
    assert cut_in_front(hits("Rock", few) + hits("", few) + hits("", 9, side="right"), 2.0, rows) == [
        ("", "right"),
        ("Rock", "left"),
    ]


def test_a_pair_s_edges_are_those_of_the_eye_that_loses_more():
    left, right = np.full((40, 8), np.inf), np.full((40, 8), np.inf)
    # Seen by the right eye at the left edge, and by the left eye at the right one; the other two places do not count.
    right[:20, 0], left[30:, -1] = 3.0, 4.0
    left[:, 0], right[:, -1] = 1.0, 2.0
    hits = hits_of_pair({"left": left, "right": right}, 20)
    assert [hit.depth for hit in hits if hit.side == "left"] == [3.0] * 10
    assert [hit.depth for hit in hits if hit.side == "right"] == [4.0] * 5
    assert {hit.name for hit in hits} == {""}


def test_what_has_no_name_gets_that_of_what_was_seen_there():
    seen = hits("Door", 2, depth=3.0) + hits("Lamp", 1, depth=3.2, side="right")
    unnamed = hits("", 1, depth=3.03) + hits("", 1, depth=3.2) + hits("", 1, depth=3.2, side="right")
    assert [hit.name for hit in named(unnamed, seen)] == ["Door", "", "Lamp"]
    assert named(unnamed, ()) == tuple(unnamed)


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan])
def test_what_is_no_depth_is_not_at_the_edge(bad):
    assert hits_of_pair({"left": np.full((4, 3), bad), "right": np.full((4, 3), np.inf)}, 4) == ()


@pytest.mark.parametrize("orthographic", [False, True])
def test_the_frame_s_corners_are_where_the_camera_sees_them(orthographic):
    eye = camera((120, 80), pose((1.0, 2.0, 3.0), yaw=0.4, pitch=-0.2), orthographic=orthographic)
    corners = frame_corners(eye, FramePixels(0.0, 0.0, 120.0, 80.0), 4.0)
    local = (corners - eye.world_from_camera[:3, 3]) @ eye.world_from_camera[:3, :3]
    x, y, depth = eye.px_from_point((local[:, 0], local[:, 1], local[:, 2]), np.ones(4))
    np.testing.assert_allclose(x, [0, 120, 120, 0], atol=1e-9)
    np.testing.assert_allclose(y, [80, 80, 0, 0], atol=1e-9)
    np.testing.assert_allclose(depth, 4.0, rtol=1e-12)
