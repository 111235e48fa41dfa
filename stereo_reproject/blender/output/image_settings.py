"""A scene's output settings set to another format for a while, and then exactly as they were."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy

from ..engines.render import output_path, written_to
from ..scene.working import changed

FORMAT = ("media_type", "file_format", "color_mode", "color_depth", "exr_codec")
"""Settings of a file's format, in the order in which Blender takes them."""

SIDE_BY_SIDE = {"display_mode": "SIDEBYSIDE", "use_sidebyside_crosseyed": False, "use_squeezed_frame": False}

Values = dict[str, Any]


@contextmanager
def side_by_side_png(scene: bpy.types.Scene, path: Path) -> Iterator[None]:
    """Have the scene's output set to a PNG of 8 bits at `path`, with both views side by side in the scene's own
    colours, for the time of a `with` block; the settings are restored afterwards.
    """
    render, settings = scene.render, scene.render.image_settings
    files = written_to(render, output_path(path))
    with (
        format_kept(settings),
        changed(render, use_stamp=False, **files),
        changed(settings.stereo_3d_format, **SIDE_BY_SIDE),
    ):
        mode = "RGBA" if render.film_transparent else "RGB"
        png = {"media_type": "IMAGE", "file_format": "PNG", "color_mode": mode, "color_depth": "8"}
        set_changed(settings, {name: png[name] for name in FORMAT if name in png and hasattr(settings, name)})
        set_changed(settings, {"views_format": "STEREO_3D", "color_management": "FOLLOW_SCENE"})
        yield


@contextmanager
def linear_exr(scene: bpy.types.Scene, path: Path) -> Iterator[None]:
    """Have the scene's output set to an EXR of single precision at `path`, of one picture, scene-linear and with alpha,
    for the time of a `with` block; the settings are restored afterwards.
    """
    render, settings = scene.render, scene.render.image_settings
    with format_kept(settings), changed(render, use_stamp=False, **written_to(render, output_path(path))):
        exr = {"media_type": "IMAGE", "file_format": "OPEN_EXR", "color_mode": "RGBA", "color_depth": "32"}
        set_changed(settings, {name: exr[name] for name in FORMAT if name in exr and hasattr(settings, name)})
        set_changed(settings, {"color_management": "FOLLOW_SCENE"})
        yield


@contextmanager
def format_kept(settings: bpy.types.ImageFormatSettings) -> Iterator[None]:
    """Restore the format, the views format and the colour override of the output after a `with` block, whatever it
    changes of them, also after an error.
    """
    values = {name: getattr(settings, name) for name in FORMAT if hasattr(settings, name)}
    views = _views_format(settings)
    override = _override(settings) if settings.color_management == "OVERRIDE" else None
    try:
        yield
    finally:
        # Blender 5 sets views anew with the kind of media.
        set_changed(settings, {name: value for name, value in values.items() if name == "media_type"})
        if _views_format(settings) != views:
            _set_views_format(settings, views)
        set_changed(settings, values)
        if override is not None:
            _restore_override(settings, override)


def _set_views_format(settings: bpy.types.ImageFormatSettings, views: str) -> None:
    """Set how views are stored, where need be by way of a format that can: not every file format takes each value."""
    try:
        settings.views_format = views
    except TypeError:
        # Not every format takes all of them: this one does.
        if hasattr(settings, "media_type"):
            settings.media_type = "IMAGE"
        settings.file_format = "OPEN_EXR"
        settings.views_format = views


def _views_format(settings: bpy.types.ImageFormatSettings) -> str:
    """Return how views are stored. Where the present file format hides that, it is the value that the hidden setting
    must have.
    """
    hidden = "STEREO_3D" if settings.file_format == "OPEN_EXR_MULTILAYER" else "MULTIVIEW"
    return settings.views_format or hidden


# The override of the scene's colours: Blender replaces all of it by the scene's when it is switched on.


def _override(settings: bpy.types.ImageFormatSettings) -> tuple[list[Values], Values | None]:
    """Return the values of the output's own colour settings, to be restored by `_restore_override`: those of each of
    `_owners`, and those of the curves (None where there are none).
    """
    curves = settings.view_settings.curve_mapping
    return [values_of(owner) for owner in _owners(settings)], None if curves is None else _curves(curves)


def _owners(settings: bpy.types.ImageFormatSettings) -> list[Any]:
    """Return the three structs that hold the output's own colour settings."""
    return [settings.display_settings, settings.view_settings, settings.linear_colorspace_settings]


