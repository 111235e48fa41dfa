"""Text beside the mouse, in a 3D View or an Image Editor, as Blender's own eyedroppers have it."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from .strip import MARGIN_PX, draw_strip, strip_height_px, text_width_px

OFFSET_PX = 20.0
"""Pixels between the mouse and the text, at a scale of 1: the mouse's own picture is not covered."""

SPACES = (bpy.types.SpaceView3D, bpy.types.SpaceImageEditor)


@dataclass(frozen=True)
class _Shown:
    """The text that is shown: the address of its region, the mouse's place there in pixels, and the text itself."""

    region: int
    at: tuple[float, float]
    text: str


_shown: list[_Shown] = []
"""The text that is shown, if any."""

_handlers: list[tuple[type, object]] = []


def show_at_mouse(region: bpy.types.Region, at: tuple[float, float], text: str) -> None:
    """Show a text beside this place of a region, in pixels, in place of the one before, until `remove_text`."""
    if not _handlers:
        _handlers.extend((space, space.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL")) for space in SPACES)
    hide_text()
    _shown.append(_Shown(region.as_pointer(), at, text))
    region.tag_redraw()


def hide_text() -> None:
    """Show no text until `show_at_mouse` is called again; do nothing where none is shown."""
    while _shown:
        gone = _shown.pop()
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                for region in area.regions:
                    if region.as_pointer() == gone.region:
                        region.tag_redraw()


def remove_text() -> None:
    """Take the text away; do nothing where there is none."""
    hide_text()
    while _handlers:
        space, handler = _handlers.pop()
        space.draw_handler_remove(handler, "WINDOW")


def _draw() -> None:
    """Draw the text in the region that it is for, and within it. Blender calls this for every 3D View and Image
    Editor.
    """
    region = bpy.context.region
    if not _shown or region is None or region.as_pointer() != _shown[0].region:
        return
    shown, scale = _shown[0], bpy.context.preferences.system.ui_scale
    width = text_width_px(shown.text, scale) + 2.0 * MARGIN_PX * scale
    left, bottom = shown.at[0] + OFFSET_PX * scale, shown.at[1] - OFFSET_PX * scale - strip_height_px(scale)
    if left + width > region.width:
        left = shown.at[0] - OFFSET_PX * scale - width
    # Below the mouse first: headers lie over the upper edge.
    if bottom < 0.0:
        bottom = shown.at[1] + OFFSET_PX * scale
    draw_strip((left, bottom), width, left + MARGIN_PX * scale, [shown.text], scale)
