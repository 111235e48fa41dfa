"""The material of the portal camera's sheet: nodes that turn a ray of the packed picture into a ray of a view.

A ray meets the sheet; a table says which pixel of which view its place in the packed picture stands for; and a Ray
Portal BSDF sends it on as that pixel's ray. All of it is worked out in the sheet's own space, which is the rendered
view's camera space, also while camera and sheet move with the shutter open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy

from .portal_geometry import SheetRays
from .portal_panorama import PanoramaRays, panorama_picture, panorama_ray
from .shader_graph import Graph, Socket, Value

VIEW_ROWS = 5
"""Rows of the views' table, for several views. They hold, for each view, in the sheet's space: one of its pixels to the
right, one upwards and one unit of depth ahead (three numbers each); its place (three); and the depth in focus and how
many pixels are one unit to the right and upwards."""

KIND = "stereo_reproject_kind"
"""Property of the sheet's material that tells for which kind of rays it was made."""


@dataclass(frozen=True)
class ViewRays:
    """Rays of views from the sheet on, in the sheet's space and scene units.

    step is a pixel's width and height on the rendered view's plane, and focus the depth at which it is in focus. lens
    is the radius of the views' aperture over that of the packed camera, 0 without depth of field. near_clip is the
    depth at which rays begin. count is the number of views.
    """

    step: tuple[float, float]
    focus: float
    lens: float
    near_clip: float
    count: int

    @property
    def nodes(self) -> str:
        """Name of the nodes that these rays take."""
        return f"{self.lens > 0.0} {self.count > 1}"

    @property
    def may_meet_sheet(self) -> bool:
        """True where a ray that was sent on may meet the sheet again."""
        return self.count > 1


def build_material(
    material: bpy.types.Material, sheet: SheetRays, views: ViewRays | PanoramaRays, tables: Sequence[Path]
) -> None:
    """Make the material of the sheet, or set it anew. tables are the files of the pixels' table and, for several planar
    views, of the views' table.

    Where the material has nodes for rays of this kind already, only their values are set: where nodes come or go,
    Blender works out anew what depends on what, and Cycles syncs all objects again.

    An entry of the pixels' table of planar views has the place of the lower left corner of what the pixel's filter
    covers, on its view's plane, x to the right and y upwards, in pixels from where the view looks straight ahead; and
    the number of its view, -1 where there is no pixel. One of panoramas is TEXELS wide, as ray_table.py says.
    """
    kind = f"{sheet.kind} {views.nodes}"
    known = material.get(KIND) == kind
    if not known:
        remove_nodes(material)
    material[KIND] = kind
    graph = Graph(material.node_tree, known=known)
    if isinstance(views, PanoramaRays):
        raster, on_lens = (panorama_picture if sheet.kind == "PANO" else _place_in_picture)(graph, sheet)
        shown, begins, direction = panorama_ray(graph, sheet, views, raster, on_lens, tables[0])
    else:
        shown, begins, direction = _planar_ray(graph, sheet, views, tables)
    portal = graph.node("ShaderNodeBsdfRayPortal")
    # Where the table has no pixel, the ray ends.
    graph.put(shown, portal.inputs["Color"])
    graph.put(graph.transformed(begins, "POINT", "OBJECT", "WORLD"), portal.inputs["Position"])
    # Blender 4.5 takes the direction as long as it is.
    direction = graph.vector("NORMALIZE", graph.transformed(direction, "VECTOR", "OBJECT", "WORLD"))
    graph.put(direction, portal.inputs["Direction"])
    surface = _first_surface_alone(graph, portal.outputs[0]) if views.may_meet_sheet else portal.outputs[0]
    graph.put(surface, graph.node("ShaderNodeOutputMaterial").inputs["Surface"])


