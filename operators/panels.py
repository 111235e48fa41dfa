"""Panels in the Output properties beside Stereoscopy and in the 3D View's sidebar, and entries of the Render menu."""

from __future__ import annotations

from typing import Any

import bpy

from ..stereo_reproject.blender.engines.hole_camera import missing_osl_cameras
from ..stereo_reproject.blender.scene.rendered import CYCLES, EEVEE
from ..stereo_reproject.blender.scene.rig import check_camera
from ..stereo_reproject.errors import BadInputError
from ..stereo_reproject.report.verdict import duration
from ..stereo_reproject.words import Words
from .depth_panel import depth_warnings, draw_depth
from .details import Details, fill_words, made_by
from .drawing import draw_buttons, draw_noted, draw_outcome, paragraph
from .explained import EYES, draw_heading
from .fitting import draw_setting, fits
from .frames_shown import STEREO_REPROJECT_OT_look_at_frame
from .headset import STEREO_SETTINGS, is_for_headset, panorama_obstacle, stereo_settings_that_count
from .headset_panel import Headset, draw_comfort, draw_panorama
from .jobs import running
from .kept import STEREO_REPROJECT_OT_open_kept, kept_pair
from .prediction import gain_words, is_current
from .preferences import EXTENSION
from .preset_menu import STEREO_REPROJECT_PT_presets
from .render import (
    RENDER_OT_stereo_reproject_animation,
    RENDER_OT_stereo_reproject_image,
    STEREO_REPROJECT_OT_check_scene,
    fewer_samples_words,
    preview_size_words,
)
from .results import result_of
from .stereo import STEREO_REPROJECT_OT_set_convergence
from .text import sentence, shown
from .view_row import draw_modes_elsewhere
from .viewing import RENDER_OT_stereo_reproject_view_animation
from .views_panel import Views

MAX_SHOWN_EFFECTS = 6

DEPTH_WARNED = "As the camera is set now, the depth is not comfortable to look at: Stereo Camera, below, says why."

HEADER_PX = 40.0
"""Pixels in a panel's header, at a scale of 1, for its triangle and its menu of presets; its grip is in the margins."""


class _Main:
    """Contents of the main panel: render buttons, the settings that matter most, and the last result."""

    bl_label = "Stereo Pair"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        """Draw the menu of presets in the panel's header, unless it would cover the header's text."""
        if _header_has_room(context, self.bl_label):
            STEREO_REPROJECT_PT_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the render buttons, the accuracy and the rendered eye, what is in the way, the ways to look, and the
        last result, whose lines move nothing that is clicked again and again."""
        layout, scene = self.layout, context.scene
        chosen = scene.stereo_reproject
        draw_buttons(layout)
        column = layout.column()
        draw_setting(column, context, chosen, "accuracy")
        draw_setting(column, context, chosen, "source", expand=True)
        if not _header_has_room(context, _Main.bl_label):
            column.popover(STEREO_REPROJECT_PT_presets.__name__, text="Presets", icon="PRESET")
        draw_panorama(column, context)
        in_the_way = obstacle(scene)
        if in_the_way is not None:
            paragraph(layout, context, in_the_way, icon="ERROR")
        has_result = result_of(scene).delivery is not None
        if has_result:
            # Grey while a job runs, so that what is below stays where it is.
            draw_modes_elsewhere(layout, context)
        draw_outcome(layout, context)
        if has_result and running() is None and depth_warnings(scene):
            paragraph(layout, context, DEPTH_WARNED, icon="ERROR")


def _header_has_room(context: bpy.types.Context, label: str) -> bool:
    """Return whether the menu of presets fits beside the label in the header of a panel."""
    return fits(context, label, 1.0, HEADER_PX)


def obstacle(scene: bpy.types.Scene) -> str | None:
    """Return a sentence that says why the scene cannot be rendered with the chosen settings on this device; None where
    nothing is in the way.
    """
    chosen = scene.stereo_reproject
    engine = {"cycles": CYCLES, "eevee": EEVEE[0]}.get(chosen.source_engine, scene.render.engine)
    if engine != CYCLES and engine not in EEVEE:
        return "Only Cycles and EEVEE can be reprojected: choose one in Render properties."
    no_panorama = panorama_obstacle(scene, engine)
    if no_panorama is not None:
        return Words("{sentence}.", sentence=sentence(shown(no_panorama)))
    missing = missing_osl_cameras(scene)
    if chosen.fill in ("auto", "packed") and chosen.packed_by == "osl" and missing:
        return Words("Not possible here: {reason}.", reason=missing)
    return None


class _Engine:
    """Contents of the panel for the engine of the rendered eye, and for how missing pixels are rendered."""

    bl_label = "Engine and Holes"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the settings of engine and hole rendering."""
        layout, chosen = self.layout, context.scene.stereo_reproject
        for name in ("source_engine", "fill", *["packed_by"] * (chosen.fill in ("auto", "packed"))):
            draw_setting(layout, context, chosen, name)


