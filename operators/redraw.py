"""Panels that are drawn anew when something has changed of which Blender does not know."""

from __future__ import annotations

from typing import Any

import bpy

_owner = object()
"""Owner of the subscriptions, by which Blender finds them again."""


def redraw_panels() -> None:
    """Have the panels of all windows drawn anew that may be the extension's."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in ("PROPERTIES", "VIEW_3D", "IMAGE_EDITOR"):
                for region in area.regions:
                    if region.type == "UI" or (region.type == "WINDOW" and area.type == "PROPERTIES"):
                        region.tag_redraw()


@bpy.app.handlers.persistent
def _listen(*_: Any) -> None:
    """Have panels drawn anew whenever a render setting is changed: they tell sizes in pixels, and Blender draws those
    in other editors anew only under the mouse. Blender calls this after a file was loaded, which ends subscriptions.
    """
    bpy.msgbus.clear_by_owner(_owner)
    bpy.msgbus.subscribe_rna(key=bpy.types.RenderSettings, owner=_owner, args=(), notify=redraw_panels)


def watch() -> None:
    """Begin to look after render settings. Called when the extension is switched on."""
    _listen()
    bpy.app.handlers.load_post.append(_listen)


def unwatch() -> None:
    """Undo `watch`. Called when the extension is switched off."""
    bpy.msgbus.clear_by_owner(_owner)
    if _listen in bpy.app.handlers.load_post:
        bpy.app.handlers.load_post.remove(_listen)