def _planar_ray(
    graph: Graph, sheet: SheetRays, views: ViewRays, tables: Sequence[Path]
) -> tuple[Socket, Socket, Socket]:
    """Return whether there is a pixel, where its ray begins, and the ray's direction, in the sheet's space."""
    raster, on_lens = _place_in_picture(graph, sheet)
    entry, place = _look_up(graph, sheet, raster, tables[0])
    number = graph.part(entry, 2)
    if views.count == 1:
        view = _View((*views.step, 0.0), None, (0.0, 0.0, -1.0), None, views.focus, None)
    else:
        view = _view_of_table(graph, views, number, tables[1])
    shoot = _orthographic_ray if sheet.kind == "ORTHO" else _perspective_ray
    return (graph.math("GREATER_THAN", number, -0.5), *shoot(graph, views, view, place, on_lens))


def _place_in_picture(graph: Graph, sheet: SheetRays) -> tuple[Socket, Socket]:
    """Return the place of a ray in the packed picture, in pixels from its lower left corner, and its place on the
    packed camera's aperture, in scene units.

    A perspective camera that is focused on what is endlessly far has the one in the ray's direction and the other in
    the place where the ray meets the sheet; an orthographic one that is focused on the sheet has it the other way
    round.
    """
    geometry = graph.node("ShaderNodeNewGeometry")
    back = graph.transformed(geometry.outputs["Incoming"], "VECTOR", "WORLD", "OBJECT")
    back = graph.scaled(back, graph.math("DIVIDE", 1.0, graph.part(back, 2)))
    met = graph.transformed(geometry.outputs["Position"], "POINT", "WORLD", "OBJECT")
    depth = (sheet.depth, sheet.depth, 0.0)
    x, y = (1.0 / side for side in sheet.step)
    middle = (0.5 * sheet.size[0], 0.5 * sheet.size[1], 0.0)
    if sheet.kind == "ORTHO":
        return graph.vector("MULTIPLY_ADD", met, (x, y, 0.0), middle), graph.vector("MULTIPLY", back, depth)
    return graph.vector("MULTIPLY_ADD", back, (-x, -y, 0.0), middle), graph.vector("MULTIPLY_ADD", back, depth, met)


def _look_up(graph: Graph, sheet: SheetRays, raster: Socket, pixels: Path) -> tuple[Socket, Socket]:
    """Return the entry of the pixels' table at a place in the packed picture, and the ray's place on its view's plane,
    in pixels as the entry has it.
    """
    width, height = sheet.size
    corner, within = graph.vector("FLOOR", raster), graph.vector("FRACTION", raster)
    texel = graph.vector("MULTIPLY_ADD", corner, (1.0 / width, 1.0 / height, 0.0), (0.5 / width, 0.5 / height, 0.0))
    entry = graph.texture(pixels, texel)
    return entry, graph.vector("MULTIPLY_ADD", within, (sheet.widening, sheet.widening, 0.0), entry)


@dataclass(frozen=True)
class _View:
    """A view in the sheet's space: one of its pixels to the right and one upwards, one unit of depth ahead, its place,
    the depth at which it is in focus, and how many of its pixels are one unit to the right and upwards.

    Without `up` the space is the view's own: `right` has the width and the height of a pixel in x and y, and no place
    and pixels_per_unit are needed.
    """

    right: Value
    up: Value | None
    ahead: Value
    place: Value | None
    focus: Value
    pixels_per_unit: tuple[Value, Value] | None

    def sideways(self, graph: Graph, place: Socket) -> Socket:
        """Return a place on the view's plane, in its pixels, as a way in the sheet's space."""
        if self.up is None:
            return graph.vector("MULTIPLY", place, self.right)
        return graph.combined(self.right, graph.part(place, 0), self.up, graph.part(place, 1))

    def on_lens(self, graph: Graph, place: Socket) -> Socket:
        """Return a place on the view's aperture, in scene units, as a way in the sheet's space."""
        if self.up is None:
            return graph.vector("MULTIPLY", place, (1.0, 1.0, 0.0))
        x, y = (graph.math("MULTIPLY", graph.part(place, axis), self.pixels_per_unit[axis]) for axis in (0, 1))
        return graph.combined(self.right, x, self.up, y)

    def seen_from(self, graph: Graph, way: Socket) -> Socket:
        """Return where a way from the view's place ends."""
        return way if self.place is None else graph.vector("ADD", way, self.place)


