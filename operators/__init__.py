"""The artist's surface: properties, operators, panels, and the command line within Blender."""

from __future__ import annotations

import atexit
from typing import Any

_commands: list[Any] = []


def _classes() -> tuple[type, ...]:
    """Return the classes to be registered, in the order that Blender needs: a property group before the panels and
    operators that use it.
    """
    from . import (
        depth,
        depth_view,
        explained,
        frames_shown,
        image_panels,
        jobs,
        kept,
        looking,
        multiview,
        panels,
        pictures,
        preferences,
        preset_menu,
        properties,
        render,
        screen_here,
        stereo,
        view_modes,
        viewing,
        views,
        views_properties,
        wiggle_export,
    )

    return (
        preferences.StereoReprojectPreferences,
        views_properties.StereoReprojectViews,
        properties.StereoReprojectSettings,
        jobs.STEREO_REPROJECT_OT_cancel,
        jobs.STEREO_REPROJECT_OT_listen,
        render.RENDER_OT_stereo_reproject_image,
        render.RENDER_OT_stereo_reproject_animation,
        views.RENDER_OT_stereo_reproject_views,
        render.STEREO_REPROJECT_OT_check_scene,
        viewing.RENDER_OT_stereo_reproject_view_animation,
        kept.STEREO_REPROJECT_OT_open_kept,
        stereo.STEREO_REPROJECT_OT_set_convergence,
        depth.STEREO_REPROJECT_OT_measure_depth,
        depth.STEREO_REPROJECT_OT_fit_to_comfort,
        screen_here.STEREO_REPROJECT_OT_set_screen_here,
        depth_view.STEREO_REPROJECT_GGT_screen,
        pictures.STEREO_REPROJECT_OT_show_picture,
        explained.STEREO_REPROJECT_OT_explain,
        preset_menu.STEREO_REPROJECT_OT_add_preset,
        preset_menu.STEREO_REPROJECT_PT_presets,
        view_modes.STEREO_REPROJECT_OT_show_view,
        view_modes.STEREO_REPROJECT_OT_wiggle,
        view_modes.STEREO_REPROJECT_OT_hear_escape,
        looking.STEREO_REPROJECT_OT_look,
        frames_shown.STEREO_REPROJECT_OT_look_at_frame,
        wiggle_export.STEREO_REPROJECT_OT_export_wiggle,
        multiview.STEREO_REPROJECT_OT_show_side,
        *panels.PANELS,
        *image_panels.IMAGE_PANELS,
    )


def _watchers() -> tuple[Any, ...]:
    """Return the modules that look after Blender while the extension is switched on, in the order in which they begin;
    each has `watch` and `unwatch`.
    """
    from . import frames_shown, looking, redraw, slots, view_modes

    return slots, view_modes, looking, frames_shown, redraw


def register() -> None:
    """Register the classes, settings, menu entries, shortcuts and command with Blender, which calls this when the
    extension is switched on.
    """
    import bpy

    from . import cone_view, depth_view, keys, manual, panels, preset_menu, properties
    from .command import COMMAND, run_command

    for cls in _classes():
        bpy.utils.register_class(cls)
    bpy.types.Scene.stereo_reproject = bpy.props.PointerProperty(type=properties.StereoReprojectSettings)
    bpy.types.TOPBAR_MT_render.append(panels.draw_menu)
    keys.add_shortcuts()
    depth_view.add_drawing()
    cone_view.add_drawing()
    manual.add_manual()
    preset_menu.add_own_presets()
    for module in _watchers():
        module.watch()
    atexit.register(_end)
    _commands.append(bpy.utils.register_cli_command(COMMAND, run_command))


def _end() -> None:
    """End the running job and remove all temporary files. It is called when the extension is switched off, and when
    Blender exits.
    """
    from . import jobs, results, second_blender

    try:
        jobs.stop_running()
    finally:
        second_blender.end_waiting()
        results.forget_all()


def unregister() -> None:
    """End the running job and undo `register`. Blender calls this when the extension is switched off."""
    import bpy

    from . import cone_view, depth_view, keys, manual, panels, preset_menu, screen_here

    while _commands:
        bpy.utils.unregister_cli_command(_commands.pop())
    _end()
    atexit.unregister(_end)
    preset_menu.remove_own_presets()
    manual.remove_manual()
    keys.remove_shortcuts()
    cone_view.remove_drawing()
    depth_view.remove_drawing()
    screen_here.put_away()
    for module in reversed(_watchers()):
        module.unwatch()
    bpy.types.TOPBAR_MT_render.remove(panels.draw_menu)
    del bpy.types.Scene.stereo_reproject
    for cls in reversed(_classes()):
        bpy.utils.unregister_class(cls)
