"""All panels of the extension in a real window, at widths of 250 and 400 pixels and scales of 1 and 1.5: nothing is cut
off. Blender draws "…" where it cuts a text off, and that is looked for in the screenshots, which stay in
build/gui/drive_widths.
"""

from collections.abc import Iterator

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.gui.window import SEEN as DRIVERS
from tests.gui.window import drive, needs_a_window

SEEN = DRIVERS / "drive_widths"

LEAST_CONTRAST = 0.12
"""Difference, of 0 to 1, of a letter from what is behind it, at least: that of a greyed text, and more than a button's
shading."""

DOT_PX = 3.0
"""Pixels that a dot is wide and high, at most, at a scale of 1."""

PITCH_PX = 3.0, 6.0
"""Pixels from one dot to the next, at least and at most, at a scale of 1."""

CLEAR_PX = 5
"""Pixels above and below the dots, at a scale of 1, in which nothing may stand."""

SHADED_PX = 4
"""Pixels around a pixel among which the darkest is taken for what is behind it: more than half of a letter's stroke."""

pytestmark = needs_a_window


@pytest.fixture(scope="module")
def facts():
    """What the driver has seen."""
    return drive("drive_widths.py")


def drawn(name, region) -> NDArray[np.float32]:
    """What a screenshot shows in a region, as grey (H, W) of 0 to 1, the first row on top."""
    x, y, width, height = region
    image = bpy.data.images.load(str(SEEN / f"{name}.png"))
    pixels = np.array(image.pixels[:], np.float32).reshape(image.size[1], image.size[0], -1)
    bpy.data.images.remove(image)
    return pixels[y : y + height, x : x + width, :3].mean(axis=2)[::-1]


def letters(grey: NDArray[np.float32]) -> NDArray[np.bool_]:
    """The pixels that stand out of what is behind them."""
    padded = np.pad(grey, SHADED_PX, mode="edge")
    height, width = grey.shape
    shifts = range(2 * SHADED_PX + 1)
    behind = np.min([padded[j : j + height, i : i + width] for j in shifts for i in shifts], axis=0)
    return grey - behind > LEAST_CONTRAST


def dots(mask: NDArray[np.bool_], scale: float) -> Iterator[tuple[int, int, int, int]]:
    """Isolated spots as small as a dot: first column and row, last column and row."""
    left = {(int(x), int(y)) for y, x in zip(*np.nonzero(mask), strict=True)}
    while left:
        spot, todo = [], [left.pop()]
        while todo:
            x, y = todo.pop()
            spot.append((x, y))
            near = {(x + i, y + j) for i in (-1, 0, 1) for j in (-1, 0, 1)} & left
            left -= near
            todo += near
        columns, rows = zip(*spot, strict=True)
        box = min(columns), min(rows), max(columns), max(rows)
        if max(box[2] - box[0], box[3] - box[1]) < DOT_PX * scale:
            yield box


def _has_others(mask: NDArray[np.bool_], first: tuple[int, ...], last: tuple[int, ...], around: int) -> bool:
    """Something stands above or below the dots from the first to the last: they are a panel's grip, or parts of
    letters.
    """
    columns = slice(first[0], last[2] + 1)
    above = mask[max(first[1] - around, 0) : max(first[1] - 1, 0), columns]
    below = mask[last[3] + 2 : last[3] + around, columns]
    return bool(above.any() or below.any())


def ellipses(grey: NDArray[np.float32], scale: float) -> list[tuple[int, int]]:
    """Column and row of each "…": three dots in a row, as far apart, with nothing above them."""
    mask = letters(grey)
    found = sorted(dots(mask, scale), key=lambda box: (box[3], box[0]))
    result = []
    for first in found:
        if first[1] < CLEAR_PX * scale or mask.shape[0] - first[3] <= CLEAR_PX * scale:
            # A line that the region's upper or lower edge cuts through: another page has it whole.
            continue
        row = [box for box in found if abs(box[3] - first[3]) <= 1 and box[0] > first[2]]
        for second in row:
            pitch = second[0] - first[0]
            if not PITCH_PX[0] * scale <= pitch <= PITCH_PX[1] * scale:
                continue
            third = next((box for box in row if abs(box[0] - second[0] - pitch) <= 1), None)
            if third is not None and not _has_others(mask, first, third, int(CLEAR_PX * scale)):
                result.append(first[:2])
    return result


@pytest.mark.parametrize("scale", ["1", "1.5"])
def test_a_text_that_is_cut_off_would_be_seen(facts, scale):
    name = f"control-{scale}"
    assert ellipses(drawn(name, facts["controls"][name]), float(scale)) != []


@pytest.mark.parametrize("width", [250, 400])
@pytest.mark.parametrize("scale", ["1", "1.5"])
@pytest.mark.parametrize("place", ["view", "image", "output"])
def test_no_text_is_cut_off(facts, place, scale, width):
    shots = {name: region for name, region in facts["shots"].items() if f"-{place}-{scale}-{width}-" in name}
    assert f"{place}-{scale}-{width}" in facts["to the end"], "not all panels were seen"
    for name, region in shots.items():
        assert region[2] == pytest.approx(width, abs=2)
        assert ellipses(drawn(name, region), float(scale)) == [], name


def test_blender_translates_panels_and_reports(facts):
    assert facts["german"] == ["12 s gespart"] * 2


@pytest.mark.parametrize(("name", "started"), [("image", "a picture"), ("animation", "an animation")])
def test_a_shortcut_renders_and_is_what_a_menu_shows(facts, name, started):
    key, begun, is_whole = facts["shortcuts"][name]
    assert begun == started
    assert is_whole, "the menu's entry is no preview"
    assert key.split() == (["Shift", "Ctrl", "F12"] if name == "image" else ["Shift", "Ctrl", "Alt", "F12"])


def test_the_preferences_count(facts):
    """The preview's percentage asks for less than they do."""
    assert max(facts["preview_size"]) == 120
    assert facts["preview_samples"] == 4