def _view_of_table(graph: Graph, views: ViewRays, number: Socket, table: Path) -> _View:
    """Return the view of this number, from the views' table."""
    across = graph.math("MULTIPLY_ADD", number, 1.0 / views.count, 0.5 / views.count)
    rows: list[Socket] = []
    for row in range(VIEW_ROWS):
        texel = graph.node("ShaderNodeCombineXYZ")
        graph.put(across, texel.inputs[0])
        graph.put(1.0 - (row + 0.5) / VIEW_ROWS, texel.inputs[1])
        rows.append(graph.texture(table, texel.outputs[0]))
    right, up, ahead, place, lens = rows
    return _View(right, up, ahead, place, graph.part(lens, 0), (graph.part(lens, 1), graph.part(lens, 2)))


def _perspective_ray(
    graph: Graph, views: ViewRays, view: _View, place: Socket, on_lens: Socket
) -> tuple[Socket, Socket]:
    """Return where the ray through a place on a view's plane begins, and its direction, in the sheet's space. on_lens
    is its place on the packed camera's aperture.
    """
    through = graph.vector("ADD", view.sideways(graph, place), view.ahead)
    if views.lens == 0.0:
        return view.seen_from(graph, graph.scaled(through, views.near_clip)), through
    offset = view.on_lens(graph, graph.scaled(on_lens, views.lens))
    direction = graph.vector("SUBTRACT", graph.scaled(through, view.focus), offset)
    # Cycles starts rays as far from the lens as if they went through its middle.
    length = graph.node("ShaderNodeVectorMath", operation="LENGTH")
    graph.put(through, length.inputs[0])
    far = graph.math("MULTIPLY", length.outputs["Value"], views.near_clip)
    along = graph.scaled(graph.vector("NORMALIZE", direction), far)
    return view.seen_from(graph, graph.vector("ADD", offset, along)), direction


def _orthographic_ray(
    graph: Graph, views: ViewRays, view: _View, place: Socket, on_lens: Socket
) -> tuple[Socket, Socket]:
    """Return where the ray through a place on a view's plane begins, and its direction, in the sheet's space. on_lens
    is its place on the packed camera's aperture.
    """
    begins = view.sideways(graph, place)
    if views.lens == 0.0:
        direction = graph.vector("MULTIPLY", view.ahead, (1.0, 1.0, 1.0))
        along = graph.scaled(direction, views.near_clip)
    else:
        offset = view.on_lens(graph, graph.scaled(on_lens, views.lens))
        begins = graph.vector("ADD", begins, offset)
        direction = graph.vector("SUBTRACT", graph.scaled(view.ahead, view.focus), offset)
        along = graph.scaled(direction, graph.math("DIVIDE", views.near_clip, view.focus))
    return view.seen_from(graph, graph.vector("ADD", begins, along)), direction


def _first_surface_alone(graph: Graph, portal: Socket) -> Socket:
    """Return a surface that is the portal to rays that have met nothing before, and nothing to all others: a view may
    look at the place where the sheet is.
    """
    met = graph.math("GREATER_THAN", graph.node("ShaderNodeLightPath").outputs["Transparent Depth"], 0.5)
    mix = graph.node("ShaderNodeMixShader")
    graph.put(met, mix.inputs[0])
    graph.put(portal, mix.inputs[1])
    graph.put(graph.node("ShaderNodeBsdfTransparent").outputs[0], mix.inputs[2])
    return mix.outputs[0]


def remove_nodes(material: bpy.types.Material) -> None:
    """Remove the nodes of the sheet's material, and their images."""
    images = {node.image for node in material.node_tree.nodes if isinstance(node, bpy.types.ShaderNodeTexImage)}
    material.node_tree.nodes.clear()
    for image in images:
        bpy.data.images.remove(image)
