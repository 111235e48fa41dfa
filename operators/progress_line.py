"""The line about a run at the lower edge of the Image Editor that shows it: a window of its own has no status bar.
Narrow editors have two lines.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import bpy

from .strip import MARGIN_PX, draw_strip, text_width_px


@dataclass
class _Line:
    """The line that is drawn: the address of its editor's area, ways to say it in lines, the widest first, and
    Blender's handle of the drawing.
    """

    area: int
    ways: Sequence[Sequence[str]]
    handler: object


_lines: list[_Line] = []
"""The line of the job that is under way, if any."""


def show_line(area: bpy.types.Area, ways: Sequence[Sequence[str]]) -> None:
    """Draw a text over the lower edge of an Image Editor until `remove_line`, in place of the one before, in the first
    of these ways, each in lines of its own, for which there is room.
    """
    if not _lines:
        handler = bpy.types.SpaceImageEditor.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL")
        _lines.append(_Line(0, (), handler))
    line = _lines[0]
    line.area, line.ways = area.as_pointer(), ways
    _redraw(area)


def remove_line() -> None:
    """Take the line away; do nothing where there is none."""
    while _lines:
        line = _lines.pop()
        bpy.types.SpaceImageEditor.draw_handler_remove(line.handler, "WINDOW")
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                if area.as_pointer() == line.area:
                    _redraw(area)


def _redraw(area: bpy.types.Area) -> None:
    """Have the picture of an Image Editor drawn anew."""
    for region in area.regions:
        if region.type == "WINDOW":
            region.tag_redraw()


def _draw() -> None:
    """Draw the line, on a dark strip, in the editor that it is for. Blender calls this for every Image Editor."""
    area, region = bpy.context.area, bpy.context.region
    if not _lines or area is None or region is None or area.as_pointer() != _lines[0].area:
        return
    scale = bpy.context.preferences.system.ui_scale
    left = _left_of_text(area, region) + MARGIN_PX * scale
    lines = way_that_fits(_lines[0].ways, region.width - left, partial(text_width_px, scale=scale))
    draw_strip((0.0, 0.0), region.width, left, lines, scale)


def way_that_fits(ways: Sequence[Sequence[str]], room: float, measure: Callable[[str], float]) -> Sequence[str]:
    """Return the first of some ways to say something in lines that are no wider than `room`, or else the last; measure
    returns the width of a text in the same unit.
    """
    return next((lines for lines in ways if all(measure(line) <= room for line in lines)), ways[-1])


def _left_of_text(area: bpy.types.Area, region: bpy.types.Region) -> float:
    """Return the width, in pixels, that the toolbar covers of the picture's left side."""
    tools = [other for other in area.regions if other.type == "TOOLS" and other.width > 1 and other.x <= region.x]
    return float(max((other.x + other.width - region.x for other in tools), default=0))
