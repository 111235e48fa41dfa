"""The scene's depth set in a real window: by buttons, by dragging the arrow of the screen, and with the eyedropper."""

import pytest

from tests.gui.window import SEEN as DRIVERS
from tests.gui.window import drive, needs_a_window

SEEN = DRIVERS / "drive_depth"

PICTURES = ["measured", "fitted", "planes through the camera", "planes from the side", "dragging", "picked"]

PICK_TOLERANCE = 0.03
"""Share of a depth: the mouse is on whole pixels, and surfaces are seen at an angle."""

pytestmark = needs_a_window


@pytest.fixture(scope="module")
def facts():
    """What the driver has seen."""
    return drive("drive_depth.py")


def test_the_depth_is_measured_by_a_button(facts):
    near, far = facts["measured"]
    assert 0.0 < near < far


def test_a_fit_sets_both_distances_and_is_undone(facts):
    assert facts["fitted"][0] != pytest.approx(facts["unfitted"][0])
    assert facts["fitted"][1] != pytest.approx(facts["unfitted"][1])
    assert facts["fit undone"] == pytest.approx(facts["unfitted"])


def test_the_planes_are_switched_on_by_a_button(facts):
    assert facts["shown"]


def test_the_arrow_drags_the_convergence_and_nothing_else(facts):
    before, after = facts["dragged"]
    assert after[1] > 1.05 * before[1], "dragged away from the camera"
    assert after[0] == before[0]
    assert facts["drag undone"] == pytest.approx(before)


def test_the_eyedropper_puts_the_screen_at_what_is_clicked(facts):
    assert facts["picked"][1] == pytest.approx(facts["clicked"], rel=PICK_TOLERANCE)
    assert facts["eyedropper cancelled"] == pytest.approx(facts["drag undone"])
    assert facts["pick undone"] == pytest.approx(facts["drag undone"])


def test_the_eyedropper_is_out_in_every_window(facts):
    assert facts["put away elsewhere"] == [False, pytest.approx(facts["pick undone"])]
    is_out, picked = facts["picked elsewhere"]
    assert not is_out
    assert picked[1] != pytest.approx(facts["pick undone"][1], rel=0.01)


def test_the_planes_go_with_the_extension(facts):
    assert facts["gone"]


def test_the_pictures_are_of_different_things(facts):
    assert facts["steps"]
    assert len({(SEEN / f"{name}.png").read_bytes() for name in PICTURES}) == len(PICTURES)