def values_of(owner: bpy.types.bpy_struct) -> Values:
    """Return the values of a struct's properties that can be set, by name, in an order in which they can be set
    again. A choice that this Blender does not know, which an old file may hold, has no value: it is left out.
    """
    settable = [prop for prop in owner.bl_rna.properties if not prop.is_readonly and prop.type != "POINTER"]
    settable.sort(key=lambda prop: prop.identifier != "view_transform")
    values = ((prop, getattr(owner, prop.identifier)) for prop in settable)
    return {
        prop.identifier: tuple(value) if getattr(prop, "is_array", False) else value
        for prop, value in values
        if prop.type != "ENUM" or value != ""
    }


def _curves(mapping: bpy.types.CurveMapping) -> Values:
    """Return the values of colour curves: their points, levels and options."""
    points = [[(tuple(p.location), p.handle_type) for p in curve.points] for curve in mapping.curves]
    levels = {"black_level": tuple(mapping.black_level), "white_level": tuple(mapping.white_level)}
    plain = ("tone", "extend", "use_clip", "clip_min_x", "clip_min_y", "clip_max_x", "clip_max_y")
    return {"points": points, **levels, **{name: getattr(mapping, name) for name in plain}}


def _restore_override(settings: bpy.types.ImageFormatSettings, override: tuple[list[Values], Values | None]) -> None:
    """Set the output's own colour settings to the values of `_override`. Blender replaces them by the scene's when they
    are switched on.
    """
    settings.color_management = "OVERRIDE"
    values, curves = override
    for owner, kept in zip(_owners(settings), values, strict=True):
        set_changed(owner, kept)
    view = settings.view_settings
    if curves is not None:
        # Those that are switched off are there too.
        used, view.use_curve_mapping = view.use_curve_mapping, True
        _restore_curves(view.curve_mapping, curves)
        view.use_curve_mapping = used


def set_changed(owner: bpy.types.bpy_struct, values: Values) -> None:
    """Set the properties that differ from these values, and only those: setting a format again may change others with
    it.
    """
    for name, value in values.items():
        now = getattr(owner, name)
        if (tuple(now) if isinstance(value, tuple) else now) != value:
            setattr(owner, name, value)


def _restore_curves(mapping: bpy.types.CurveMapping, curves: Values) -> None:
    """Set colour curves to the values of `_curves`."""
    for name, value in curves.items():
        if name != "points":
            setattr(mapping, name, value)
    for curve, points in zip(mapping.curves, curves["points"], strict=True):
        # Two points are the fewest that a curve has.
        while len(curve.points) > 2:
            curve.points.remove(curve.points[1])
        for (x, y), _ in points[2:]:
            curve.points.new(x, y)
    mapping.update()
    for curve, points in zip(mapping.curves, curves["points"], strict=True):
        for point, (location, handle_type) in zip(curve.points, points, strict=True):
            point.location, point.handle_type = location, handle_type
    mapping.update()


def copy_settings(scene: bpy.types.Scene, other: bpy.types.Scene) -> None:
    """Give the scene `other` the render settings and the view transform of `scene`, curves included."""
    for name in ("render", "display_settings", "view_settings"):
        set_changed(getattr(other, name), values_of(getattr(scene, name)))
    other.render.image_settings.compression = scene.render.image_settings.compression
    view, curves = other.view_settings, scene.view_settings.curve_mapping
    if view.use_curve_mapping and curves is not None:
        _restore_curves(view.curve_mapping, _curves(curves))


def writes_half_floats(scene: bpy.types.Scene) -> bool:
    """Return whether the scene's output is an EXR of half floats (16 bits)."""
    settings = scene.render.image_settings
    return settings.file_format in ("OPEN_EXR", "OPEN_EXR_MULTILAYER") and settings.color_depth == "16"


def format_values(scene: bpy.types.Scene) -> dict[str, Any]:
    """Return all that the scene's output settings say of how pictures are written, as values that JSON takes."""
    settings = scene.render.image_settings
    owners = {"image": settings, "stereo": settings.stereo_3d_format}
    if settings.color_management == "OVERRIDE":
        owners |= {f"colours {k}": owner for k, owner in enumerate(_owners(settings))}
    values = {name: values_of(owner) for name, owner in owners.items()}
    stamp = {name: value for name, value in values_of(scene.render).items() if "stamp" in name}
    return {**values, "extension": scene.render.use_file_extension, "stamp": stamp if scene.render.use_stamp else None}
