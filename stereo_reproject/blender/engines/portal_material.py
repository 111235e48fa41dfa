"""The material of the portal camera's card: nodes that turn a ray of the packed picture into a ray of a view.

A ray meets the card; a table says which pixel of which view its place in the packed picture stands for; and a Ray
Portal BSDF sends it on as that pixel's ray. All of it is worked out in the card's own space, which is the rendered
view's camera space, also while camera and card move with the shutter open.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy

VIEW_ROWS = 5
"""Rows of the views' table. They hold, for each view, in the card's space: one of its pixels to the right, one upwards
and one unit of depth ahead (three numbers each); its place (three); and the depth in focus and how many pixels are one
unit to the right and upwards."""

Socket = bpy.types.NodeSocket
Value = Socket | float | tuple[float, float, float]
"""Something that a node's input can be given: another node's output, a number or a vector."""


@dataclass(frozen=True)
class CardRays:
    """Rays of a packed picture up to the card and from it on, in the card's space and scene units.

    size is the picture's width and height in pixels, and step a pixel's width and height on its plane: at unit depth,
    or for an orthographic camera in scene units. depth is the card's. widening is the width of the scene's pixel filter
    over that of the packed picture, and lens the radius of the views' aperture over that of the packed camera, 0
    without depth of field. near_clip is the depth at which the views' rays begin, views their number.
    """

    orthographic: bool
    size: tuple[int, int]
    step: tuple[float, float]
    depth: float
    widening: float
    lens: float
    near_clip: float
    views: int


def build_material(
    material: bpy.types.Material, rays: CardRays, pixels: bpy.types.Image, views: bpy.types.Image
) -> None:
    """Make the material of the card. pixels is the image of the pixels' table: each entry has the pixel's place on its
    view's plane, x to the right and y upwards, in pixels from where the view looks straight ahead, and the number of
    its view, -1 where there is no pixel. views is the image of the views' table.
    """
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes.clear()
    graph = _Graph(material.node_tree)
    raster, on_lens = _place_in_picture(graph, rays)
    entry, place = _look_up(graph, rays, raster, pixels)
    number = graph.part(entry, 2)
    begins, direction = _ray_of_view(graph, rays, place, on_lens, _axes_of_view(graph, rays, number, views))
    portal = graph.node("ShaderNodeBsdfRayPortal")
    # Where the table has no pixel, the ray ends.
    graph.put(graph.math("GREATER_THAN", number, -0.5), portal.inputs["Color"])
    graph.put(graph.transformed(begins, "POINT", "OBJECT", "WORLD"), portal.inputs["Position"])
    # Blender 4.5 takes the direction as long as it is.
    direction = graph.vector("NORMALIZE", graph.transformed(direction, "VECTOR", "OBJECT", "WORLD"))
    graph.put(direction, portal.inputs["Direction"])
    surface = portal.outputs[0] if rays.views == 1 else _first_surface_alone(graph, portal.outputs[0])
    graph.put(surface, graph.node("ShaderNodeOutputMaterial").inputs["Surface"])


def _place_in_picture(graph: _Graph, rays: CardRays) -> tuple[Socket, Socket]:
    """Return the place of a ray in the packed picture, in pixels from its lower left corner, and its place on the
    packed camera's aperture, in scene units.

    A perspective camera that is focused on what is endlessly far has the one in the ray's direction and the other in
    the place where the ray meets the card; an orthographic one that is focused on the card has it the other way round.
    """
    geometry = graph.node("ShaderNodeNewGeometry")
    back = graph.transformed(geometry.outputs["Incoming"], "VECTOR", "WORLD", "OBJECT")
    back = graph.scaled(back, graph.math("DIVIDE", 1.0, graph.part(back, 2)))
    met = graph.transformed(geometry.outputs["Position"], "POINT", "WORLD", "OBJECT")
    depth = (rays.depth, rays.depth, 0.0)
    if rays.orthographic:
        sideways, on_lens = met, graph.vector("MULTIPLY", back, depth)
    else:
        sideways, on_lens = graph.scaled(back, -1.0), graph.vector("MULTIPLY_ADD", back, depth, met)
    per_unit = (1.0 / rays.step[0], 1.0 / rays.step[1], 0.0)
    middle = (0.5 * rays.size[0], 0.5 * rays.size[1], 0.0)
    return graph.vector("MULTIPLY_ADD", sideways, per_unit, middle), on_lens


def _look_up(graph: _Graph, rays: CardRays, raster: Socket, pixels: bpy.types.Image) -> tuple[Socket, Socket]:
    """Return the entry of the pixels' table at a place in the packed picture, and the ray's place on its view's plane,
    as the entry has the pixel's.
    """
    width, height = rays.size
    corner = graph.vector("FLOOR", raster)
    texel = graph.vector("MULTIPLY_ADD", corner, (1.0 / width, 1.0 / height, 0.0), (0.5 / width, 0.5 / height, 0.0))
    entry = graph.texture(pixels, texel)
    within = graph.vector("SUBTRACT", graph.vector("SUBTRACT", raster, corner), (0.5, 0.5, 0.0))
    return entry, graph.vector("MULTIPLY_ADD", within, (rays.widening, rays.widening, 0.0), entry)


def _axes_of_view(graph: _Graph, rays: CardRays, number: Socket, views: bpy.types.Image) -> list[Socket]:
    """Return the rows of the views' table for the view of this number."""
    across = graph.math("MULTIPLY_ADD", number, 1.0 / rays.views, 0.5 / rays.views)
    rows: list[Socket] = []
    for row in range(VIEW_ROWS):
        texel = graph.node("ShaderNodeCombineXYZ")
        graph.put(across, texel.inputs[0])
        graph.put(1.0 - (row + 0.5) / VIEW_ROWS, texel.inputs[1])
        rows.append(graph.texture(views, texel.outputs[0]))
    return rows


