"""Settings of many views that an artist chooses on the scene, and what a job is given of them."""

from __future__ import annotations

import math

import bpy

from ..stereo_reproject.delivery.displays import DISPLAYS
from ..stereo_reproject.settings.views import (
    DEFAULT_CONE_DEGREES,
    DEFAULT_COUNT,
    MAX_CONE_DEGREES,
    MAX_COUNT,
    MIN_COUNT,
    ViewsSettings,
    views_settings,
)
from .plane_drawing import redraw_views

OTHER = "OTHER"
"""The choice of a display that is not in the list."""

USUAL_DISPLAY = "portrait"

LEAST_CONE_DEGREES = 0.1

DEGREE_DECIMALS = 3
"""Decimals of a cone in degrees: Blender keeps angles in radians, in single precision."""


MAKER = "Looking Glass "
"""Beginning of the titles of displays: in the list it is the heading above them, since all have it."""


def _displays() -> list[tuple[str, str, str]]:
    """Return the items of the setting that says for which display the views are."""
    items = [
        (OTHER, "Other", "Any display or print: set its views and its quilt, and the resolution in Output"),
        # Without a name of its own, an item is a heading.
        ("", MAKER.strip(), ""),
    ]
    for display in DISPLAYS.values():
        width, height = display.view_size()
        grid = f"{display.columns} x {display.rows} views of {width} x {height} pixels"
        what = f"{display.title}: {grid}, cone {display.cone_degrees:g}°"
        # A panel has no room for the maker's name.
        items.append((display.name, display.title.removeprefix(MAKER), what))
    return items


def _take_over(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Set number and cone of the views to those of the display that was chosen."""
    display = DISPLAYS.get(settings.display)
    if display is not None:
        settings.count, settings.spacing = display.count, "CONE"
        settings.cone = math.radians(display.cone_degrees)
    redraw_views(settings, context)


class StereoReprojectViews(bpy.types.PropertyGroup):
    """Settings of many views, kept with each scene. The focus plane is not here: it is the camera's convergence."""

    display: bpy.props.EnumProperty(
        name="Display",
        description="Display that the quilt is for. It sets number, cone, size and grid of the views",
        items=_displays(),
        default=USUAL_DISPLAY,
        update=_take_over,
    )
    count: bpy.props.IntProperty(
        name="Views",
        description="Number of views, from the leftmost camera to the rightmost",
        default=DEFAULT_COUNT,
        min=MIN_COUNT,
        max=MAX_COUNT,
        update=redraw_views,
    )
    spacing: bpy.props.EnumProperty(
        name="Width",
        description="What says how far the outermost cameras are apart",
        items=[
            ("CONE", "Cone", "The angle between them, seen from the middle of the focus plane"),
            ("BASELINE", "Baseline", "The distance between them"),
        ],
        update=redraw_views,
    )
    cone: bpy.props.FloatProperty(
        name="Cone",
        description="Angle between the outermost cameras, seen from the middle of the focus plane",
        subtype="ANGLE",
        default=math.radians(DEFAULT_CONE_DEGREES),
        min=math.radians(LEAST_CONE_DEGREES),
        max=math.radians(MAX_CONE_DEGREES - 1.0),
        soft_max=math.radians(90.0),
        update=redraw_views,
    )
    baseline: bpy.props.FloatProperty(
        name="Baseline",
        description="Distance between the outermost cameras",
        subtype="DISTANCE",
        default=0.5,
        min=1e-5,
        soft_max=10.0,
        update=redraw_views,
    )
    columns: bpy.props.IntProperty(
        name="Columns",
        description="Columns of the quilt, the picture that holds all views",
        default=DISPLAYS[USUAL_DISPLAY].columns,
        min=1,
        max=MAX_COUNT,
    )
    rows: bpy.props.IntProperty(
        name="Rows",
        description="Rows of the quilt. View 1 is at its lower left",
        default=DISPLAYS[USUAL_DISPLAY].rows,
        min=1,
        max=MAX_COUNT,
    )
    show_cone: bpy.props.BoolProperty(
        name="Show Cone in 3D View",
        description="Draw the line on which the cameras stand, what the outermost ones see, and the focus plane, in the"
        " 3D View",
        default=False,
        update=redraw_views,
    )


def views_settings_of(scene: bpy.types.Scene) -> ViewsSettings:
    """Return the settings of many views that are chosen in the scene's panel. Raises BadInputError."""
    chosen = scene.stereo_reproject.views
    by_cone, has_display = chosen.spacing == "CONE", chosen.display != OTHER
    return views_settings(
        display=chosen.display if has_display else None,
        count=chosen.count,
        cone_degrees=round(math.degrees(chosen.cone), DEGREE_DECIMALS) if by_cone else None,
        baseline=None if by_cone else chosen.baseline,
        quilt=None if has_display else (chosen.columns, chosen.rows),
    )
