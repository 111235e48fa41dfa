"""Objects and instances of a working scene that the cameras may see: those that meet the view of either eye.

Whatever is in doubt counts as seen. Blender lets us look at the scene as the viewport evaluates it: what is switched
off there and on in the render counts with all that it may bring along, wherever it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import bpy
import numpy as np
from numpy.typing import NDArray

from ...images.effects import Effect
from ...views.camera import Camera
from ...views.frustum import Frustum, Lens
from .instancing import brought_along
from .materials import Shading, Shadings
from .working import evaluated, focus_distance, is_kept, rendered_layer

SHOWN = {"MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD", "VOLUME", "LIGHT"}
"""Types of objects that a render may show."""

STRANDS = {"CURVES", "POINTCLOUD"}

EVERYWHERE = np.full((8, 3), np.inf)
"""The corners of a box that may be anywhere."""

BOXES_AT_ONCE = 4096
"""Boxes that are held against a view together: each on its own takes numpy as long as a hundred."""

LOWER, UPPER = 0, 6
"""The places of a box's lowest and uppermost corner among the eight that Blender gives."""

AT_UPPER = np.array([[corner & bit > 0 for bit in (4, 2, 1)] for corner in (0, 1, 3, 2, 4, 5, 7, 6)])
"""(8, 3): in which of its coordinates each corner, in Blender's order, is that of the uppermost."""

UNCERTAIN_SIZES = 2.0
"""Distance that an object may reach beyond a box that may not hold all of it, over the box's diagonal and the length of
its hair: no displacement is higher than twice the object is long."""

STAYING_MODIFIERS = {
    "BEVEL",
    "CORRECTIVE_SMOOTH",
    "DECIMATE",
    "EDGE_SPLIT",
    "LAPLACIANSMOOTH",
    "MASK",
    "MULTIRES",
    "NORMAL_EDIT",
    "REMESH",
    "SMOOTH",
    "SUBSURF",
    "TRIANGULATE",
    "UV_PROJECT",
    "UV_WARP",
    "WEIGHTED_NORMAL",
    "WELD",
    "WIREFRAME",
}
"""Modifiers that leave a surface about where it is."""

Box = tuple[NDArray, tuple[float, ...], tuple[float, ...]]
"""An instance's matrix (4, 4) into the world, and in its own space the lowest and uppermost corner of its bounds."""


@dataclass(frozen=True)
class Seen:
    """An object that may be seen: its name and type, its materials (None is a slot without one), and the materials of
    its particle hair. catcher and holdout: True for a shadow catcher and a holdout.
    """

    name: str
    kind: str
    materials: tuple[bpy.types.Material | None, ...]
    hair: tuple[bpy.types.Material | None, ...] = ()
    catcher: bool = False
    holdout: bool = False
    bounded: bool = True
    """True where Blender's bounds of the object hold all that is seen of it."""


def visible_objects(scene: bpy.types.Scene, cameras: Iterable[Camera], shadings: Shadings) -> list[Seen]:
    """Return what the cameras may see of a working scene, each combination of object and materials once."""
    layer = rendered_layer(scene)
    rendered = set(_rendered_objects(layer.layer_collection))
    # With the shutter open, what is out of view may come into it.
    moves = scene.render.use_motion_blur
    frustums = () if moves else tuple(Frustum(camera, lens_of(scene)) for camera in cameras)
    met: set[str] = set()
    found: dict[Seen, None] = {}
    instances = _rendered_instances(layer, rendered, shadings, met)
    boxes = ((seen, _box(instance) if seen.bounded else None) for instance, seen in instances if seen not in found)
    while some := list(islice(boxes, BOXES_AT_ONCE)):
        found.update(dict.fromkeys(_in_view(some, frustums)))
    for item in layer.objects:
        if item.name in rendered and (item.name not in met or _differs_in_render(item)):
            found.update(dict.fromkeys(_in_doubt(item, layer, shadings)))
    return list(found)


def volume_boxes(scene: bpy.types.Scene) -> tuple[NDArray[np.float64], ...]:
    """Return the corners (8, 3), in the world, of a box around each volume of a working scene; infinite where Blender's
    bounds may not hold it. The world's own volume is left out, since it looks the same to both eyes far away.
    """
    return _boxes(scene, lambda seen, shading: seen.kind == "VOLUME" or bool(shading.effects & Effect.VOLUME))