def _ray_of_view(
    graph: _Graph, rays: CardRays, place: Socket, on_lens: Socket, axes: list[Socket]
) -> tuple[Socket, Socket]:
    """Return where the ray through a place on a view's plane begins, and its direction, in the card's space. axes are
    the view's rows of the views' table.
    """
    right, up, ahead, origin, lens = axes
    sideways = graph.combined(right, graph.part(place, 0), up, graph.part(place, 1))
    if rays.orthographic:
        through, origin = ahead, graph.vector("ADD", origin, sideways)
    else:
        through = graph.vector("ADD", ahead, sideways)
    if rays.lens == 0.0:
        return graph.vector("ADD", origin, graph.scaled(through, rays.near_clip)), through
    focus = graph.part(lens, 0)
    on_lens = graph.scaled(on_lens, rays.lens)
    offset = graph.combined(
        right,
        graph.math("MULTIPLY", graph.part(on_lens, 0), graph.part(lens, 1)),
        up,
        graph.math("MULTIPLY", graph.part(on_lens, 1), graph.part(lens, 2)),
    )
    direction = graph.vector("SUBTRACT", graph.scaled(through, focus), offset)
    if rays.orthographic:
        along = graph.scaled(direction, graph.math("DIVIDE", rays.near_clip, focus))
    else:
        # Cycles starts a perspective camera's rays as far from the lens as if they went through its middle.
        length = graph.node("ShaderNodeVectorMath", operation="LENGTH")
        graph.put(through, length.inputs[0])
        far = graph.math("MULTIPLY", length.outputs["Value"], rays.near_clip)
        along = graph.scaled(graph.vector("NORMALIZE", direction), far)
    return graph.vector("ADD", graph.vector("ADD", origin, offset), along), direction


def _first_surface_alone(graph: _Graph, portal: Socket) -> Socket:
    """Return a surface that is the portal to rays that have met nothing before, and nothing to all others: a view may
    look at the place where the card is.
    """
    met = graph.math("GREATER_THAN", graph.node("ShaderNodeLightPath").outputs["Transparent Depth"], 0.5)
    mix = graph.node("ShaderNodeMixShader")
    graph.put(met, mix.inputs[0])
    graph.put(portal, mix.inputs[1])
    graph.put(graph.node("ShaderNodeBsdfTransparent").outputs[0], mix.inputs[2])
    return mix.outputs[0]


class _Graph:
    """A node tree, and the nodes that are used here: each method adds one and returns its output."""

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self._nodes, self._links = tree.nodes, tree.links

    def node(self, kind: str, **properties: object) -> bpy.types.Node:
        """Return a new node of this type, with these properties."""
        added = self._nodes.new(kind)
        for name, value in properties.items():
            setattr(added, name, value)
        return added

    def put(self, value: Value, to: Socket) -> None:
        """Give an input its value."""
        if isinstance(value, bpy.types.NodeSocket):
            self._links.new(value, to)
        else:
            to.default_value = value  # pyright: ignore[reportAttributeAccessIssue] - all inputs used here have one

    def math(self, operation: str, *values: Value) -> Socket:
        """Return the result of an operation on numbers."""
        return self._calculated("ShaderNodeMath", operation, values)

    def vector(self, operation: str, *values: Value) -> Socket:
        """Return the result of an operation on vectors."""
        return self._calculated("ShaderNodeVectorMath", operation, values)

    def _calculated(self, kind: str, operation: str, values: tuple[Value, ...]) -> Socket:
        """Return the first output of a node of this type and operation, with these values for its first inputs."""
        added = self.node(kind, operation=operation)
        for value, to in zip(values, added.inputs, strict=False):
            self.put(value, to)
        return added.outputs[0]

    def scaled(self, vector: Socket, by: Value) -> Socket:
        """Return a vector times a number."""
        added = self.node("ShaderNodeVectorMath", operation="SCALE")
        self.put(vector, added.inputs[0])
        self.put(by, added.inputs["Scale"])
        return added.outputs[0]

    def combined(self, one: Socket, by_one: Value, other: Socket, by_other: Value) -> Socket:
        """Return the sum of two vectors, each times a number."""
        return self.vector("ADD", self.scaled(one, by_one), self.scaled(other, by_other))

    def part(self, vector: Socket, index: int) -> Socket:
        """Return one of the three parts of a vector."""
        added = self.node("ShaderNodeSeparateXYZ")
        self.put(vector, added.inputs[0])
        return added.outputs[index]

    def transformed(self, vector: Socket, kind: str, source: str, target: str) -> Socket:
        """Return a vector, which is a 'POINT' or a 'VECTOR', in another space."""
        added = self.node("ShaderNodeVectorTransform", vector_type=kind, convert_from=source, convert_to=target)
        self.put(vector, added.inputs[0])
        return added.outputs[0]

    def texture(self, image: bpy.types.Image, texel: Socket) -> Socket:
        """Return the colour of an image's texel, as it is."""
        added = self.node("ShaderNodeTexImage", image=image, interpolation="Closest", extension="EXTEND")
        self.put(texel, added.inputs[0])
        return added.outputs[0]
