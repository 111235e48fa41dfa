"""Every way to look at a pair, in a real window: each button, the pixels of the editor, and what ends a wiggle.

It needs BLENDER_WINDOW, see tests/gui/window. What is seen is left in build/gui/drive_viewing, pictures included.
GUI_RENDER names the render's percentage and samples.
"""

import itertools
import os

import bpy
import numpy as np
import pytest
from PIL import Image

from tests.gui.window import SEEN as DRIVERS
from tests.gui.window import drive, needs_a_window

RENDER = os.environ.get("GUI_RENDER", "").split()
SEEN = DRIVERS / "drive_viewing"

NAMES = {
    "ANAGLYPH": "Render Result",
    "LEFT": "Stereo Left",
    "RIGHT": "Stereo Right",
    "SIDE_BY_SIDE": "Stereo Side by Side",
    "CROSS_EYED": "Stereo Cross-Eyed",
}

FRINGES = 0.001
"""Mean difference of a channel of the editor between two ways to look, at least; most of it is background."""

SAME = 0.02
"""Difference of two pictures that show one thing at two zooms, on the average: edges fall between other pixels."""

LEAST_SECONDS, MOST_SECONDS = 0.15, 0.7
"""Time for which an eye is shown, at 0.2 s: a window drawn in software takes its own time besides."""

pytestmark = needs_a_window


@pytest.fixture(scope="module")
def facts():
    """What the driver has seen."""
    return drive("drive_viewing.py", *RENDER)


def editor(facts, name):
    """What a screenshot has in the Image Editor, (H, W, 3)."""
    x, y, width, height = facts["editor"]
    image = bpy.data.images.load(str(SEEN / f"{name}.png"))
    pixels = np.array(image.pixels[:]).reshape(image.size[1], image.size[0], -1)
    bpy.data.images.remove(image)
    return pixels[y : y + height, x : x + width, :3]


def picture(facts, name):
    """The picture in the editor of a screenshot, (h, w, 3)."""
    left, bottom, right, top = facts["places"][name]
    return editor(facts, name)[bottom:top, left:right]


def difference(first, second):
    """Mean difference of two pictures, resampled to the smaller of their sizes."""
    height, width = (min(sides) for sides in zip(first.shape[:2], second.shape[:2], strict=True))
    sampled = [
        of[np.linspace(0, of.shape[0] - 1, height).astype(int)][:, np.linspace(0, of.shape[1] - 1, width).astype(int)]
        for of in (first, second)
    ]
    return np.abs(sampled[0] - sampled[1]).mean()


def test_without_a_pair_the_buttons_are_grey(facts):
    assert facts["without_a_pair"] == [False, False, False]


def test_a_panel_elsewhere_has_the_pair_looked_at_in_the_image_editor(facts):
    assert facts["looked"] == {"RIGHT": 0, "WIGGLE": 1, "CROSS_EYED": 0}


def test_the_sidebar_covers_nothing_of_a_pair_that_is_fitted(facts):
    width, free, whole = facts["beside the sidebar"]
    assert free < whole, "the sidebar does not lie over the picture"
    assert 0.9 * free < width <= free + 1.0


def test_the_sidebar_covers_nothing_of_the_render_result(facts):
    """The Cornell box is square: it may have room in the editor's middle."""
    left, right, free, whole = facts["pair beside the sidebar"]
    assert free < whole, "the sidebar does not lie over the picture"
    assert left >= -1
    assert right <= free + 1
    assert right - left > 0.5 * free


def test_under_a_sidebar_that_leaves_little_a_picture_is_fitted_to_the_whole_editor(facts):
    width, free, whole = facts["under a wide sidebar"]
    assert free < 0.6 * whole
    assert free < width <= whole


def test_each_picture_is_fitted_to_the_editor(facts):
    """Blender 5 draws an image for the first time at 100 %, which is small here."""
    widths = facts["widths"]
    assert widths["LEFT"] == pytest.approx(widths["RIGHT"])
    assert widths["SIDE_BY_SIDE"] == pytest.approx(widths["CROSS_EYED"])
    assert facts["modes"]["LEFT"][2] > facts["modes"]["SIDE_BY_SIDE"][2] > 1.0


def test_each_button_shows_its_image_and_is_pressed(facts):
    assert {mode: found[:2] for mode, found in facts["modes"].items()} == {
        mode: [name, mode] for mode, name in NAMES.items()
    }
    assert facts["dirty"] == [], "Blender would ask about unsaved images when it quits"


def test_an_anaglyph_has_the_left_eye_s_red_and_the_right_eye_s_rest(facts):
    anaglyph, left, right = (editor(facts, name) for name in ("anaglyph", "left", "right"))
    assert left.std() > 0.03, "a picture with something to see"
    np.testing.assert_allclose(anaglyph[..., 0], left[..., 0], atol=SAME)
    np.testing.assert_allclose(anaglyph[..., 1:], right[..., 1:], atol=SAME)
    assert min(np.abs(left - right).mean(axis=(0, 1))) > FRINGES


