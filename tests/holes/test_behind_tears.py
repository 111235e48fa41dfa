"""What lands in a gap, and is much farther away than what the source sees on both sides of it, is traced."""

import numpy as np
import pytest

from stereo_reproject.holes.reprojection import reproject
from stereo_reproject.images.reasons import Reason
from stereo_reproject.settings.accuracy import SETTINGS
from stereo_reproject.views.cone import beside
from stereo_reproject.views.view import View
from stereo_reproject.warp.rendered_view import RenderedView
from tests.warp.exact import Rig, passes_of

SIZE = WIDTH, HEIGHT = 96, 32
FOCUS = 4.0
SHIFT = 10.0
"""Pixels that the wall moves to the right; the box, in focus, stays, and the sky moves three times as far."""
IN_GAP = np.s_[4:-4, 31:33]
"""Pixels between the box and the wall to its right, where the sky of the window lands."""


def seen(window):
    """Return the target's reasons where a box (depth 4, columns 20 to 23) stands before a wall (depth 6), whose first
    eight columns are a window to what is so far away."""
    source, _ = Rig(size=SIZE, ipd=0.0).eyes
    per_nearness = WIDTH / (source.plane.right - source.plane.left)
    target = beside(source, SHIFT / per_nearness / (1.0 / FOCUS - 1.0 / 6.0), FOCUS)
    depth = np.full((HEIGHT, WIDTH), 6.0, np.float32)
    depth[:, 20:24] = FOCUS
    depth[:, :8] = window
    view = RenderedView(View("left", source), passes_of(depth))
    return reproject([view], View("right", target), SETTINGS["balanced"])


def test_the_sky_is_not_seen_through_what_the_source_does_not_know():
    result = seen(np.inf)
    assert np.isposinf(result.passes["Depth"][IN_GAP]).all()
    assert ((result.reasons[IN_GAP] & Reason.DISOCCLUDED.bit) > 0).all()


@pytest.mark.parametrize("window", [7.0, 9.0])
def test_a_wall_that_slants_or_steps_back_is_seen_in_a_gap(window):
    result = seen(window)
    landed = np.isclose(result.passes["Depth"][..., 0], window)
    assert landed.any()
    assert not (result.reasons[landed] & Reason.DISOCCLUDED.bit).any()
