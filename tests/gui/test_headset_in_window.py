"""A pair for a headset made in a real window, by the panel; the camera stays as it was."""

import pytest

from tests.gui.window import SEEN as DRIVERS
from tests.gui.window import drive, needs_a_window

SEEN = DRIVERS / "drive_headset"

PICTURES = ["camera", "vr180", "cutouts", "panorama", "orthographic"]

pytestmark = needs_a_window


@pytest.fixture(scope="module")
def facts():
    """What the driver has seen."""
    return drive("drive_headset.py")


def test_the_button_renders_what_the_panel_says(facts):
    assert facts["report"] == {"panorama": "vr180", "size": [128, 128]}


def test_the_panel_follows_the_resolution_at_once(facts):
    assert "VIEW_3D" in facts["drawn anew"]


def test_camera_and_resolution_stay(facts):
    kind, rotation = facts["camera"]
    assert (kind, rotation) == ("PERSP", pytest.approx([1.5708, 0.0, 0.0], abs=1e-3))
    assert facts["resolution"] != [128, 128]


def test_the_cutouts_are_shown_by_a_button(facts):
    name, (width, height) = facts["shown"]
    assert name == "Stereo In a Headset"
    assert width > height > 0


def test_the_pictures_are_of_different_things(facts):
    assert facts["steps"]
    assert len({(SEEN / f"{name}.png").read_bytes() for name in PICTURES}) == len(PICTURES)
