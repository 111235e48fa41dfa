"""Buttons of the ways to look at a stereo pair, for the Image Editor's sidebar."""

from __future__ import annotations

import bpy

from .multiview import draw_sides
from .view_modes import MODES, WIGGLE, STEREO_REPROJECT_OT_show_view, STEREO_REPROJECT_OT_wiggle, mode_of
from .wiggle_export import STEREO_REPROJECT_OT_export_wiggle


def draw_view_modes(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw a button for each way to look at the pair, that of the present one pressed, the export of a wiggle, and
    where the pair was compared, buttons that flip between ours and multiview's.
    """
    column = layout.column(align=True)
    column.label(text="Look at It:")
    now = mode_of(context)
    grid = column.grid_flow(row_major=True, columns=0, even_columns=True, align=True)
    for mode, (name, _) in MODES.items():
        if mode == WIGGLE:
            grid.operator(STEREO_REPROJECT_OT_wiggle.bl_idname, text=name, depress=now == mode)
        else:
            grid.operator(STEREO_REPROJECT_OT_show_view.bl_idname, text=name, depress=now == mode).mode = mode
    draw_sides(column, context)
    column.operator(STEREO_REPROJECT_OT_export_wiggle.bl_idname, text="Export Wiggle...")