class _Layout:
    """Contents of the panel for how the two views are stored in files: Blender's own settings."""

    bl_label = "Layout"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw Blender's own settings for how the two views are stored in files."""
        layout, settings = self.layout, context.scene.render.image_settings
        draw_setting(layout, context, settings, "views_format")
        if settings.views_format == "STEREO_3D":
            draw_setting(layout, context, settings.stereo_3d_format, "display_mode", text="Stereo Mode")


class _Camera:
    """Contents of the panel for the camera's stereo settings, and for how far the scene stands out of the screen."""

    bl_label = "Stereo Camera"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the camera's stereo settings and the scene's parallax; a note where the scene has no camera."""
        layout, scene = self.layout, context.scene
        try:
            stereo = check_camera(scene.camera).data.stereo
        except BadInputError as error:
            paragraph(layout, context, Words("{sentence}.", sentence=sentence(shown(error))), icon="ERROR")
            return
        for_headset = is_for_headset(scene)
        if not for_headset:
            draw_heading(layout, EYES)
        column, count = layout.column(align=True), stereo_settings_that_count(scene)
        for name, text in STEREO_SETTINGS.items():
            sub = column.column(align=True)
            sub.active = name in count
            draw_setting(sub, context, stereo, name, text=text)
        if for_headset:
            draw_comfort(layout, context)
            return
        column = layout.column(align=True)
        column.label(text="Set Convergence to:")
        row = column.row(align=True) if fits(context, "Active Object", 0.5) else column
        for target, name in (("OBJECT", "Active Object"), ("FOCUS", "Focus")):
            row.operator(STEREO_REPROJECT_OT_set_convergence.bl_idname, text=name).target = target
        draw_depth(layout.column(), context)


class _Check:
    """Contents of the panel for the check of a scene before it is rendered."""

    bl_label = "Before Rendering"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the button that checks the scene, and the findings of the last check."""
        layout, scene = self.layout, context.scene
        found = result_of(scene).inspection
        name = STEREO_REPROJECT_OT_check_scene.bl_idname
        layout.operator(name, text="Check Scene" if found is None else "Check Scene Again", icon="VIEWZOOM")
        if found is None:
            return
        size = " x ".join(map(str, found["size"]))
        paragraph(layout, context, Words("{how}:", how=made_by(found, size)))
        if not is_current(scene, found):
            paragraph(layout, context, "Something of this was changed since: check again.", icon="ERROR")
        self._draw_predicted(layout, context, found["predicted"])
        self._draw_effects(layout, context, found["effects"])
        draw_noted(layout, context, found["warnings"])

    def _draw_predicted(self, layout: bpy.types.UILayout, context: bpy.types.Context, predicted: Any) -> None:
        """Draw the predicted gain and seconds; `predicted` is the part of that name of a check's findings."""
        words = gain_words(predicted)
        icon = "INFO" if words.startswith("Predicted") else "ERROR"
        paragraph(layout, context, Words("{sentence}.", sentence=words), icon=icon)
        total = predicted["total_seconds"]
        if total is not None:
            low, high, fill = duration(total["low"]), duration(total["high"]), predicted["fill"]
            ours = low if low == high else Words("{low} to {high}", low=low, high=high)
            both = {"time": ours, "multiview": duration(predicted["multiview_seconds"])}
            paragraph(layout, context, Words("The pair will take {time}, multiview {multiview}.", **both))
            paragraph(layout, context, Words("{sentence}.", sentence=fill_words(fill)))

    def _draw_effects(self, layout: bpy.types.UILayout, context: bpy.types.Context, rows: Any) -> None:
        """Draw the effects that the scene calls for; `rows` is the part "effects" of a check's findings."""
        called = [row for row in rows if row["called_for"]]
        if not called:
            paragraph(layout, context, "It calls for nothing but colour and depth.")
            return
        paragraph(layout, context, "It calls for:")
        for row in called[:MAX_SHOWN_EFFECTS]:
            named = {"effect": Words(row["effect"].capitalize()), "item": row["by"][0], "count": len(row["by"]) - 1}
            message = "{effect}: {item} and {count} more" if named["count"] else "{effect}: {item}"
            paragraph(layout, context, Words(message, **named), icon="DOT")
        if len(called) > MAX_SHOWN_EFFECTS:
            paragraph(layout, context, Words("and {count} more effects", count=len(called) - MAX_SHOWN_EFFECTS))


