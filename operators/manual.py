"""Right click > Online Manual on settings and buttons of the extension: the page and section that explain each.

The pages come with the extension, so that they are of its version and need no network.
"""

from __future__ import annotations

from pathlib import Path

import bpy

PAGES = Path(__file__).resolve().parents[1] / "docs"
"""Folder of the pages."""

SECTIONS = (
    ("bpy.types.stereoreprojectpreferences*", "artists.md#shortcuts-presets-and-preferences"),
    ("bpy.types.stereoreprojectviews*", "artists.md#views-for-light-field-displays"),
    ("bpy.types.stereoreprojectsettings.use_scripts", "troubleshooting.md#what-it-says"),
    ("bpy.types.stereoreprojectsettings.viewing_distance", "artists.md#depth"),
    ("bpy.types.stereoreprojectsettings.show_depth", "artists.md#depth"),
    ("bpy.types.stereoreprojectsettings*", "artists.md#what-to-set"),
    ("bpy.ops.stereo_reproject.set_convergence*", "artists.md#depth"),
    ("bpy.ops.stereo_reproject.fit*", "artists.md#depth"),
    ("bpy.ops.stereo_reproject.measure*", "artists.md#depth"),
    ("bpy.ops.stereo_reproject.set_screen*", "artists.md#depth"),
    ("bpy.ops.stereo_reproject.check_scene*", "artists.md#what-to-set"),
    ("bpy.ops.stereo_reproject.add_preset*", "artists.md#shortcuts-presets-and-preferences"),
    ("bpy.ops.stereo_reproject.cancel*", "artists.md#from-the-zip-to-a-first-preview"),
    ("bpy.ops.stereo_reproject.show_view*", "artists.md#looking-at-it-without-glasses"),
    ("bpy.ops.stereo_reproject.show_side*", "artists.md#looking-at-it-without-glasses"),
    ("bpy.ops.stereo_reproject.wiggle*", "artists.md#looking-at-it-without-glasses"),
    ("bpy.ops.stereo_reproject.export_wiggle*", "artists.md#looking-at-it-without-glasses"),
    ("bpy.ops.stereo_reproject*", "artists.md#the-result"),
    ("bpy.ops.render.stereo_reproject_image*", "artists.md#from-the-zip-to-a-first-preview"),
    ("bpy.ops.render.stereo_reproject_views*", "artists.md#views-for-light-field-displays"),
    ("bpy.ops.render.stereo_reproject*", "artists.md#the-result"),
)
"""Names of properties and operators, in small letters and with wildcards, each with its page and section. The first
that fits counts."""


def sections() -> tuple[str, tuple[tuple[str, str], ...]]:
    """Return the address of the pages, and the page and section of each name. Blender asks for them."""
    return f"{PAGES.as_uri()}/", SECTIONS


def add_manual() -> None:
    """Have Blender look up the extension's pages too."""
    bpy.utils.register_manual_map(sections)


def remove_manual() -> None:
    """Have Blender look up the extension's pages no more."""
    bpy.utils.unregister_manual_map(sections)
