"""Panels that are drawn anew when something has changed of which Blender does not know."""

from __future__ import annotations

import bpy


def redraw_panels() -> None:
    """Have the panels of all windows drawn anew that may be the extension's."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in ("PROPERTIES", "VIEW_3D", "IMAGE_EDITOR"):
                for region in area.regions:
                    if region.type == "UI" or (region.type == "WINDOW" and area.type == "PROPERTIES"):
                        region.tag_redraw()
