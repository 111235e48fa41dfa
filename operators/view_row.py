"""Buttons of the ways to look at a stereo pair, for the Image Editor's sidebar."""

from __future__ import annotations

import bpy

from .drawing import CHARACTER_WIDTH_PIXELS
from .multiview import draw_sides
from .view_modes import MODES, WIGGLE, STEREO_REPROJECT_OT_show_view, STEREO_REPROJECT_OT_wiggle, mode_of
from .wiggle_export import STEREO_REPROJECT_OT_export_wiggle

MAX_COLUMNS = 3
"""Buttons beside each other, at most: the six modes in two full rows."""

MARGIN_PIXELS, BUTTON_MARGIN_PIXELS = 42, 16
"""Pixels of a panel that no button has, and of a button that no letter has, at a scale of 1."""


def _columns(context: bpy.types.Context) -> int:
    """Return how many buttons fit beside each other without a name cut off."""
    scale = context.preferences.system.ui_scale
    width = context.region.width if context.region else 0
    longest = max(len(name) for name, _ in MODES.values())
    button = longest * CHARACTER_WIDTH_PIXELS + BUTTON_MARGIN_PIXELS
    return max(min(int((width / scale - MARGIN_PIXELS) // button), MAX_COLUMNS), 1)


def draw_view_modes(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw a button for each way to look at the pair, that of the present one pressed, the export of a wiggle, and
    where the pair was compared, buttons that flip between ours and multiview's.
    """
    column = layout.column(align=True)
    column.label(text="Look at It:")
    now = mode_of(context)
    grid = column.grid_flow(row_major=True, columns=_columns(context), even_columns=True, align=True)
    for mode, (name, _) in MODES.items():
        if mode == WIGGLE:
            grid.operator(STEREO_REPROJECT_OT_wiggle.bl_idname, text=name, depress=now == mode)
        else:
            grid.operator(STEREO_REPROJECT_OT_show_view.bl_idname, text=name, depress=now == mode).mode = mode
    draw_sides(column, context)
    column.operator(STEREO_REPROJECT_OT_export_wiggle.bl_idname, text="Export Wiggle...")