def mirror_boxes(scene: bpy.types.Scene) -> tuple[NDArray[np.float64], ...]:
    """Return the corners (8, 3), in the world, of a box around each object of a working scene that has a material which
    may be a mirror (`Shading.may_mirror`); infinite where Blender's bounds may not hold it.
    """
    return _boxes(scene, lambda _, shading: shading.may_mirror)


def _boxes(scene: bpy.types.Scene, wanted: Callable[[Seen, Shading], bool]) -> tuple[NDArray[np.float64], ...]:
    """Return the corners (8, 3), in the world, of a box around each instance of which `wanted` is True for any of its
    materials, or for an empty shading where it has none; infinite where Blender's bounds may not hold it.
    """
    layer, shadings = rendered_layer(scene), Shadings(scene.render.engine)
    rendered = set(_rendered_objects(layer.layer_collection))
    boxes: list[NDArray[np.float64]] = []
    for instance, seen in _rendered_instances(layer, rendered, shadings, set()):
        shown = [shadings.of(material) for material in seen.materials if material is not None] or [Shading()]
        if any(wanted(seen, shading) for shading in shown):
            certain = seen.bounded and not scene.render.use_motion_blur
            boxes.append(_corners([_box(instance)])[0] if certain else EVERYWHERE)
    return tuple(boxes)


def seen_beyond(scene: bpy.types.Scene, cameras: Iterable[Camera], depth: float) -> str | None:
    """Return the name of an object of a working scene that may be in view of the cameras beyond this depth, in scene
    units; None if there is none.

    The scene is looked at as it is in the present frame, through its lens. What is counted is said at
    `_first_of_which`.
    """
    lens = replace(lens_of(scene), near=depth, far=float("inf"))
    frustums = [Frustum(camera, lens) for camera in cameras]
    return _first_of_which(scene, lambda corners: np.any([frustum.may_meet(corners) for frustum in frustums], axis=0))


def reaches_beyond(scene: bpy.types.Scene, distance: float) -> str | None:
    """Return the name of an object of a working scene that may reach farther than this distance from the scene's
    camera, in scene units, in whichever direction; None if there is none.

    The scene is looked at as it stands. What is counted is said at `_first_of_which`.
    """
    place = np.array(evaluated(scene.camera, scene).matrix_world.translation)
    return _first_of_which(scene, lambda corners: np.linalg.norm(corners - place, axis=-1).max(axis=-1) > distance)


def _first_of_which(scene: bpy.types.Scene, holds: Callable[[NDArray], NDArray[np.bool_]]) -> str | None:
    """Return the name of the first object of a working scene for which something holds, and None if there is none.

    holds gets the corners (N, 8, 3), in the world, of boxes that hold all that a render may show of N instances, and
    returns (N,) whether it holds for each. For what may be anywhere it counts as true: objects that renders show and
    the viewport does not, and those whose modifiers may reach anywhere in a render. The world and suns do not count.
    """
    layer, shadings = rendered_layer(scene), Shadings(scene.render.engine)
    rendered = set(_rendered_objects(layer.layer_collection))
    met: set[str] = set()
    boxes = (
        (seen.name, *_box_and_reach(instance, seen))
        for instance, seen in _rendered_instances(layer, rendered, shadings, met)
        if instance.object.type != "LIGHT" or instance.object.data.type != "SUN"
    )
    while some := list(islice(boxes, BOXES_AT_ONCE)):
        corners = _corners([box for _, box, _ in some])
        reach = np.array([reach for _, _, reach in some])
        found = np.isinf(reach)
        beyond = np.where(found, 0.0, reach)[:, None, None]
        # A box that does not hold all stands along the world's axes when it has grown.
        low, high = corners.min(axis=1, keepdims=True) - beyond, corners.max(axis=1, keepdims=True) + beyond
        found |= holds(np.where(beyond > 0.0, np.where(AT_UPPER, high, low), corners))
        if found.any():
            return some[int(found.argmax())][0]
    unknown = (item for item in layer.objects if item.name in rendered and item.name not in met)
    return next((item.name for item in unknown if any(_in_doubt(item, layer, shadings))), None)