def test_side_by_side_has_both_eyes_and_cross_eyed_the_other_way_round(facts):
    left, right = (picture(facts, name) for name in ("left", "right"))
    for name, (first, second) in {"side_by_side": (left, right), "cross_eyed": (right, left)}.items():
        both = picture(facts, name)
        halves = both[:, : both.shape[1] // 2], both[:, both.shape[1] // 2 :]
        assert both.shape[1] > 1.8 * both.shape[0] * left.shape[1] / left.shape[0]
        assert difference(halves[0], first) < difference(halves[0], second)
        assert difference(halves[1], second) < difference(halves[1], first)
        assert difference(halves[0], first) < SAME


def test_a_wiggle_alternates_in_its_time_and_the_window_lives(facts):
    assert facts["wiggling"][1] == "WIGGLE"
    names = [name for name, _ in facts["turns"]]
    assert set(names) == {"Stereo Left", "Stereo Right"}
    assert all(first != second for first, second in itertools.pairwise(names))
    times = np.diff([when for _, when in facts["turns"]])[1:]
    assert LEAST_SECONDS < np.median(times) < MOST_SECONDS
    first, *others = (editor(facts, path.stem) for path in sorted(SEEN.glob("wiggle_*.png")))
    apart = [min(np.abs(other - first).mean(axis=(0, 1))) for other in others]
    assert max(apart) > FRINGES


def test_a_panel_elsewhere_says_of_a_slot_what_the_tab_here_says(facts):
    (pair, (mode, place)), *turned = facts["elsewhere"]
    assert (mode, place) == ("ANAGLYPH", pair)
    assert [found[0] for found in turned] == [3, pair]
    for place, drawn, here in turned:
        assert drawn == [here, place]


def test_a_wiggle_shows_both_eyes_at_the_same_zoom_and_place(facts):
    """Also where the right eye was never shown before, and after the user has zoomed and panned."""
    (first, *_), (moved, *_) = facts["eyes_at"]
    for places in facts["eyes_at"]:
        assert {eye for eye, *_ in places} == {"Stereo Left", "Stereo Right"}
        assert len({tuple(place) for _, *place in places}) == 1, places
    assert moved[-1] > first[-1] > 1.0
    assert moved[1] < first[1]


def test_escape_ends_a_wiggle_and_the_pair_is_seen_as_before(facts):
    assert facts["after_escape"] == ["Stereo Cross-Eyed", "CROSS_EYED"]
    assert facts["left_over"] == ["Stereo Cross-Eyed"]


def test_so_does_another_press_and_another_button(facts):
    assert facts["after_again"] == ["Stereo Cross-Eyed", "CROSS_EYED"]
    assert facts["after_other"] == ["Stereo Left", "LEFT"]


def test_so_does_a_new_render(facts):
    assert facts["after_render"][0] == "Render Result"


def test_the_size_of_another_render_is_known_from_its_drawing(facts):
    assert facts["size_of_another"] == facts["expected_size"]


def test_a_picture_with_one_view_is_refused_in_one_line(facts):
    (line,) = facts["one_view"]
    assert "no stereo pair" in line
    assert len(line.strip().splitlines()) == 1
    assert facts["image_after_one_view"] == "Render Result"


@pytest.mark.parametrize("step", ["undo", "undo_of_all", "redo"])
def test_an_undo_to_before_an_image_was_made_leaves_it_in_place(facts, step):
    name, mode, width = facts[f"after_{step}"]
    assert (name, mode) == ("Stereo Side by Side", "SIDE_BY_SIDE")
    assert width == 2 * facts["after_preview"][3]


def test_ours_and_multiview_are_in_slots_of_their_own(facts):
    assert not any("multiview" in warning for warning in facts["warnings"])
    assert facts["slots"][-1] == "Multiview"
    assert facts["pair_slot"] != len(facts["slots"]) - 1
    assert facts["side MULTIVIEW"] == ["Multiview", "Stereo Right", "RIGHT"]
    assert facts["side OURS"][1:] == ["Stereo Right", "RIGHT"]
    ours, multiview, right = (editor(facts, name) for name in ("side_ours", "side_multiview", "right"))
    assert 0.0 < np.abs(ours - multiview).mean() < np.abs(editor(facts, "left") - right).mean()
    np.testing.assert_allclose(ours, right, atol=1e-6)


def test_j_flips_between_them_as_after_f12(facts):
    assert facts["after_j"] == "Multiview"
    assert facts["after_j_again"] == facts["pair_slot"]


def test_a_new_pair_is_shown_as_the_last_one_was(facts):
    name, mode, width, size = facts["after_preview"]
    assert (name, mode) == ("Stereo Side by Side", "SIDE_BY_SIDE")
    assert width == 2 * size
    before, now = (editor(facts, shot) for shot in ("side_by_side", "renewed"))
    assert np.abs(now - before).mean() > FRINGES, "a preview of other samples has other noise"
    assert 0.7 < facts["fitted"] <= 1.01


def test_the_export_leaves_the_render_result_and_is_a_wiggle(facts):
    assert facts["content_kept"][0] == "Render Result"
    with Image.open(SEEN / "wiggle.gif") as file:
        assert (file.n_frames, file.info["loop"]) == (2, 0)
    assert (SEEN / "wiggle.mp4").stat().st_size > 10_000


def test_the_export_leaves_the_libraries_of_extensions(facts):
    assert facts["libraries"], "a Blender that has read the factory settings has removed them"


def test_a_look_from_elsewhere_opens_an_editor_and_esc_here_ends_its_wiggle(facts):
    wanted = {"SIDE_BY_SIDE": "SIDE_BY_SIDE", "WIGGLE": "WIGGLE", "windows": 1, "after Esc": "SIDE_BY_SIDE"}
    assert facts["opened"] == wanted


def test_a_window_that_wiggles_can_be_closed(facts):
    assert facts["in_a_window"]
    assert facts["after_closing"] == 0


def test_switching_the_extension_off_takes_its_images_away(facts):
    assert facts["switched_off"] == ["Render Result", []]
