"""The portal's nodes for panoramas: the place in the packed picture that a ray comes from, and the eye's ray of it.

All is in the sheet's space. What a table has of a ray, and how an eye's ray is made of it, is said in ray_table.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from .portal_geometry import CAMERA_FROM_PANORAMAS_SHEET, SheetRays
from .ray_table import TEXELS, SharedRays
from .shader_graph import Graph, Socket, Value

AHEAD: tuple[float, float, float] = tuple(map(float, -CAMERA_FROM_PANORAMAS_SHEET[2]))  # pyright: ignore[reportAssignmentType] - a row has three
"""Direction straight ahead of a panorama's packed camera, in the sheet's space."""


@dataclass(frozen=True)
class PanoramaRays:
    """Rays of panoramas from the sheet on. lens is the radius of the views' aperture over that of the packed camera, 0
    without depth of field. may_meet_sheet: True where a ray that was sent on may meet the sheet again."""

    shared: SharedRays
    lens: float
    may_meet_sheet: bool

    @property
    def nodes(self) -> str:
        """Name of the nodes that these rays take."""
        rays = self.shared
        asked = (rays.poles is not None and rays.poles[0] < rays.poles[1], rays.poles is None, rays.in_stereo)
        return f"{self.lens > 0.0} {self.may_meet_sheet} {rays.is_unit} {rays.by_plane} {rays.has_edge} {asked}"


def panorama_picture(graph: Graph, sheet: SheetRays) -> tuple[Socket, Socket]:
    """Return the place of a ray in the packed picture of a panorama, in pixels from its lower left corner, and its
    place on the packed camera's aperture, in scene units.

    The packed camera is equirectangular, and focused on what is endlessly far: its ray's direction has the place in the
    picture, and the aperture is across it.
    """
    geometry = graph.node("ShaderNodeNewGeometry")
    back = graph.transformed(geometry.outputs["Incoming"], "VECTOR", "WORLD", "OBJECT")
    ahead = graph.vector("NORMALIZE", graph.scaled(back, -1.0))
    met = graph.transformed(geometry.outputs["Position"], "POINT", "WORLD", "OBJECT")
    turned = graph.math("ARCTAN2", graph.part(ahead, 0), graph.math("MULTIPLY", graph.part(ahead, 2), -1.0))
    angles = graph.node("ShaderNodeCombineXYZ")
    graph.put(turned, angles.inputs[0])
    graph.put(graph.math("ARCSINE", graph.part(ahead, 1)), angles.inputs[1])
    middle = (0.5 * sheet.size[0], 0.5 * sheet.size[1], 0.0)
    per_pixel = (1.0 / sheet.step[0], 1.0 / sheet.step[1], 0.0)
    raster = graph.vector("MULTIPLY_ADD", angles.outputs[0], per_pixel, middle)
    offset = graph.vector("SUBTRACT", met, graph.vector("PROJECT", met, ahead))
    along, beside = _aperture(graph, AHEAD, ahead)
    on_lens = graph.node("ShaderNodeCombineXYZ")
    graph.put(graph.number("DOT_PRODUCT", offset, along), on_lens.inputs[0])
    graph.put(graph.number("DOT_PRODUCT", offset, beside), on_lens.inputs[1])
    return raster, on_lens.outputs[0]


def _aperture(graph: Graph, axis: Value, ahead: Socket) -> tuple[Socket, Socket]:
    """Return the axes of the aperture across a ray in this direction. axis is straight ahead of the panorama."""
    along = graph.vector("NORMALIZE", graph.vector("SUBTRACT", axis, graph.vector("PROJECT", axis, ahead)))
    return along, graph.vector("CROSS_PRODUCT", ahead, along)


def panorama_ray(
    graph: Graph, sheet: SheetRays, views: PanoramaRays, raster: Socket, on_lens: Socket, table: Path
) -> tuple[Socket, Socket, Socket]:
    """Return whether there is a pixel at a place in the packed picture, where its ray begins, and the ray's direction.
    on_lens is its place on the packed camera's aperture.
    """
    rays = views.shared
    shown, looking, (origin, offset) = _look_up(graph, sheet, raster, table, has_edge=rays.has_edge)
    near: Value = rays.near_clip
    if rays.by_plane:
        near = graph.math("MULTIPLY", graph.number("LENGTH", looking), near)
    if rays.is_unit:
        looking = graph.vector("NORMALIZE", looking)
    if views.lens > 0.0:
        along, beside = _aperture(graph, rays.ahead, looking)
        on_lens = graph.scaled(on_lens, views.lens)
        moved = graph.combined(along, graph.part(on_lens, 0), beside, graph.part(on_lens, 1))
        looking = graph.vector("NORMALIZE", graph.vector("SUBTRACT", graph.scaled(looking, rays.focus), moved))
        origin = graph.vector("ADD", origin, moved)
    if rays.in_stereo:
        aside = _to_eye(graph, rays, looking, offset)
        origin = graph.vector("ADD", origin, aside)
        looking = graph.vector("SUBTRACT", looking, graph.scaled(aside, rays.per_convergence))
    return shown, graph.vector("ADD", origin, graph.scaled(graph.vector("NORMALIZE", looking), near)), looking


def _look_up(
    graph: Graph, sheet: SheetRays, raster: Socket, table: Path, *, has_edge: bool
) -> tuple[Socket, Socket, tuple[Socket, Socket]]:
    """Return whether a pixel's ray is shown, the direction in which the camera alone would look, and the camera's place
    with how far the eye is to the right of it."""
    width, height = sheet.size
    corner, part = graph.vector("FLOOR", raster), graph.vector("FRACTION", raster)
    texels = []
    for number in range(TEXELS):
        middle = ((number + 0.5) / (TEXELS * width), 0.5 / height, 0.0)
        texel = graph.vector("MULTIPLY_ADD", corner, (1.0 / width, 1.0 / height, 0.0), middle)
        texels.append(graph.texture_and_alpha(table, texel))
    camera, (ahead, within), (to_right, within_right), (to_down, within_down) = texels
    half = -0.5 * sheet.widening
    place = graph.vector("MULTIPLY_ADD", part, (sheet.widening, sheet.widening, 0.0), (half, half, 0.0))
    right, down = graph.part(place, 0), graph.math("MULTIPLY", graph.part(place, 1), -1.0)
    looking = graph.vector("ADD", ahead, graph.combined(to_right, right, to_down, down))
    shown = graph.math("GREATER_THAN", graph.number("LENGTH", ahead), 0.0)
    if has_edge:
        inside = graph.math("MULTIPLY_ADD", within_right, right, within)
        inside = graph.math("MULTIPLY_ADD", within_down, down, inside)
        shown = graph.math("MULTIPLY", shown, graph.math("GREATER_THAN", inside, 0.0))
    return shown, looking, camera


def _to_eye(graph: Graph, rays: SharedRays, looking: Socket, offset: Socket) -> Socket:
    """Return the way from the camera to the eye for a direction in which the camera looks."""
    if rays.poles is not None:
        begin, end = rays.poles
        altitude = graph.math("ABSOLUTE", graph.math("ARCSINE", graph.number("DOT_PRODUCT", looking, rays.up)))
        if begin < end:
            per_radian = 1.0 / (end - begin)
            faded = graph.math("MULTIPLY_ADD", altitude, per_radian, -begin * per_radian)
            faded = graph.math("MINIMUM", graph.math("MAXIMUM", faded, 0.0), 1.0)
            share = graph.math("COSINE", graph.math("MULTIPLY", faded, 0.5 * math.pi))
        else:
            share = graph.math("SUBTRACT", 1.0, graph.math("GREATER_THAN", altitude, end))
        offset = graph.math("MULTIPLY", offset, share)
    side = graph.vector("NORMALIZE", graph.vector("CROSS_PRODUCT", looking, rays.up))
    return graph.scaled(side, offset)
