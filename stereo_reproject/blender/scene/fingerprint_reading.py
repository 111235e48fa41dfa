"""A datablock as text, read by Blender's own descriptions of its types: all that may be seen, and its references."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import bpy

from .animated import Place, animated_values
from .fingerprint_arrays import FLAT, attribute_lines, flat_lines, hair_lines, lattice_lines, mesh_lines
from .fingerprint_files import Files, image_lines, packed_digest
from .fingerprint_rules import EXTENDED, GROUPS_OF_ADDONS, counts

SETTINGS = "scene settings"
OF_THE_WINDOW = (bpy.types.Screen, bpy.types.WorkSpace, bpy.types.WindowManager, bpy.types.Brush)
SORTED = ("nodes",)
"""Collections whose order is that of what was selected last."""
OWNED = ("drawing",)
"""Properties that can be set to another struct although theirs belongs to the owner."""
BY_CURVES = "by curves"

Key = tuple[str, str, str]
"""Identity of a datablock in a file: its kind, its name, and the name of its library."""


@dataclass(frozen=True)
class Plan:
    """The properties of a type of struct that count in a fingerprint, found once for all structs of the type."""

    name: str
    scalars: tuple[str, ...]
    arrays: tuple[str, ...]
    paths: tuple[str, ...]
    pointers: tuple[tuple[str, bool], ...]
    """Names of pointers, each with True where the struct pointed to belongs to this one."""
    collections: tuple[tuple[str, str], ...]
    """Names of collections, each with the type of its items."""
    has_attributes: bool
    extra: Callable[[Any], Iterable[str]] | None
    """Function of the struct that returns lines of what the properties do not hold, or only item by item."""
    has_custom: bool
    """True where there may be custom properties, or before Blender 5 the inputs of a geometry nodes modifier."""


def plan_of(struct: bpy.types.bpy_struct) -> Plan:
    """Return the plan for structs of this one's type."""
    props = [prop for prop in struct.bl_rna.properties if counts(struct, prop)]
    plain = [prop for prop in props if prop.type not in ("POINTER", "COLLECTION")]
    paths = [prop.identifier for prop in plain if prop.type == "STRING" and prop.subtype == "FILE_PATH"]
    arrays = [p.identifier for p in plain if getattr(p, "is_array", False) or getattr(p, "is_enum_flag", False)]
    lists = {prop.identifier: prop.fixed_type.identifier for prop in props if prop.type == "COLLECTION"}
    attributes = struct.bl_rna.properties.get("attributes")
    return Plan(
        struct.bl_rna.identifier,
        tuple(prop.identifier for prop in plain if prop.identifier not in {*paths, *arrays}),
        tuple(arrays),
        tuple(paths),
        tuple((p.identifier, p.is_readonly or p.identifier in OWNED) for p in props if p.type == "POINTER"),
        tuple((name, kind) for name, kind in lists.items() if kind != "Attribute"),
        attributes is not None and attributes.fixed_type.identifier == "Attribute",
        next((lines for kind, lines in EXTRA.items() if isinstance(struct, kind)), None),
        isinstance(struct, EXTENDED) or (bpy.app.version < (5, 0) and isinstance(struct, bpy.types.NodesModifier)),
    )


