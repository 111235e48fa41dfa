"""Presets of the settings, by Blender's own menu of presets; four come with the extension."""

from __future__ import annotations

from pathlib import Path

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

FOLDER = "stereo_reproject"
"""Name of the folder below Blender's folders of presets in which ours are."""

OWN_PRESETS = str(Path(__file__).resolve().parent)
"""Folder whose folder `presets` has the presets that come with the extension."""

KEPT = (
    "accuracy",
    "source_engine",
    "fill",
    "packed_by",
    "headset",
    "headset_height",
    "preview_percentage",
    "preview_samples",
    "screen_width",
    "eye_distance",
    "viewing_distance",
)
"""Settings that a preset holds. Those that belong to a single shot, such as the rendered eye, are not among them."""


class STEREO_REPROJECT_PT_presets(PresetPanel, bpy.types.Panel):
    bl_label = "Stereo Presets"
    preset_subdir = FOLDER
    preset_operator = "script.execute_preset"
    preset_add_operator = "stereo_reproject.add_preset"


class STEREO_REPROJECT_OT_add_preset(AddPresetBase, bpy.types.Operator):
    """Add the present settings of stereo reprojection as a preset, or remove one"""

    bl_idname = "stereo_reproject.add_preset"
    bl_label = "Add Stereo Preset"
    preset_menu = STEREO_REPROJECT_PT_presets.__name__
    preset_subdir = FOLDER
    preset_defines = ("settings = bpy.context.scene.stereo_reproject",)
    preset_values = tuple(f"settings.{name}" for name in KEPT)


def add_own_presets() -> None:
    """Have Blender list the presets that come with the extension."""
    bpy.utils.register_preset_path(OWN_PRESETS)


def remove_own_presets() -> None:
    """Have Blender list the extension's own presets no more; those of the user stay."""
    bpy.utils.unregister_preset_path(OWN_PRESETS)
