"""Shortcuts of the extension: one list. Users change them in Preferences > Keymap, as all of Blender's own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import bpy

from .render import RENDER_OT_stereo_reproject_animation, RENDER_OT_stereo_reproject_image
from .viewing import RENDER_OT_stereo_reproject_view_animation

KEYMAP = "Screen"
"""Name of Blender's keymap that has its own keys for rendering; it counts wherever the mouse is."""


@dataclass(frozen=True)
class Shortcut:
    """A key with its modifiers, and the operator that it runs with these properties."""

    operator: str
    key: str
    modifiers: Mapping[str, bool]
    properties: Mapping[str, Any] = field(default_factory=dict)


SHORTCUTS = (
    # F12 is Blender's key for rendering, with Ctrl for animations. Ctrl Alt F12 is Blender's own too from 5.0 on, for
    # sequences, and on Linux it leaves the desktop for a text console.
    Shortcut(RENDER_OT_stereo_reproject_image.bl_idname, "F12", {"ctrl": True, "shift": True}),
    Shortcut(RENDER_OT_stereo_reproject_animation.bl_idname, "F12", {"ctrl": True, "shift": True, "alt": True}),
    Shortcut(RENDER_OT_stereo_reproject_view_animation.bl_idname, "F11", {"ctrl": True, "shift": True}),
    # Blender's own key for View Animation. Where Blender's player finds its files, that still plays.
    Shortcut(RENDER_OT_stereo_reproject_view_animation.bl_idname, "F11", {"ctrl": True}, {"unless_plain": True}),
)

_items: list[tuple[bpy.types.KeyMap, bpy.types.KeyMapItem]] = []


def add_shortcuts() -> None:
    """Bind the shortcuts in the keymap of add-ons, where users find them and Blender keeps their changes."""
    keys = bpy.context.window_manager.keyconfigs.addon
    if keys is None:
        # Some Blenders without a window have no keymaps.
        return
    keymap = keys.keymaps.new(name=KEYMAP, space_type="EMPTY")
    for shortcut in SHORTCUTS:
        item = keymap.keymap_items.new(shortcut.operator, type=shortcut.key, value="PRESS", **shortcut.modifiers)
        for name, value in shortcut.properties.items():
            setattr(item.properties, name, value)
        _items.append((keymap, item))


def remove_shortcuts() -> None:
    """Take back the shortcuts that `add_shortcuts` has bound."""
    while _items:
        keymap, item = _items.pop()
        keymap.keymap_items.remove(item)
