"""Changes of a scene between two frames, apart from the camera's: what moves, and what else looks different.

Only values are compared: what is animated and stays as it was has not changed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, cast

import bpy
import numpy as np

from .animated import curves_of
from .setting_up import DRIVEN_SEED
from .visible import lens_of
from .working import is_kept, rendered_layer

SURFACES = frozenset({"MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD", "VOLUME"})
"""Types of objects that are seen themselves."""

SEED = "seed"
"""End of the path of a property that changes noise alone."""


@dataclass(frozen=True)
class SceneState:
    """Contents of a scene in one frame, by value.

    surfaces has a digest of place and shape for each object, all its instances together, by its name. others has a
    digest of what else is animated (lights, worlds, materials, settings), by what it is and its name.
    """

    surfaces: Mapping[str, str]
    others: Mapping[str, str]

    def moved_since(self, before: SceneState) -> list[str]:
        """Return the names of the objects that have moved, changed shape, come or gone since another state, sorted."""
        return _differing(before.surfaces, self.surfaces)

    def changed_since(self, before: SceneState) -> list[str]:
        """Return what else has changed since another state, such as "light Lamp", sorted."""
        return _differing(before.others, self.others)


def _differing(one: Mapping[str, str], other: Mapping[str, str]) -> list[str]:
    """Return the keys for which two mappings do not have the same value, sorted."""
    return sorted(key for key in one.keys() | other.keys() if one.get(key) != other.get(key))


def state_of(scene: bpy.types.Scene) -> SceneState:
    """Return the state of a working scene in its present frame."""
    layer = rendered_layer(scene)
    layer.update()
    depsgraph = layer.depsgraph
    surfaces: dict[str, Any] = {}
    others: dict[str, Any] = {}
    shapes: dict[int, bytes] = {}
    for instance in depsgraph.object_instances:
        evaluated = cast("bpy.types.Object", instance.object)
        thing = cast("bpy.types.Object", evaluated.original)
        if is_kept(thing) or not (instance.show_self or instance.show_particles):
            continue
        if thing.type in SURFACES:
            found = surfaces.setdefault(thing.name_full, hashlib.sha256())
            address = thing.as_pointer()
            if address not in shapes:
                shapes[address] = _shape(evaluated, scene) + _values(thing, evaluated)
                found.update(shapes[address])
        elif thing.type == "LIGHT":
            found = others.setdefault(f"light {thing.name_full}", hashlib.sha256())
        else:
            continue
        found.update(np.array(instance.matrix_world, np.float64).tobytes())
    for what, block in _others(scene):
        values = _of_block(block, depsgraph, scene)
        if values:
            others.setdefault(f"{what} {block.name_full}", hashlib.sha256()).update(values)
    # What is out of focus, or cut by a clip distance, is so in the whole picture.
    others[f"lens {scene.camera.name_full}"] = hashlib.sha256(repr(lens_of(scene)).encode())
    return SceneState(*({name: found.hexdigest() for name, found in each.items()} for each in (surfaces, others)))


def _shape(evaluated: bpy.types.Object, scene: bpy.types.Scene) -> bytes:
    """Return the shape of an object in the present frame as bytes; none where it cannot change, and the number of the
    frame where nothing tells whether it does."""
    thing = cast("bpy.types.Object", evaluated.original)
    data = thing.data
    now = repr((scene.frame_current, scene.frame_subframe)).encode()
    if any(system.settings.type == "EMITTER" or system.use_hair_dynamics for system in thing.particle_systems):
        return now
    if any(modifier.type == "FLUID" and modifier.show_render for modifier in thing.modifiers):
        return now
    if isinstance(data, bpy.types.Volume):
        return now if data.is_sequence else b""
    if not (thing.modifiers or getattr(data, "shape_keys", None) or getattr(data, "animation_data", None)):
        # Metaballs melt into each other: where one moves, the shape of the first is another.
        return b"" if thing.type != "META" else _points(evaluated)
    return _points(evaluated)


def _points(evaluated: bpy.types.Object) -> bytes:
    """Return the places of all points of an evaluated object, in its own space, as bytes."""
    positions = getattr(evaluated.data, "attributes", {}).get("position") if evaluated.data else None
    if positions is not None:
        return _read(positions.data, "vector")
    mesh = evaluated.to_mesh()
    try:
        return b"" if mesh is None else _read(mesh.vertices, "co")
    finally:
        evaluated.to_mesh_clear()


def _read(items: Any, name: str) -> bytes:
    """Return a property of three numbers of all items of a collection as bytes."""
    numbers = np.empty(3 * len(items), np.float32)
    items.foreach_get(name, numbers)
    return numbers.tobytes()


def _others(scene: bpy.types.Scene) -> Iterator[tuple[str, bpy.types.ID]]:
    """Yield the datablocks whose animated values change what all of a picture, or things in it, look like."""
    kinds: Iterable[tuple[str, Iterable[bpy.types.ID]]] = (
        ("light", bpy.data.lights),
        ("world", [scene.world] if scene.world else []),
        ("material", bpy.data.materials),
        ("node group", bpy.data.node_groups),
        ("texture", bpy.data.textures),
        ("settings", [scene]),
    )
    for what, blocks in kinds:
        yield from ((what, block) for block in blocks if block.users)


def _of_block(block: bpy.types.ID, depsgraph: bpy.types.Depsgraph, scene: bpy.types.Scene) -> bytes:
    """Return the animated values of a datablock and of its node tree as bytes, and the number of the frame where it
    shows a movie."""
    evaluated = block.evaluated_get(depsgraph)
    found = _values(block, evaluated)
    trees = [block] if isinstance(block, bpy.types.NodeTree) else [getattr(block, "node_tree", None)]
    for tree in filter(None, trees):
        if tree is not block:
            found += _values(tree, evaluated.node_tree)  # pyright: ignore[reportAttributeAccessIssue] - it has one
        images = (getattr(node, "image", None) for node in tree.nodes)
        if any(image is not None and image.source in ("SEQUENCE", "MOVIE") for image in images):
            found += repr((scene.frame_current, scene.frame_subframe)).encode()
    return found


def _values(block: bpy.types.ID, evaluated: bpy.types.ID) -> bytes:
    """Return the values that curves and drivers of a datablock set, as they are in its evaluated copy, as bytes. Where
    things stand is left out, which instances tell, and so is what changes noise alone."""
    found: list[tuple[str, int, str]] = []
    for curve in curves_of(block):
        path = curve.data_path
        if path.endswith((SEED, f'["{DRIVEN_SEED}"]')) or path.startswith(("location", "rotation", "scale", "delta_")):
            continue
        try:
            value: Any = evaluated.path_resolve(path)
        except ValueError:
            # A curve of something that is no longer there changes nothing.
            continue
        if hasattr(value, "__len__") and not isinstance(value, str):
            value = value[curve.array_index]
        found.append((path, curve.array_index, repr(value)))
    return repr(sorted(found)).encode() if found else b""