def _box_and_reach(instance: bpy.types.DepsgraphObjectInstance, seen: Seen) -> tuple[Box, float]:
    """Return a box of an instance, and how far beyond its sides the instance may reach along the world's axes, in scene
    units: 0 where Blender's bounds hold all of it, and infinite where nothing is known.
    """
    item = instance.object
    if seen.bounded:
        return _box(instance), 0.0
    scale = max(*instance.matrix_world.to_scale(), 1.0)
    if item.type == "LIGHT":
        return (np.array(instance.matrix_world), (0.0,) * 3, (0.0,) * 3), scale * _light_size(item.data)
    box = _box(instance)
    if not all(map(_stays, _modifiers_of_renders(item))):
        return box, float("inf")
    diagonal = float(np.linalg.norm(np.ptp(_corners([box])[0], axis=0)))
    strands = [system.settings.hair_length for system in item.particle_systems if system.settings is not None]
    return box, UNCERTAIN_SIZES * max(diagonal, scale * max(strands, default=0.0))


def _light_size(light: bpy.types.Light) -> float:
    """Return how far from its middle a lamp shines, in scene units, before it is scaled."""
    if isinstance(light, bpy.types.AreaLight):
        return max(light.size, light.size_y)
    return light.shadow_soft_size if isinstance(light, bpy.types.PointLight | bpy.types.SpotLight) else 0.0


def _rendered_instances(
    layer: bpy.types.ViewLayer, rendered: set[str], shadings: Shadings, met: set[str]
) -> Iterator[tuple[bpy.types.DepsgraphObjectInstance, Seen]]:
    """Yield each instance that is rendered and shown to cameras, wherever it is, with what may be seen of it.

    rendered are the names of the objects that the layer renders. Names of objects that are no instances are added to
    `met`. There may be a million instances of a few objects.
    """
    known: dict[tuple[str, int, str], Seen] = {}
    for instance in layer.depsgraph.object_instances:
        item, parent = instance.object, instance.parent if instance.is_instance else None
        if parent is None:
            met.add(item.name)
        if not _is_rendered(item, parent, rendered, layer):
            continue
        key = (item.name, item.data.as_pointer(), "" if parent is None else parent.name)
        if key not in known:
            known[key] = _seen(item, parent, layer, shadings)
        yield instance, known[key]


def _box(instance: bpy.types.DepsgraphObjectInstance) -> Box:
    """Return the bounds of an instance, with its matrix into the world."""
    # All eight corners at once take Blender ten times as long.
    box = instance.object.bound_box
    return np.array(instance.matrix_world), tuple(box[LOWER]), tuple(box[UPPER])


def _corners(boxes: Sequence[Box]) -> NDArray[np.float64]:
    """Return the corners (N, 8, 3), in the world, of N boxes that are given by matrix and bounds."""
    matrices = np.array([matrix for matrix, _, _ in boxes], np.float64)
    lower, upper = (np.array([box[k] for box in boxes], np.float64) for k in (1, 2))
    corners = np.where(AT_UPPER, upper[:, None], lower[:, None])
    return corners @ matrices[:, :3, :3].transpose(0, 2, 1) + matrices[:, None, :3, 3]


def _rendered_objects(collection: bpy.types.LayerCollection) -> Iterator[str]:
    """Yield the names of the objects that a view layer renders of a collection and those within it."""
    if collection.exclude or collection.collection.hide_render or collection.indirect_only:
        return
    objects = collection.collection.objects
    yield from (item.name for item in objects if not item.hide_render and not is_kept(item))
    for child in collection.children:
        yield from _rendered_objects(child)


def _is_rendered(
    item: bpy.types.Object, parent: bpy.types.Object | None, rendered: set[str], layer: bpy.types.ViewLayer
) -> bool:
    """Return whether an object, or with parent an instance that the parent makes, is rendered and shown to cameras.
    rendered are the names of the objects that the layer renders.
    """
    if item.type not in SHOWN or item.hide_render or not item.visible_camera:
        return False
    if parent is None:
        return item.name in rendered
    # An instancer that is itself an instance is in no collection of the layer.
    return parent.visible_camera and (parent.name in rendered or parent.name not in layer.objects)


def _seen(
    item: bpy.types.Object, parent: bpy.types.Object | None, layer: bpy.types.ViewLayer, shadings: Shadings
) -> Seen:
    """Return what may be seen of an object, or with parent of an instance that the parent makes."""
    owner = parent or item
    override = layer.material_override
    materials = tuple(override or material for material in _materials(item))
    hair = tuple(override or material for material in _hair(item)) if layer.use_strand else ()
    displaced = any(material is not None and shadings.of(material).displaced for material in materials)
    return Seen(
        item.name,
        item.type,
        materials,
        hair,
        # Every light has the flag; it says nothing about what is seen of it.
        catcher=item.type != "LIGHT" and (item.is_shadow_catcher or owner.is_shadow_catcher),
        holdout=item.is_holdout or owner.is_holdout or owner.original.holdout_get(view_layer=layer),
        bounded=not (hair or displaced or item.type in ("META", "LIGHT") or _differs_in_render(item)),
    )


