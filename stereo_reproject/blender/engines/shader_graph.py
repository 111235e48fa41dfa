"""A shader's node tree, built by calls that each add one node."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..scene.working import KEPT_OBJECT

Socket = bpy.types.NodeSocket
Value = Socket | float | tuple[float, float, float]
"""Something that a node's input can be given: another node's output, a number or a vector."""


class Graph:
    """A node tree, and the nodes that are used here: each method adds one and returns its output.

    known: True for a tree that was made by the same calls, but for values: then they return the nodes that are there,
    one after the other, and set values alone.
    """

    def __init__(self, tree: bpy.types.NodeTree, *, known: bool) -> None:
        self._nodes, self._links = tree.nodes, tree.links
        self._known = iter(list(tree.nodes)) if known else None

    def node(self, kind: str, **properties: object) -> bpy.types.Node:
        """Return a node of this type, with these properties."""
        if self._known is not None:
            return next(self._known)
        added = self._nodes.new(kind)
        for name, value in properties.items():
            setattr(added, name, value)
        return added

    def put(self, value: Value, to: Socket) -> None:
        """Give an input its value."""
        if isinstance(value, bpy.types.NodeSocket):
            if self._known is None:
                self._links.new(value, to)
        else:
            to.default_value = value  # pyright: ignore[reportAttributeAccessIssue] - all inputs used here have one

    def math(self, operation: str, *values: Value) -> Socket:
        """Return the result of an operation on numbers."""
        return self._calculated("ShaderNodeMath", operation, values)

    def vector(self, operation: str, *values: Value) -> Socket:
        """Return the result of an operation on vectors."""
        return self._calculated("ShaderNodeVectorMath", operation, values)

    def number(self, operation: str, *vectors: Value) -> Socket:
        """Return the number that an operation on vectors has for its result, as DOT_PRODUCT and LENGTH have."""
        added = self.node("ShaderNodeVectorMath", operation=operation)
        for value, to in zip(vectors, added.inputs, strict=False):
            self.put(value, to)
        return added.outputs["Value"]

    def _calculated(self, kind: str, operation: str, values: tuple[Value, ...]) -> Socket:
        """Return the first output of a node of this type and operation, with these values for its first inputs."""
        added = self.node(kind, operation=operation)
        for value, to in zip(values, added.inputs, strict=False):
            self.put(value, to)
        return added.outputs[0]

    def scaled(self, vector: Value, by: Value) -> Socket:
        """Return a vector times a number."""
        added = self.node("ShaderNodeVectorMath", operation="SCALE")
        self.put(vector, added.inputs[0])
        self.put(by, added.inputs["Scale"])
        return added.outputs[0]

    def combined(self, one: Value, by_one: Value, other: Value, by_other: Value) -> Socket:
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

    def texture(self, table: Path, texel: Socket) -> Socket:
        """Return the first three numbers of a table's texel, as they are."""
        return self.texture_and_alpha(table, texel)[0]

    def texture_and_alpha(self, table: Path, texel: Socket) -> tuple[Socket, Socket]:
        """Return the first three numbers of a table's texel, and the fourth, as they are."""
        added = self.node("ShaderNodeTexImage", interpolation="Closest", extension="EXTEND")
        if added.image is None:
            added.image = bpy.data.images.load(str(table), check_existing=True)
            added.image.colorspace_settings.name = "Non-Color"
            added.image.alpha_mode = "CHANNEL_PACKED"
            added.image[KEPT_OBJECT] = True
        elif added.image.filepath != str(table):
            added.image.filepath = str(table)
        self.put(texel, added.inputs[0])
        return added.outputs[0], added.outputs[1]
