"""The extension in a real window: installed from its zip, pressed, cancelled, looked at.

It needs BLENDER_WINDOW, see tests/gui/window. What is seen is left in build/gui/drive, pictures included. GUI_PREVIEW
names the preview's percentage and samples.
"""

import os

import bpy
import numpy as np
import pytest

from tests.gui.window import SEEN as DRIVERS
from tests.gui.window import drive, needs_a_window

PREVIEW = os.environ.get("GUI_PREVIEW", "").split()
SEEN = DRIVERS / "drive"

SAME_MASK, SAME_COLOUR = 5e-4, 1e-3
"""What is promised of the GPU and numpy: the share of pixels that differ in the mask, and how far colours may."""

FRINGES = 0.001
"""Mean difference of a channel of the Image Editor between stereo and one eye, at least; most of it is background."""

MAX_ABOVE_BUTTONS_PX = 120
"""Pixels between a sidebar's upper end and the render buttons, at most: tool settings and the panel's own header."""

PICTURES = ["panel", "output", "checked", "running", "cancelled", "preview", "result", "holes"]

pytestmark = needs_a_window


@pytest.fixture(scope="module")
def facts():
    """What the driver has seen."""
    return drive("drive.py", *PREVIEW)


def test_the_zip_is_installed(facts):
    assert facts["registered"]


def test_the_window_lives_while_a_job_runs_and_a_second_one_is_refused(facts):
    assert facts["started"]
    assert facts["turns"] > 10
    assert facts["second_refused"]


def test_a_check_changes_nothing(facts):
    assert facts["inspection"]
    assert facts["unchanged_by_check"]


def test_escape_ends_a_run_and_leaves_nothing(facts):
    assert facts["cancelled"]
    assert facts["unchanged_by_cancel"]


def test_escape_in_a_menu_and_in_a_field_ends_these_alone(facts):
    assert facts["escaped"] == {"menu": False, "field": False}
    assert facts["field as before"]
    assert (SEEN / "menu_under_way.png").read_bytes() != (SEEN / "menu_escaped.png").read_bytes()


def test_escape_in_another_window_does_the_same(facts):
    assert facts["other_window"]


def test_the_cancel_button_does_the_same(facts):
    assert facts["unchanged_by_cancel_button"]


def test_convergence_is_one_step_to_undo(facts):
    assert facts["convergence"] == pytest.approx(4.25)
    assert facts["undone"]


def test_a_preview_becomes_the_render_result(facts):
    assert facts["result"] == ["Render Result"]
    assert 0.0 < facts["preview"]["rerendered"] < 0.5
    assert facts["unchanged_by_preview"]


def test_a_preview_is_large_enough_to_look_at_and_fits_into_the_editor(facts):
    assert max(facts["size"]) >= 480
    assert 0.8 < max(facts["fitted"]) <= 1.01


@pytest.mark.parametrize("kind", ["VIEW_3D", "IMAGE_EDITOR"])
def test_the_render_buttons_come_first(facts, kind):
    found = facts[f"buttons of {kind}"]
    assert found["top"][1] - found["preview"][1] < MAX_ABOVE_BUTTONS_PX
    assert found["preview"][1] == found["render"][1] > found["animation"][1]
    assert found["preview"][0] < found["render"][0]


def test_the_button_row_keeps_its_height_while_something_runs(facts):
    assert facts["cancel_button"][1] == facts["buttons of VIEW_3D"]["animation"][1]


def drawn_in_the_image_editor(facts, name):
    """What a screenshot has there, (H, W, 3)."""
    x, y, width, height = facts["editor"]
    image = bpy.data.images.load(str(SEEN / f"{name}.png"))
    pixels = np.array(image.pixels[:]).reshape(image.size[1], image.size[0], -1)
    bpy.data.images.remove(image)
    return pixels[y : y + height, x : x + width, :3]


def test_the_pair_is_drawn_in_stereo_where_one_eye_was_drawn_before(facts):
    """Red is the left eye's, green and blue are the other's: with stereo off, they alone change."""
    assert facts["drawn_in_stereo"]
    stereo, flat = (drawn_in_the_image_editor(facts, name) for name in ("preview", "flat"))
    assert flat.std() > 0.03, "a picture with something to see"
    red, *others = np.abs(stereo - flat).mean(axis=(0, 1))
    assert red < 0.1 * min(others)
    assert min(others) > FRINGES


def test_the_fill_fits_this_blender(facts):
    assert facts["fill"]["method"] == "packed"
    assert facts["fill"]["camera"] == ("osl" if facts["osl"] else "portal")


def test_a_picture_is_shown_in_the_image_editor(facts):
    name, size = facts["holes"]
    assert name == "Stereo Rendered Again"
    assert min(size) > 100


def test_an_animation_is_written(facts):
    assert facts["animation"] == ["shot_0001_L.png", "shot_0001_R.png", "shot_0002_L.png", "shot_0002_R.png"]


def test_view_animation_plays_it_without_stereoscopy(facts):
    """By our key, and by Blender's own where that would find no files."""
    ours = "shot_0001_L.png"
    assert facts["played"] == {"ours": ours, "Blender's": ours, "Blender's, with plain files": "shot_0001.png"}
    assert not facts["stereoscopy"]


def test_frames_are_looked_at_with_both_eyes_and_follow_the_timeline(facts):
    is_pair, in_stereo, share = facts["frame"]
    assert (is_pair, in_stereo) == (True, True)
    # Fitted to the editor, beside its sidebar.
    assert 0.5 < share <= 1.01
    assert {*facts["frames played"]} == {"shot_0001_L.png", "shot_0002_L.png"}


def test_switching_the_extension_off_under_way_and_on_again(facts):
    assert facts["gone"]
    assert facts["back"]


def test_the_pictures_are_of_different_things(facts):
    assert facts["steps"]
    seen = {(SEEN / f"{name}.png").read_bytes() for name in PICTURES}
    assert len(seen) == len(PICTURES)
    assert min(map(len, seen)) > 20_000, "a black window"


def test_the_window_s_gpu_warps_as_numpy_does(facts):
    """OpenGL or Vulkan; the size is the picture's of a synthetic room."""
    found = facts["warp"]
    assert found.pop("device")
    assert len(found) > 1
    for mode, result in found.items():
        assert result["by"] == "gpu", mode
        assert result["told"] > 0.5, mode
        assert result["mask"] <= SAME_MASK, mode
        assert 0.0 < result["colour"] <= SAME_COLOUR, mode
