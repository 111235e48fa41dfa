"""The panel of many views, for light-field displays and lenticular prints."""

from __future__ import annotations

import bpy

from ..stereo_reproject.blender.scene.rig import frame_region
from ..stereo_reproject.report.views_verdict import verdicts_on_views
from ..stereo_reproject.words import Words
from .drawing import BUTTON_SCALE, ICONS, draw_noted, paragraph
from .fitting import ICON_PX, draw_setting, first_that_fits
from .results import DeliveredViews, result_of
from .text import sentence, shown
from .views import RENDER_OT_stereo_reproject_views, views_obstacle
from .views_properties import OTHER, views_settings_of

SHOW_CONE = ("Show Cone in 3D View", "Show Cone in 3D", "Show Cone")
"""Texts of the button that draws the cone: the usual one, and shorter ones for narrow panels."""

FOCUS_PLANE = "What stands in the focus plane is in the plane of the display."


class Views:
    """Contents of the panel for many views."""

    bl_label = "Views"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the settings of the views, the button that renders them, what is in the way, and the last ones."""
        layout, scene = self.layout, context.scene
        self._draw_settings(layout, context)
        reason = views_obstacle(scene)
        if reason is None:
            paragraph(layout, context, quilt_words(scene))
        else:
            paragraph(layout, context, Words("{sentence}.", sentence=sentence(shown(reason))), icon="ERROR")
        column = layout.column(align=True)
        column.scale_y = BUTTON_SCALE
        # While a job runs it is greyed out, for progress stands at the top of the panel.
        column.operator(RENDER_OT_stereo_reproject_views.bl_idname, text="Render Quilt", icon="MESH_GRID")
        views = result_of(scene).views
        if views is not None:
            _draw_views(layout.box(), context, views)

    def _draw_settings(self, layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
        """Draw the settings of the views; the focus plane is the camera's own setting."""
        chosen, camera = context.scene.stereo_reproject.views, context.scene.camera
        column = layout.column()
        draw_setting(column, context, chosen, "display")
        draw_setting(column, context, chosen, "count")
        draw_setting(column, context, chosen, "spacing", expand=True)
        draw_setting(column, context, chosen, "cone" if chosen.spacing == "CONE" else "baseline")
        if camera is not None and camera.type == "CAMERA":
            draw_setting(column, context, camera.data.stereo, "convergence_distance", text="Focus Plane")
            paragraph(column, context, FOCUS_PLANE)
        if chosen.display == OTHER:
            grid = column.column(align=True)
            draw_setting(grid, context, chosen, "columns")
            draw_setting(grid, context, chosen, "rows")
        show = first_that_fits(context, SHOW_CONE, 1.0, ICON_PX)
        layout.prop(chosen, "show_cone", text=show, toggle=True, icon="VIEW3D")


def quilt_words(scene: bpy.types.Scene) -> Words:
    """Return in words the grid of the quilt that is chosen and the size of its views. Raises BadInputError."""
    views, region = views_settings_of(scene), frame_region(scene.render)
    width, height = views.view_size or (region.width, region.height)
    columns, rows = views.columns, views.rows
    message = "{columns} x {rows} views of {width} x {height} pixels."
    if columns is not None and rows is not None and columns * rows > views.count:
        message = "{columns} x {rows} places for {count} views of {width} x {height} pixels."
    return Words(message, columns=columns, rows=rows, count=views.count, width=width, height=height)


def _draw_views(box: bpy.types.UILayout, context: bpy.types.Context, views: DeliveredViews) -> None:
    """Draw the verdict on many views that were rendered, their warnings and their folder."""
    report = views.report
    paragraph(box, context, Words("Frame {frame}, {clock}:", frame=report["frame"], clock=views.clock))
    for verdict in verdicts_on_views(report):
        paragraph(box, context, Words("{sentence}.", sentence=verdict.words), icon=ICONS[verdict.good])
    draw_noted(box, context, report["warnings"])
    paragraph(box, context, str(views.folder), icon="FILE_FOLDER")
    box.operator("wm.path_open", text="Open Folder").filepath = str(views.folder)