class _Preview:
    """Contents of the panel for the size and samples of a preview, with its pixels."""

    bl_label = "Preview"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the settings of the preview's size and samples, the pixels that the whole frame will have, and the
        samples where they are fewer than asked for."""
        layout, scene = self.layout, context.scene
        chosen = scene.stereo_reproject
        draw_setting(layout, context, chosen, "preview_percentage")
        paragraph(layout, context, preview_size_words(scene))
        draw_setting(layout, context, chosen, "preview_samples")
        fewer = fewer_samples_words(scene)
        if fewer is not None:
            paragraph(layout, context, fewer)


class _Advanced:
    """Contents of the panel for settings that are seldom changed."""

    bl_label = "Advanced"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw settings of the screen, the warp, animations, the comparison and scripts."""
        layout, chosen = self.layout, context.scene.stereo_reproject
        for names in (
            ("screen_width", "eye_distance", "viewing_distance"),
            ("grid_threshold", "interpolation", "warp"),
            ("key_frame_distance", "compare", "use_scripts"),
        ):
            column = layout.column(align=True)
            for name in names:
                draw_setting(column, context, chosen, name)
        # In a script the extension may be there without being switched on.
        if EXTENSION in context.preferences.addons:
            layout.operator("preferences.addon_show", text="Preferences", icon="PREFERENCES").module = EXTENSION


def _panels(prefix: str, place: dict[str, Any]) -> tuple[type, ...]:
    """Return the panel classes for one place in Blender's window, the main panel first and then its sub-panels. prefix
    begins their class names; place has the attributes (bl_space_type and so on) that say where they are.
    """
    main = f"{prefix}_PT_stereo_reproject"
    parts = {
        "details": Details,
        "camera": _Camera,
        "headset": Headset,
        "views": Views,
        "check": _Check,
        "engine": _Engine,
        "layout": _Layout,
        "preview": _Preview,
        "advanced": _Advanced,
    }
    below = {"bl_parent_id": main, **place}
    return (
        type(main, (_Main, bpy.types.Panel), {**place, "bl_options": set()}),
        *(type(f"{main}_{name}", (part, bpy.types.Panel), dict(below)) for name, part in parts.items()),
    )


PANELS = (
    *_panels("RENDER", {"bl_space_type": "PROPERTIES", "bl_region_type": "WINDOW", "bl_context": "output"}),
    *_panels("VIEW3D", {"bl_space_type": "VIEW_3D", "bl_region_type": "UI", "bl_category": "Stereo"}),
)


def draw_menu(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """Add this extension's entries to Blender's Render menu."""
    menu.layout.separator()
    menu.layout.operator(RENDER_OT_stereo_reproject_image.bl_idname, icon="CAMERA_STEREO")
    menu.layout.operator(RENDER_OT_stereo_reproject_animation.bl_idname, icon="CAMERA_STEREO")
    menu.layout.operator(RENDER_OT_stereo_reproject_view_animation.bl_idname, icon="PLAY")
    menu.layout.operator(STEREO_REPROJECT_OT_look_at_frame.bl_idname, icon="CAMERA_STEREO")
    if kept_pair() is not None:
        menu.layout.operator(STEREO_REPROJECT_OT_open_kept.bl_idname, icon="CAMERA_STEREO")
