"""Many views in a real window: their cone is drawn, and a quilt is rendered by the panel and shown."""

import pytest

from tests.gui.window import SEEN as DRIVERS
from tests.gui.window import drive, needs_a_window

SEEN = DRIVERS / "drive_views"

PICTURES = ["panel", "cone", "cone through the camera", "eevee", "other", "running", "quilt", "verdict"]

FIT_TOLERANCE = 0.05
"""Share of the editor that Blender leaves free around a picture that is fitted to it, at most."""

MIDDLE_PX = 2.0
"""Pixels between the picture's middle and the editor's, at most: Blender cuts zoomed sides off to whole ones."""

pytestmark = needs_a_window


@pytest.fixture(scope="module")
def facts():
    """What the driver has seen."""
    return drive("drive_views.py")


def test_eevee_is_in_the_way(facts):
    assert facts["eevee"] is False


def test_the_button_renders_the_views_that_the_panel_says(facts):
    assert len(facts["how"]) == 12
    assert facts["files"] == [
        "contact.png",
        "holes",
        "quilt_qs4x3a1.3333.exr",
        "quilt_qs4x3a1.3333.png",
        "report.json",
        "sweep.mp4",
        "views",
    ]


def test_progress_goes_from_view_to_view(facts):
    seen = [int(text.split()[1]) for text in facts["progress"]]
    assert seen == sorted(seen)
    assert {text.split()[-1] for text in facts["progress"]} == {"12"}
    # Some are made together: their stages begin once for several views.
    assert seen[0] == 1
    assert len(seen) > 3


def test_the_quilt_is_shown(facts):
    assert facts["shown"] == ["Stereo Quilt", [4 * 240, 3 * 180]]


def test_the_quilt_is_fitted_to_the_editor(facts):
    left, bottom, right, top, width, height = facts["place"]
    assert max((right - left) / width, (top - bottom) / height) == pytest.approx(1.0, abs=FIT_TOLERANCE)
    assert left + right == pytest.approx(width, abs=2.0 * MIDDLE_PX)
    assert bottom + top == pytest.approx(height, abs=2.0 * MIDDLE_PX)


def test_the_pictures_are_of_different_things(facts):
    assert facts["steps"]
    assert len({(SEEN / f"{name}.png").read_bytes() for name in PICTURES}) == len(PICTURES)
