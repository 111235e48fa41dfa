"""The line about a run at the lower edge of the Image Editor that shows it: a window of its own has no status bar."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from .strip import MARGIN_PX, draw_strip, text_width_px


@dataclass
class _Line:
    """The line that is drawn: the address of its editor's area, its text, a short one for narrow editors, and Blender's
    handle of the drawing.
    """

    area: int
    text: str
    short: str
    handler: object


_lines: list[_Line] = []
"""The line of the job that is under way, if any."""


def show_line(area: bpy.types.Area, text: str, short: str) -> None:
    """Draw a text over the lower edge of an Image Editor until `remove_line`, in place of the one before; the short one
    where there is no room for it.
    """
    if not _lines:
        handler = bpy.types.SpaceImageEditor.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL")
        _lines.append(_Line(0, "", "", handler))
    line = _lines[0]
    line.area, line.text, line.short = area.as_pointer(), text, short
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
    scale, line = bpy.context.preferences.system.ui_scale, _lines[0]
    left = _left_of_text(area, region) + MARGIN_PX * scale
    has_room = left + text_width_px(line.text, scale) < region.width
    draw_strip((0.0, 0.0), region.width, left, line.text if has_room else line.short, scale)


def _left_of_text(area: bpy.types.Area, region: bpy.types.Region) -> float:
    """Return the width, in pixels, that the toolbar covers of the picture's left side."""
    tools = [other for other in area.regions if other.type == "TOOLS" and other.width > 1 and other.x <= region.x]
    return float(max((other.x + other.width - region.x for other in tools), default=0))
