"""What the window shows while a pair is rendered. It needs BLENDER_WINDOW, see tests/gui/window; what is seen is left
in build/gui/drive_alive."""

import bpy
import numpy as np
import pytest

from tests.gui.window import SEEN as DRIVERS
from tests.gui.window import drive, needs_a_window

SEEN = DRIVERS / "drive_alive"
RESULT = "Render Result"
SOURCE, TARGET = (f"Stereo Render ({eye} eye)" for eye in ("left", "right"))

LEAST_CHANGE = 0.01
"""Mean difference of a channel of the Image Editor between two pictures, at least; the same one drawn twice has 0."""

BUTTON_PX = 20
"""Height of a render button, at least."""

pytestmark = needs_a_window


@pytest.fixture(scope="module")
def facts():
    """What the driver has seen."""
    return drive("drive_alive.py")


def drawn(facts, name):
    """What a screenshot has in the Image Editor, (H, W, 3)."""
    x, y, width, height = facts["editor"]
    image = bpy.data.images.load(str(SEEN / f"{name}.png"))
    pixels = np.array(image.pixels[:]).reshape(image.size[1], image.size[0], -1)
    bpy.data.images.remove(image)
    return pixels[y : y + height, x : x + width, :3]


def test_the_editor_shows_the_source_then_the_target_then_the_result(facts):
    assert facts["shown"] == [RESULT, SOURCE, TARGET]
    assert facts["after"] == [RESULT, []]


def test_a_second_blender_waits_and_is_taken_by_the_preview(facts):
    assert facts["taken"]


def test_what_is_drawn_changes_before_the_run_ends(facts):
    assert facts["drawn under way"]
    before, source = (drawn(facts, name) for name in ("before", "source"))
    assert np.abs(source - before).mean() > LEAST_CHANGE


def test_progress_has_words_from_the_start(facts):
    assert facts["words"][0].startswith("0 %")
    assert any("left" in words for words in facts["words"])


def test_the_image_under_way_is_not_saved(facts):
    assert facts["before undo"] == SOURCE
    assert not [name for name in facts["saved"] if name.startswith("Stereo")]


def test_an_undo_under_way_does_not_end_the_showing(facts):
    assert facts["after undo"].startswith("Stereo Render")


def test_progress_knows_the_samples_that_are_done(facts):
    assert 0.0 < facts["samples"] < 1.0


def test_after_escape_the_editor_shows_what_it_did_before(facts):
    assert facts["cancelled"] == [RESULT, []]


def test_an_editor_that_the_user_turns_to_something_else_is_left_alone(facts):
    assert facts["turned"] == ["Other", []]


def test_an_animation_says_its_frame_and_is_shown(facts):
    assert [words for words in facts["frames"] if words] == ["Frame 1 (1 of 2)", "Frame 2 (2 of 2)"]
    assert set(facts["frames shown"]) & {SOURCE, TARGET}
    assert facts["animated"] == [RESULT, []]


@pytest.mark.parametrize(("display", "windows"), [("AREA", 1), ("WINDOW", 2)])
def test_an_editor_that_opens_for_a_run_closes_after_escape(facts, display, windows):
    opened, closed, images = facts[f"opened as {display}"]
    assert opened[0] == windows
    assert len(opened[1]) == 1
    assert opened[1][0].startswith("Stereo Render")
    assert closed == [1, True]
    assert images == []


def test_a_result_is_fitted_where_its_pictures_were(facts):
    """At 100 % it would fill an eighth of the editor; Blender leaves a margin."""
    assert 0.8 < facts["fitted after an animation"] <= 1.01


def test_a_double_click_does_not_cancel_an_animation_and_a_later_click_does(facts):
    assert facts["double click"]
    assert max(facts["between buttons"]) < BUTTON_PX, "the second click was not on Cancel"
    assert facts["click on cancel"].startswith("Cancelled: ")
    assert facts["click on cancel"] in facts["reports"], "the status bar says nothing"


@pytest.mark.parametrize("display", ["AREA", "WINDOW"])
def test_an_error_is_reported_where_an_editor_was_opened_for_the_run(facts, display):
    assert facts[f"failed as {display}"] == [1, []]
    assert f"The worker of {display} has failed" in facts["reports"]


def test_opening_another_file_under_way_ends_the_run(facts):
    assert facts["new file"] == [True, []]
