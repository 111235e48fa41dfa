"""Views and rigs: looked up by name, in order."""

import pytest

from stereo_reproject.views.motion import moving, standing_still
from stereo_reproject.views.view import Rig, View
from tests.warp.analytic import stereo_rig

SIZE = (8, 6)


def test_a_rig_has_its_views_by_name_and_in_order():
    eyes = stereo_rig(SIZE)
    rig = Rig.of_cameras(eyes)
    assert rig.names == ("left", "right")
    assert [view.camera for view in rig] == [eyes["left"], eyes["right"]]
    assert rig["right"].camera is eyes["right"]
    assert len(rig) == 2
    with pytest.raises(KeyError):
        rig["middle"]


def test_two_views_of_one_name_are_refused():
    eye = stereo_rig(SIZE)["left"]
    with pytest.raises(ValueError, match="same name"):
        Rig((View("left", eye), View("left", eye)))


def test_a_view_without_a_motion_stands_still():
    eyes = stereo_rig(SIZE)
    assert Rig.of_cameras(eyes)["left"].moving == standing_still(eyes["left"])
    motion = {name: moving(eye, eyes["right"], eye) for name, eye in eyes.items()}
    assert Rig.of_cameras(eyes, motion)["left"].moving is motion["left"]
