"""Planes and lines that are drawn in the 3D View, among the scene's objects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import blf
import bpy
import gpu
import numpy as np
from bpy_extras import view3d_utils
from gpu_extras.batch import batch_for_shader
from mathutils import Vector
from numpy.typing import NDArray

from .text import shown

Colour = tuple[float, float, float, float]

FILL_ALPHA = 0.12
"""Opacity of a plane, enough to tell what is before it from what is behind it."""

LINE_WIDTH_PX, LABEL_SIZE_PX, LABEL_OFFSET_PX = 1.5, 12.0, 4.0

OUTLINE = (0, 1), (1, 2), (2, 3), (3, 0)
"""Corners between which the lines of a plane's outline are."""


@dataclass(frozen=True)
class Plane:
    """A plane across the camera's view: its name, the places of its corners in the world (4, 3), and its colour.

    label_share is the place of its name along its upper edge, as a share from the left: through the camera, the edges
    of all planes lie in one line. fills_frame: True where it is filled through the camera too.
    """

    name: str
    corners: NDArray[np.float64]
    colour: Colour
    label_share: float
    fills_frame: bool = True


@contextmanager
def _among_objects() -> Iterator[None]:
    """Have what is drawn in a `with` block be translucent, and be hidden by what is before it."""
    before = gpu.state.blend_get(), gpu.state.depth_test_get()
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("LESS_EQUAL")
    try:
        yield
    finally:
        gpu.state.blend_set(before[0])
        gpu.state.depth_test_set(before[1])


def draw_planes(planes: Sequence[Plane]) -> None:
    """Draw planes among the objects of the 3D View that is being drawn: translucent, with an outline."""
    if not planes:
        return
    fill = gpu.shader.from_builtin("UNIFORM_COLOR")
    through_camera = bpy.context.region_data.view_perspective == "CAMERA"
    for plane in planes:
        if plane.fills_frame or not through_camera:
            with _among_objects():
                fill.uniform_float("color", (*plane.colour[:3], FILL_ALPHA))
                corners = [tuple(corner) for corner in plane.corners]
                batch_for_shader(fill, "TRIS", {"pos": corners}, indices=((0, 1, 2), (0, 2, 3))).draw(fill)
        draw_lines(plane.corners[np.array(OUTLINE)], plane.colour)


def draw_lines(ends: NDArray[np.float64], colour: Colour) -> None:
    """Draw lines among the objects of the 3D View that is being drawn; ends (N, 2, 3) are the places of their two ends
    in the world.
    """
    line, region = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR"), bpy.context.region
    with _among_objects():
        line.uniform_float("viewportSize", (region.width, region.height))
        line.uniform_float("lineWidth", LINE_WIDTH_PX * bpy.context.preferences.system.ui_scale)
        line.uniform_float("color", colour)
        places = [tuple(end) for end in ends.reshape(-1, 3)]
        batch_for_shader(line, "LINES", {"pos": places}).draw(line)


def draw_labels(planes: Sequence[Plane]) -> None:
    """Draw the planes' names over the 3D View that is being drawn, each at the upper edge of its plane."""
    region, scale = bpy.context.region, bpy.context.preferences.system.ui_scale
    for plane in planes:
        place = plane.corners[3] + plane.label_share * (plane.corners[2] - plane.corners[3])
        at = view3d_utils.location_3d_to_region_2d(region, bpy.context.region_data, Vector(place))
        if at is None:
            continue
        blf.size(0, LABEL_SIZE_PX * scale)
        blf.color(0, *plane.colour)
        blf.position(0, at.x, at.y + LABEL_OFFSET_PX * scale, 0.0)
        blf.draw(0, shown(plane.name))


def redraw_views(_settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Have all 3D Views drawn again, also those of other windows."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()
