"""Widths of texts and of the room that they have, and settings that are drawn so that their names are not cut off."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import blf
import bpy

from ..stereo_reproject.report.lines import wrapped
from .text import shown

INTERFACE_FONT = 0
"""Number, for `blf`, of the font that Blender draws its interface with."""

MARGINS_PX = 70.0
"""Pixels of a region's width, at a scale of 1, that a line of text in a box does not have: for the panel's tabs and the
margins of panel, box and text, as seen in Blender 5.2 (tests/gui/drive_widths.py)."""

TEXT_MARGINS_PX = 16.0
"""Pixels to the left and right of a label's text, together, at a scale of 1."""

ICON_PX = 24.0
"""Pixels that an icon before a text takes at a scale of 1: Blender's unit of its interface, 20, and a gap."""

USUAL_WIDTH_PX = 300.0
"""Pixels that a panel is taken to be wide where there is no region."""

NAME_SHARE = 0.4
"""Share of a row that Blender gives the name of a setting beside its value."""


def room_for_text(context: bpy.types.Context) -> float:
    """Return the pixels that a line of text has in the context's region."""
    width = context.region.width if context.region else USUAL_WIDTH_PX
    return width - MARGINS_PX * context.preferences.system.ui_scale


def text_width(context: bpy.types.Context, text: str) -> float:
    """Return the pixels that a text takes in Blender's interface font."""
    points = context.preferences.ui_styles[0].widget.points
    blf.size(INTERFACE_FONT, points * context.preferences.system.ui_scale)
    return blf.dimensions(INTERFACE_FONT, text)[0]


def fits(context: bpy.types.Context, text: str, share: float, more_px: float = TEXT_MARGINS_PX) -> bool:
    """Return whether a text fits into a share, 0 to 1, of a row in the context's region. more_px are the pixels that it
    takes besides, at a scale of 1, for margins or an icon.
    """
    more = more_px * context.preferences.system.ui_scale
    return text_width(context, shown(text)) + more <= share * room_for_text(context)


def first_that_fits(context: bpy.types.Context, texts: Sequence[str], share: float, more_px: float) -> str:
    """Return the first of some texts that fits into a share of a row, or else the last; parameters as for `fits`."""
    return next((text for text in texts if fits(context, text, share, more_px)), texts[-1])


def draw_setting(
    layout: bpy.types.UILayout,
    context: bpy.types.Context,
    owner: bpy.types.bpy_struct,
    name: str,
    *,
    text: str | None = None,
    expand: bool = False,
) -> None:
    """Draw the property `name` of `owner` with its name, or text, beside it; where that would be cut off, above it.
    expand is as for `UILayout.prop`.
    """
    title = owner.bl_rna.properties[name].name if text is None else text
    above = not fits(context, title, NAME_SHARE)
    if owner.bl_rna.properties[name].type == "BOOLEAN":
        # The name of a checkbox stands in the other part, and goes on to the panel's end.
        above = not fits(context, title, 1.0 - NAME_SHARE, 2.0 * TEXT_MARGINS_PX)
        if above:
            _draw_wide_checkbox(layout, context, owner, name, title)
            return
    column = layout.column(align=True)
    column.use_property_decorate = False
    column.use_property_split = not above
    if above:
        for line in wrapped(shown(title), room_for_text(context), partial(text_width, context)):
            column.label(text=line)
    column.row(align=True).prop(owner, name, text="" if above and not expand else title, expand=expand)


def _draw_wide_checkbox(
    layout: bpy.types.UILayout, context: bpy.types.Context, owner: bpy.types.bpy_struct, name: str, title: str
) -> None:
    """Draw a checkbox at the panel's left border, with its title beside it in as many lines as it needs."""
    row = layout.row(align=True)
    row.use_property_decorate = row.use_property_split = False
    row.prop(owner, name, text="")
    lines = row.column(align=True)
    room = room_for_text(context) - ICON_PX * context.preferences.system.ui_scale
    for line in wrapped(shown(title), room, partial(text_width, context)):
        lines.label(text=line)
