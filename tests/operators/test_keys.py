"""Shortcuts: bound where users can change them, gone with the extension, and taken from none of Blender's own."""

import importlib
import sys
from pathlib import Path

import bpy
import pytest

MODIFIERS = ("ctrl", "shift", "alt", "oskey")

PLACES_OF_ALL_EDITORS = {"Window", "Screen", "Screen Editing"}
"""Blender's keymaps that count wherever the mouse is, as ours does."""


def bound():
    """The extension's keymap items, by operator."""
    keymaps = bpy.context.window_manager.keyconfigs.addon.keymaps
    return {
        item.idname: item for keymap in keymaps for item in keymap.keymap_items if "stereo_reproject" in item.idname
    }


def blender_s_own(keymap_data):
    """The items of a keymap that comes with Blender: key with its modifiers, and operator."""
    folders = [Path(folder) / "presets" / "keyconfig" for folder in bpy.utils.script_paths()]
    sys.path.extend(map(str, folders))
    data = importlib.import_module(f"keymap_data.{keymap_data}")
    keymaps = data.generate_keymaps(data.Params())
    for name, _, content in keymaps:
        if name in PLACES_OF_ALL_EDITORS:
            for operator, event, *_ in content["items"]:
                held = tuple(bool(event.get(modifier)) or bool(event.get("any")) for modifier in MODIFIERS)
                yield (event["type"], *held), operator


def combination(item):
    return item.type, *(bool(getattr(item, modifier)) for modifier in MODIFIERS)


def test_shortcuts_are_bound_and_gone_with_the_extension(package):
    package.register()
    assert set(bound()) == {
        "render.stereo_reproject_image",
        "render.stereo_reproject_animation",
        "render.stereo_reproject_view_animation",
    }
    package.unregister()
    assert bound() == {}


def test_what_blender_has_bound_is_found():
    own = dict(blender_s_own("blender_default"))
    assert own["F12", False, False, False, False] == "render.render"
    assert ("F12", True, False, True, False) in own or bpy.app.version < (5, 0)


@pytest.mark.parametrize("keymap_data", ["blender_default", "industry_compatible_data"])
def test_no_key_of_blender_s_own_is_taken_for_rendering(extension, keymap_data):
    own = dict(blender_s_own(keymap_data))
    assert "screen.screen_full_area" in own.values()
    for name in ("render.stereo_reproject_image", "render.stereo_reproject_animation"):
        assert combination(bound()[name]) not in own


def test_the_shortcut_of_a_picture_renders_no_preview(extension):
    """Only so is the key shown beside the menu's entry."""
    assert not bound()["render.stereo_reproject_image"].properties.is_property_set("preview")
