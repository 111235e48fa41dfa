"""Lines for a fingerprint from parts of which a datablock has many, read at once: vertices, keyframes, pixels."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

import bpy
import numpy as np
from numpy.typing import NDArray

FLAT = {
    "BezierSplinePoint": ("co", "handle_left", "handle_right", "radius", "tilt", "weight_softbody"),
    "SplinePoint": ("co", "radius", "tilt", "weight", "weight_softbody"),
    "Keyframe": ("co", "handle_left", "handle_right", "interpolation", "easing", "back", "amplitude", "period"),
    "FCurveSample": ("co",),
    "LatticePoint": ("co_deform", "weight_softbody"),
    "CurveMapPoint": ("location", "handle_type"),
    "CurveProfilePoint": ("location", "handle_type_1", "handle_type_2"),
    "ShapeKeyPoint": ("co",),
    "MovieTrackingMarker": ("co", "frame", "mute"),
    "IntAttributeValue": ("value",),
}
"""Kinds of items of which nothing counts but numbers, with these."""

ATTRIBUTES = {
    "FLOAT": ("value", 1, np.float32),
    "INT": ("value", 1, np.int32),
    "BOOLEAN": ("value", 1, np.bool_),
    "INT8": ("value", 1, np.int8),
    "FLOAT_VECTOR": ("vector", 3, np.float32),
    "FLOAT2": ("vector", 2, np.float32),
    "FLOAT_COLOR": ("color", 4, np.float32),
    "BYTE_COLOR": ("color", 4, np.float32),
    "QUATERNION": ("value", 4, np.float32),
    "FLOAT4X4": ("value", 16, np.float32),
    "INT32_2D": ("value", 2, np.int32),
    "INT16_2D": ("value", 2, np.int16),
}
"""Property that holds an attribute's value, its length and its kind of numbers, by data type."""

TOPOLOGY = (".edge_verts", ".corner_vert", ".corner_edge")
"""The only attributes of Blender's own (they begin with a dot) that are no selection and hide nothing."""


def digest_of(values: NDArray | bytes) -> str:
    """Return the hexadecimal SHA-256 of the values, as they lie in memory."""
    data = np.ascontiguousarray(values) if isinstance(values, np.ndarray) else values
    return hashlib.sha256(data).hexdigest()


def flat_lines(items: bpy.types.bpy_prop_collection, kind: str) -> Iterator[str]:
    """Yield a fingerprint's lines for a collection whose items are of a kind in `FLAT`: the number of items, and a
    digest of each of their properties.
    """
    count = len(items)
    yield f"{count} {kind}"
    for name in FLAT[kind] if count else ():
        prop = items[0].bl_rna.properties[name]
        dtype = {"FLOAT": np.float32, "BOOLEAN": np.bool_}.get(prop.type, np.int32)
        values = np.zeros(count * max(getattr(prop, "array_length", 1), 1), dtype)
        items.foreach_get(name, values)
        yield f"{name} {digest_of(values)}"


def attribute_lines(block: bpy.types.bpy_struct) -> Iterator[str]:
    """Yield a fingerprint's line for each attribute of a mesh, hair curves, a point cloud or a grease pencil drawing.
    Blender's own that tell of selection or hiding are left out.
    """
    for attribute in sorted(block.attributes, key=lambda attribute: attribute.name):
        if attribute.name.startswith(".") and attribute.name not in TOPOLOGY:
            continue
        yield f"{attribute.name} {attribute.domain} {attribute.data_type} {_attribute_digest(attribute)}"


def _attribute_digest(attribute: bpy.types.Attribute) -> str:
    """Return the digest of the values of an attribute."""
    if attribute.data_type not in ATTRIBUTES:
        return digest_of(repr([item.value for item in attribute.data]).encode())
    name, length, dtype = ATTRIBUTES[attribute.data_type]
    values = np.zeros(len(attribute.data) * length, dtype)
    attribute.data.foreach_get(name, values)
    return digest_of(values)


def mesh_lines(mesh: bpy.types.Mesh) -> Iterator[str]:
    """Yield a fingerprint's lines for a mesh besides its attributes: faces, active layers, weights and skin."""
    starts = np.zeros(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_start", starts)
    yield f"polygons {len(starts)} {digest_of(starts)} {len(mesh.loops)} {len(mesh.edges)} {len(mesh.vertices)}"
    yield f"colour {mesh.attributes.default_color_name!r}"
    yield f"uv {[layer.name for layer in mesh.uv_layers if layer.active_render]}"
    yield f"weights {digest_of(_weights(mesh.vertices))}"
    yield from _skin_lines(mesh)


def _skin_lines(mesh: bpy.types.Mesh) -> Iterator[str]:
    """Yield a fingerprint's lines for a mesh's skin vertices: radii and roots."""
    for layer in mesh.skin_vertices:
        radii, roots = np.zeros(len(layer.data) * 2, np.float32), np.zeros(len(layer.data), np.bool_)
        layer.data.foreach_get("radius", radii)
        layer.data.foreach_get("use_root", roots)
        yield f"skin {digest_of(radii)} {digest_of(roots)}"


def _weights(points: bpy.types.bpy_prop_collection) -> NDArray[np.float64]:
    """Return the weights of vertex groups, a row (vertex, group, weight) for each."""
    found = [(point.index, one.group, one.weight) for point in points for one in point.groups]
    return np.array(found, np.float64)


def lattice_lines(lattice: bpy.types.Lattice) -> Iterator[str]:
    """Yield a fingerprint's line for the weights of a lattice's points."""
    groups = [(place, one.group, one.weight) for place, point in enumerate(lattice.points) for one in point.groups]
    yield f"weights {digest_of(np.array(groups, np.float64))}"


def hair_lines(system: bpy.types.ParticleSystem) -> Iterator[str]:
    """Yield a fingerprint's lines for hair that was combed. Other hair, and particles, follow from their settings and
    have none.
    """
    for particle in system.particles if system.is_edited else ():
        keys = np.zeros((len(particle.hair_keys), 3), np.float32)
        particle.hair_keys.foreach_get("co_local", keys.ravel())
        yield f"hair {digest_of(keys)}"


def pixels_digest(image: bpy.types.Image) -> str:
    """Return the digest of the image's pixels; an image that is not loaded yet is loaded for it."""
    pixels = np.zeros(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return digest_of(pixels)