class Reader:
    """Reader of datablocks as lines of text for a fingerprint, one after the other; `files` gathers the files that they
    use.
    """

    def __init__(self) -> None:
        self.files = Files()
        lists = [prop for prop in bpy.data.bl_rna.properties if prop.type == "COLLECTION"]
        kinds = {prop.fixed_type.identifier: prop.identifier.replace("_", " ") for prop in lists}
        self._kinds: dict[str, str] = {**kinds, "Scene": SETTINGS}
        # By address: the inputs of each geometry nodes modifier are a type of their own, under one name.
        self._plans: dict[int, Plan] = {}

    def read(self, block: bpy.types.ID) -> tuple[list[str], list[bpy.types.ID]]:
        """Return the lines of a datablock for a fingerprint, and the datablocks that it points to, which are to be read
        too.
        """
        reading = _Reading(self, block)
        reading.embedded("", block)
        return reading.lines, reading.references

    def key(self, block: bpy.types.ID) -> Key:
        """Return the identity of a datablock in its file: its kind, its name, and the name of its library ("" without
        one).
        """
        kind = block.bl_rna
        while kind.identifier not in self._kinds and kind.base is not None:
            kind = kind.base
        name = self._kinds.get(kind.identifier) or str(kind.identifier)
        return name, block.name, (block.library.name or "") if block.library else ""

    def plan(self, struct: bpy.types.bpy_struct) -> Plan:
        """Return the plan for a struct's type, made at the first call."""
        address = struct.bl_rna.as_pointer()
        if address not in self._plans:
            self._plans[address] = plan_of(struct)
        return self._plans[address]


class _Reading:
    """The reading of one datablock: the lines of what it holds, and the datablocks that it points to (`references`)."""

    def __init__(self, reader: Reader, block: bpy.types.ID) -> None:
        self.lines: list[str] = []
        self.references: list[bpy.types.ID] = []
        self._reader, self._block, self._key = reader, block, reader.key(block)
        self._animated: dict[Place, set[int]] = {}
        self._moving: set[int] = set()
        self._met: set[tuple[int, str]] = set()

    def embedded(self, path: str, block: bpy.types.ID) -> None:
        """Read a datablock, or one that is embedded in it (a node tree, say), which has curves of its own. path is
        where it was found, for the lines.
        """
        self._animated |= animated_values(block)
        self._moving = {address for address, _ in self._animated}
        self._struct(path, block)

    def _struct(self, path: str, struct: bpy.types.bpy_struct) -> None:
        """Read a struct and all that belongs to it; nothing if it was read already. path is where it was found."""
        plan = self._reader.plan(struct)
        address = struct.as_pointer()
        if (address, plan.name) in self._met:
            return
        self._met.add((address, plan.name))
        self.lines.append(f"{path} {plan.name} {self._values(plan, struct, address)!r}")
        for name in plan.paths:
            self._path(f"{path}.{name}", getattr(struct, name))
        if plan.has_attributes:
            self.lines.extend(attribute_lines(struct))
        if plan.extra is not None:
            self.lines.extend(plan.extra(struct))
        if isinstance(struct, bpy.types.Image):
            self._reader.files.add_image(f"{self._key}{path}", struct)
        if plan.has_custom:
            self._custom(path, struct, address)
        for name, owned in plan.pointers:
            self._pointer(f"{path}.{name}", getattr(struct, name), owned)
        for name, kind in plan.collections:
            self._collection(f"{path}.{name}", getattr(struct, name), kind, name in SORTED)

    def _values(self, plan: Plan, struct: bpy.types.bpy_struct, address: int) -> list[Any]:
        """Return the values of a struct's plain properties; those that curves or drivers set are replaced by a mark."""
        values: list[Any] = [getattr(struct, name) for name in plan.scalars]
        values += [_listed(getattr(struct, name)) for name in plan.arrays]
        if address in self._moving:
            for place, name in enumerate((*plan.scalars, *plan.arrays)):
                indices = self._animated.get((address, name))
                if indices is not None:
                    values[place] = _without(values[place], indices)
        return values

    def _path(self, path: str, value: str) -> None:
        """Read a property that is the path of a file. In the fingerprint the file counts by its content, not by its
        path.
        """
        self.lines.append(f"{path} {bool(value)}")
        self._reader.files.add(f"{self._key}{path}", self._block, value)

    def _refer(self, path: str, block: bpy.types.ID) -> None:
        """Note that the datablock read here points to another one, which is read on its own. path says from where."""
        self.lines.append(f"{path} {self._reader.key(block)}")
        self.references.append(block)

    def _pointer(self, path: str, value: Any, owned: bool) -> None:
        """Read what a property points to: a struct that is `owned` is read as a part, anything else by its name."""
        if value is None:
            self.lines.append(f"{path} None")
        elif isinstance(value, OF_THE_WINDOW):
            return
        elif isinstance(value, bpy.types.ID):
            if value.is_embedded_data and owned:
                self.embedded(path, value)
            else:
                self._refer(path, value)
        elif owned:
            self._struct(path, value)
        else:
            self.lines.append(f"{path} {getattr(value, 'name', '')!r}")

    def _collection(self, path: str, items: bpy.types.bpy_prop_collection, kind: str, in_any_order: bool) -> None:
        """Read the items of a collection of this kind; in_any_order: True where their order says nothing."""
        if kind in FLAT and not any(item.as_pointer() in self._moving for item in (items if self._moving else ())):
            self.lines.append(path)
            self.lines.extend(flat_lines(items, kind))
            return
        listed = sorted(items, key=lambda item: item.name) if in_any_order else items
        if kind == "TimelineMarker":
            # The others are notes.
            listed = [marker for marker in listed if marker.camera]
        for index, item in enumerate(listed):
            # What belongs to a collection is no longer only pointed to.
            self._pointer(f"{path}[{index}]", item, True)

    def _custom(self, path: str, struct: bpy.types.bpy_struct, address: int) -> None:
        """Read the custom properties of a struct; before Blender 5 the inputs of a geometry nodes modifier are among
        them. Properties of add-ons are left out.
        """
        before_5 = bpy.app.version < (5, 0)
        for name in sorted(struct.keys()):
            value = struct[name]
            # Before Blender 5 the settings of add-ons, switched on or not, are among them, as groups.
            if GROUPS_OF_ADDONS.fullmatch(name) or (before_5 and hasattr(value, "to_dict")):
                continue
            if isinstance(value, bpy.types.ID):
                self._refer(f"{path}[{name!r}]", value)
                continue
            plain = value.to_dict() if hasattr(value, "to_dict") else _listed(value)
            indices = self._animated.get((address, f'["{name}"]'))
            self.lines.append(f"{path}[{name!r}] {_without(plain, indices) if indices else plain!r}")