def _materials(item: bpy.types.Object) -> list[bpy.types.Material | None]:
    """Return the materials that any face of the object has; all of its slots' where it has no faces or is not
    evaluated. None is a slot without one.
    """
    if item.type == "LIGHT":
        return []
    materials: list[bpy.types.Material | None] = [slot.material for slot in item.material_slots] or [None]
    if item.type != "MESH" or not item.is_evaluated:
        return materials
    if not item.data.polygons:
        return []
    indices = item.data.attributes.get("material_index")
    if indices is None:
        return materials[:1]
    used = np.zeros(len(indices.data), np.int32)
    indices.data.foreach_get("value", used)
    return [materials[index] for index in np.unique(np.clip(used, 0, len(materials) - 1))]


def _hair(item: bpy.types.Object) -> list[bpy.types.Material | None]:
    """Return the materials of the object's particle hair that is rendered as strands; None is a slot without one."""
    systems = (system.settings for system in item.particle_systems if system.settings is not None)
    strands = [settings for settings in systems if settings.type == "HAIR" and settings.render_type == "PATH"]
    if not strands:
        return []
    slots = [slot.material for slot in item.material_slots] or [None]
    return [slots[min(settings.material, len(slots)) - 1] for settings in strands]


def _in_view(boxes: Sequence[tuple[Seen, Box | None]], frustums: tuple[Frustum, ...]) -> Iterator[Seen]:
    """Return those of the objects whose box may meet one of the frustums, and those without a box; all where there are
    no frustums.
    """
    inside = np.ones(len(boxes), bool)
    bounded = [index for index, (_, box) in enumerate(boxes) if box is not None]
    if bounded and frustums:
        corners = _corners([box for _, box in boxes if box is not None])
        inside[bounded] = np.any([frustum.may_meet(corners) for frustum in frustums], axis=0)
    return (seen for (seen, _), meets in zip(boxes, inside, strict=True) if meets)


def _differs_in_render(item: bpy.types.Object) -> bool:
    """Return whether the object has a modifier that renders use and the viewport does not."""
    return next(_modifiers_of_renders(item), None) is not None


def _modifiers_of_renders(item: bpy.types.Object) -> Iterator[bpy.types.Modifier]:
    """Yield the object's modifiers that renders use and the viewport does not."""
    return (modifier for modifier in item.modifiers if modifier.show_render and not modifier.show_viewport)


def _stays(modifier: bpy.types.Modifier) -> bool:
    """Return whether all that a modifier makes is about where the object is."""
    if isinstance(modifier, bpy.types.ParticleSystemModifier):
        settings = modifier.particle_system.settings
        return settings is not None and settings.type == "HAIR" and settings.render_type == "PATH"
    return modifier.type in STAYING_MODIFIERS


def _in_doubt(item: bpy.types.Object, layer: bpy.types.ViewLayer, shadings: Shadings) -> Iterator[Seen]:
    """Yield what an object may bring into the render that the viewport does not show in the same way."""
    for member in brought_along([item]):
        if member.type in SHOWN and member.visible_camera and not member.hide_render:
            yield _seen(member, None, layer, shadings)
        if any(modifier.type == "NODES" and modifier.show_render for modifier in member.modifiers):
            materials = (
                material
                for material in bpy.data.materials
                if material.users and not material.is_grease_pencil and not is_kept(material)
            )
            yield Seen(member.name, "MESH", tuple(materials))


def lens_of(scene: bpy.types.Scene) -> Lens:
    """Return the lens of the working scene's camera, which both eyes share: clip distances, and with depth of field the
    aperture's radius and the depth in focus, in scene units.
    """
    camera = evaluated(scene.camera, scene)
    data = camera.data
    if not data.dof.use_dof:
        return Lens(data.clip_start, data.clip_end)
    return Lens(data.clip_start, data.clip_end, aperture_radius(data), max(focus_distance(scene), data.clip_start))


def aperture_radius(camera: bpy.types.Camera) -> float:
    """Return the aperture's radius of an evaluated camera in scene units, as in Cycles: 0 without depth of field."""
    if not camera.dof.use_dof:
        return 0.0
    diameter = 1.0 if camera.type == "ORTHO" else camera.lens * 1e-3
    return diameter / (2.0 * max(camera.dof.aperture_fstop, 1e-5))
