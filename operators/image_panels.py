"""Panels in the Image Editor's sidebar: render buttons, the last pair's verdict, and the pictures that explain it."""

from __future__ import annotations

import bpy

from .depth_panel import draw_warnings
from .details import Details
from .drawing import draw_buttons, draw_outcome
from .fitting import fits
from .jobs import running
from .pictures import NAME, STEREO_REPROJECT_OT_show_picture
from .results import OF_PANORAMAS, PICTURES, Result, result_of
from .view_row import draw_view_modes


class IMAGE_PT_stereo_reproject(bpy.types.Panel):
    bl_label = "Stereo Pair"
    bl_space_type = "IMAGE_EDITOR"
    bl_region_type = "UI"
    bl_category = "Stereo"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the panel: the render buttons, those of the ways to look, the last result, and buttons that show its
        pictures. The result's lines are below the ways to look, so that no click moves these."""
        draw_buttons(self.layout)
        draw_view_modes(self.layout, context)
        draw_outcome(self.layout, context)
        result = result_of(context.scene)
        if result.delivery is not None and running() is None:
            draw_warnings(self.layout, context)
        if result.report is not None and running() is None:
            self._draw_pictures(context, result)

    def _draw_pictures(self, context: bpy.types.Context, result: Result) -> None:
        """Draw a button for the pair and one for each picture that explains it, that of the one that is shown pressed;
        those of missing pictures are grey, and what only panoramas have is left out of others.
        """
        column = self.layout.column(align=True)
        name = STEREO_REPROJECT_OT_show_picture.bl_idname
        image = context.space_data.image
        is_pair = image is not None and image.type == "RENDER_RESULT"
        column.operator(name, text="Render Result", icon="CAMERA_STEREO", depress=is_pair).which = "PAIR"
        pictures = {
            which: text
            for which, (_, text, _) in PICTURES.items()
            if which != OF_PANORAMAS or result.picture(which) is not None
        }
        beside = all(fits(context, text, 0.5) for text in pictures.values())
        grid = column.grid_flow(columns=2 if beside else 1, even_columns=True, align=True)
        for which, text in pictures.items():
            is_shown = image is not None and image.name == NAME.format(text)
            row = grid.row(align=True)
            row.enabled = result.picture(which) is not None
            row.operator(name, text=text, depress=is_shown).which = which


class IMAGE_PT_stereo_reproject_details(Details, bpy.types.Panel):
    bl_space_type = "IMAGE_EDITOR"
    bl_region_type = "UI"
    bl_category = "Stereo"
    bl_parent_id = "IMAGE_PT_stereo_reproject"


IMAGE_PANELS = (IMAGE_PT_stereo_reproject, IMAGE_PT_stereo_reproject_details)