def _links(tree: bpy.types.NodeTree) -> list[str]:
    """Return a line for each link of a node tree, sorted, since their order says nothing."""
    return sorted(
        f"{link.from_node.name!r} {link.from_socket.identifier!r} {link.to_node.name!r} {link.to_socket.identifier!r}"
        f" {link.is_muted} {link.multi_input_sort_id}"
        for link in tree.links
    )


def _shown_of_image_node(node: bpy.types.CompositorNodeImage) -> list[str]:
    """Return a line with the layer and the view that a compositor's image node shows."""
    # Of another image Blender prints a complaint that there are none.
    return [f"{node.layer if node.has_layers else ''} {node.view if node.has_views else ''}"]


EXTRA: dict[type, Callable[[Any], Iterable[str]]] = {
    bpy.types.Mesh: mesh_lines,
    bpy.types.Lattice: lattice_lines,
    bpy.types.ParticleSystem: hair_lines,
    bpy.types.NodeTree: _links,
    bpy.types.Text: lambda text: [repr(text.as_string())],
    bpy.types.PackedFile: lambda packed: [packed_digest(packed)],
    bpy.types.CompositorNodeImage: _shown_of_image_node,
    bpy.types.Image: image_lines,
}


def _listed(value: Any) -> Any:
    """Return a vector, matrix, array or set as a list, so that equal values are written equally; other values as they
    are.
    """
    if isinstance(value, set):
        return sorted(value)
    if isinstance(value, (str, bytes)) or not hasattr(value, "__len__"):
        return value
    items = list(value)
    # Numbers all of them, which most are: none needs a look of its own.
    return items if items and isinstance(items[0], (int, float)) else [_listed(item) for item in items]


def _without(value: Any, indices: set[int]) -> Any:
    """Return a value with a mark in place of the items of these indices, which curves set; a plain value becomes the
    mark itself.
    """
    if not isinstance(value, list):
        return BY_CURVES
    return [BY_CURVES if index in indices else item for index, item in enumerate(value)]
