"""Buttons of the ways to look at a stereo pair, for the Image Editor's sidebar."""

from __future__ import annotations

import bpy

from .fitting import TEXT_MARGINS_PX, fits
from .jobs import running
from .looking import STEREO_REPROJECT_OT_look, mode_elsewhere
from .multiview import draw_sides
from .view_modes import MODES, WIGGLE, STEREO_REPROJECT_OT_show_view, STEREO_REPROJECT_OT_wiggle, mode_of
from .wiggle_export import STEREO_REPROJECT_OT_export_wiggle

MAX_COLUMNS = 3
"""Buttons beside each other, at most: the six modes in two full rows."""


def _columns(context: bpy.types.Context) -> int:
    """Return how many buttons fit beside each other without a name cut off."""
    names = [name for name, _ in MODES.values()]
    counts = range(MAX_COLUMNS, 1, -1)
    return next((n for n in counts if all(fits(context, name, 1.0 / n, TEXT_MARGINS_PX) for name in names)), 1)


def draw_view_modes(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw a button for each way to look at the pair in this Image Editor, that of the present one pressed, the export
    of a wiggle, and where the pair was compared, buttons that flip between ours and multiview's.
    """
    column, grid = _begun(layout, context)
    now = mode_of(context)
    for mode, (name, _) in MODES.items():
        if mode == WIGGLE:
            grid.operator(STEREO_REPROJECT_OT_wiggle.bl_idname, text=name, depress=now == mode)
        else:
            grid.operator(STEREO_REPROJECT_OT_show_view.bl_idname, text=name, depress=now == mode).mode = mode
    draw_sides(column, context)
    column.operator(STEREO_REPROJECT_OT_export_wiggle.bl_idname, text="Export Wiggle")


def draw_modes_elsewhere(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw, in a panel of another editor, a button for each way to look at the pair in an Image Editor, that of the
    present one pressed, and the export of a wiggle; all are grey while a job runs.
    """
    column, grid = _begun(layout, context)
    now = mode_elsewhere()
    for mode, (name, _) in MODES.items():
        grid.operator(STEREO_REPROJECT_OT_look.bl_idname, text=name, depress=now == mode).mode = mode
    row = column.row(align=True)
    row.enabled = running() is None
    row.operator(STEREO_REPROJECT_OT_export_wiggle.bl_idname, text="Export Wiggle")


def _begun(layout: bpy.types.UILayout, context: bpy.types.Context) -> tuple[bpy.types.UILayout, bpy.types.UILayout]:
    """Draw the heading of the buttons; return the column below it, and the grid in it for the buttons."""
    column = layout.column(align=True)
    column.label(text="Look at It:")
    return column, column.grid_flow(row_major=True, columns=_columns(context), even_columns=True, align=True)
