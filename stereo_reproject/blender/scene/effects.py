"""The effects plan: what the cameras can see of a working scene, and which effects that calls for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cache
from itertools import zip_longest

import bpy

from ...images.effects import EEVEE_HANDLING, HANDLING, NOT_CALLED_FOR, SEEN_DIFFERENTLY, Effect, EffectsPlan, Finding
from .denoiser import denoises
from .instancing import brought_along
from .materials import Shadings, world_shading
from .rendered import CYCLES, layers_to_render
from .rig import stereo_cameras
from .visible import STRANDS, Seen, aperture_radius, visible_objects
from .working import evaluated, is_kept, rendered_layer

DEFAULT_SURFACE = "default_surface"
"""Cycles' name for the material of an object that has none."""

NEVER_MIRRORS = Effect.TRANSMISSION | Effect.HAIR
"""Effects of things in which the image of a flat mirror is never looked for: `warp/mirrors`."""

MOVING_MODIFIERS = {
    "ARMATURE",
    "BUILD",
    "CLOTH",
    "DYNAMIC_PAINT",
    "EXPLODE",
    "FLUID",
    "HOOK",
    "MESH_CACHE",
    "MESH_DEFORM",
    "MESH_SEQUENCE_CACHE",
    "NODES",
    "OCEAN",
    "SOFT_BODY",
    "SURFACE_DEFORM",
    "WAVE",
}
"""Modifiers that move a surface without a keyframe of its own."""

MOVING_DATA = (
    "armatures",
    "cache_files",
    "collections",
    "curves",
    "hair_curves",
    "lattices",
    "meshes",
    "metaballs",
    "node_groups",
    "particles",
    "pointclouds",
    "shape_keys",
    "volumes",
)
"""Kinds of datablocks beside objects whose animation moves or reshapes what is seen."""


def plan_effects(scene: bpy.types.Scene, *, user_scene: bpy.types.Scene | None = None) -> EffectsPlan:
    """Return the effects plan of a working scene: which effects what the cameras see calls for, and what is done about
    each.

    user_scene is the one that it is a copy of, which has all view layers. Nothing is rendered or changed.
    """
    claims = _Claims(scene)
    cameras = stereo_cameras(evaluated(scene.camera, scene), scene.render)
    for seen in visible_objects(scene, cameras.values(), claims.shadings):
        claims.add_object(seen)
    claims.add(Effect.CAUSTICS, *_caustics(scene, claims.sharp))
    if aperture_radius(evaluated(scene.camera, scene).data) > 0.0:
        f_stop = evaluated(scene.camera, scene).data.dof.aperture_fstop
        claims.add(Effect.DEPTH_OF_FIELD, f"the camera's aperture, f/{f_stop:g}")
    if scene.render.use_motion_blur and rendered_layer(scene).use_motion_blur:
        claims.add(Effect.MOTION_BLUR, *what_moves(scene))
    world = rendered_layer(scene).world_override or scene.world
    if world is not None:
        claims.add(world_shading(world, scene.render.engine), f"world {world.name!r}")
    claims.add(Effect.VIEW_LAYERS, *_more_layers(user_scene or scene))
    claims.add(Effect.DENOISING, *_denoising(scene))
    return claims.plan()


class _Claims:
    """A collection, made while a scene is gone through, of the things that call for each effect."""

    def __init__(self, scene: bpy.types.Scene) -> None:
        self.shadings = Shadings(scene.render.engine)
        self.sharp: dict[Effect, list[str]] = {Effect.GLOSSY: [], Effect.TRANSMISSION: []}
        """Names of what is smooth enough to throw caustics."""
        self._cycles = scene.render.engine == CYCLES
        self._by: dict[Effect, dict[str, list[str]]] = {effect: {} for effect in Effect}
        self._materials: dict[str, Effect] = {}
        self._may_mirror = False

    def add(self, effects: Effect, *by: str, kind: str = "") -> None:
        """Note that the things named in `by` call for the effects. kind groups names: in the plan, one of each kind
        comes first, before the second of any.
        """
        for effect in _each(effects):
            for text in by:
                self._by[effect].setdefault(kind or text, []).append(text)

    def add_object(self, seen: Seen) -> None:
        """Note the effects of an object that may be seen, of its materials and of its hair."""
        own = _own_effects(seen)
        self.add(own, f"{seen.kind.lower()} {seen.name!r}", kind=seen.kind)
        if seen.hair:
            self.add(Effect.HAIR, f"hair on {seen.name!r}", kind="hair")
        for material in seen.materials:
            self._add_material(material, seen, own)
        for material in seen.hair:
            self._add_material(material, seen, own | Effect.HAIR)

    def _add_material(self, material: bpy.types.Material | None, seen: Seen, own: Effect) -> None:
        """Note the effects of a material on an object; own are the effects of the object itself. None is a slot without
        a material.
        """
        name = DEFAULT_SURFACE if material is None else material.name
        if material is not None:
            shading = self.shadings.of(material)
            text = f"material {name!r} on {seen.name!r}"
            self.add(shading.effects, text, kind=name)
            for effect in _each(shading.sharp):
                self.sharp[effect].append(text)
            own |= shading.effects
            mirrors = self._cycles and shading.may_mirror and not own & NEVER_MIRRORS
            self._may_mirror = self._may_mirror or mirrors
        known = self._materials.get(name)
        if known != own:
            self._materials[name] = own if known is None else known | own

    def plan(self) -> EffectsPlan:
        """Return the effects plan of all that was noted."""
        findings = (self._finding(effect, _one_of_each_first(by.values())) for effect, by in self._by.items())
        return EffectsPlan(tuple(findings), self._materials, self._may_mirror)

    def _finding(self, effect: Effect, by: tuple[str, ...]) -> Finding:
        """Return the plan's finding about an effect, by the names of what calls for it."""
        if not by:
            return Finding(effect, by, NOT_CALLED_FOR)
        probed = self._cycles or not effect & SEEN_DIFFERENTLY
        return Finding(effect, by, HANDLING[effect] if probed else EEVEE_HANDLING)


@cache
def _each(effects: Effect) -> tuple[Effect, ...]:
    """Return the single effects of a combination."""
    return tuple(effects)


def _one_of_each_first(kinds: Iterable[list[str]]) -> tuple[str, ...]:
    """Return all texts once: first one of each kind, then the second of each, and so on."""
    rounds = zip_longest(*kinds)
    return tuple(dict.fromkeys(text for row in rounds for text in row if text is not None))


def _own_effects(seen: Seen) -> Effect:
    """Return the effects that an object has by itself, whatever its materials are."""
    effects = Effect(0)
    if seen.kind == "VOLUME":
        effects |= Effect.VOLUME
    if seen.kind in STRANDS:
        effects |= Effect.HAIR
    if seen.kind == "LIGHT":
        # Cycles shows it, and gives it no depth.
        effects |= Effect.DIRECTIONAL_EMISSION
    if seen.catcher or seen.holdout:
        effects |= Effect.CATCHER
    return effects


def _caustics(scene: bpy.types.Scene, sharp: dict[Effect, list[str]]) -> list[str]:
    """Return the names of what makes caustics: smooth surfaces, where the scene has caustics switched on, and lights of
    shadow caustics. sharp has the names of smooth surfaces by effect.
    """
    if scene.render.engine != CYCLES:
        return []
    by = [*sharp[Effect.GLOSSY]] if scene.cycles.caustics_reflective else []
    by += sharp[Effect.TRANSMISSION] if scene.cycles.caustics_refractive else []
    lamps = (item for item in scene.objects if item.type == "LIGHT" and not item.hide_render)
    by += [f"light {lamp.name!r}" for lamp in lamps if lamp.data.cycles.is_caustics_light]
    return list(dict.fromkeys(by))


def _more_layers(scene: bpy.types.Scene) -> list[str]:
    """Return the names, in words, of the view layers that are rendered besides the first."""
    return [f"view layer {layer!r}" for layer in layers_to_render(scene)[1:]]


def _denoising(scene: bpy.types.Scene) -> list[str]:
    """Return what has pictures denoised, in words; empty if they are not."""
    if not denoises(scene):
        return []
    return [f"the render settings: {scene.cycles.denoiser}"]


def what_moves(scene: bpy.types.Scene) -> list[str]:
    """Return in words what may move while the shutter is open: rather too much than too little.

    Objects that only a collection instance shows are counted. Instances of geometry nodes count by the objects that
    make them.
    """
    moving = []
    for item in brought_along(scene.objects, parents=True):
        if item == scene.camera:
            moving += ["the camera"] if _moves(item) else []
        elif item.type != "CAMERA" and _moves(item):
            moving.append(f"{item.type.lower()} {item.name!r}")
    if is_animated(scene.camera.data):
        moving.append("the camera's lens")
    for kind in MOVING_DATA:
        for block in getattr(bpy.data, kind):
            if block.users and is_animated(block):
                moving.append(f"{kind.replace('_', ' ')}: {block.name!r}")
    return moving


def _moves(item: bpy.types.Object) -> bool:
    """Return whether an object may move or change its shape with time."""
    if is_animated(item) or item.constraints or item.rigid_body or item.particle_systems:
        return True
    return any(modifier.show_render and modifier.type in MOVING_MODIFIERS for modifier in item.modifiers)


def is_animated(owner: bpy.types.ID) -> bool:
    """Return whether curves, drivers or NLA tracks may change anything of the datablock with time."""
    # Not every kind has any: collections have none.
    animation = getattr(owner, "animation_data", None)
    return animation is not None and (
        animation.action is not None or len(animation.drivers) > 0 or len(animation.nla_tracks) > 0
    )


def has_grease_pencil(scene: bpy.types.Scene) -> bool:
    """Return whether the scene renders any Grease Pencil."""
    return any(item.type == "GREASEPENCIL" and not item.hide_render for item in scene.objects)


def uses_output(node_type: str, output: str) -> bool:
    """Return whether any shader of the file has a node of this type whose output of this name is linked."""
    found = (node.outputs.get(output) for node in shader_nodes() if node.bl_idname == node_type)
    return any(socket is not None and socket.is_linked for socket in found)


def shader_nodes() -> Iterator[bpy.types.Node]:
    """Yield the nodes of all materials, worlds, lights and node groups of the file."""
    materials = (material for material in bpy.data.materials if not is_kept(material))
    owners = [*materials, *bpy.data.worlds, *bpy.data.lights]
    trees = [owner.node_tree for owner in owners if owner.node_tree is not None] + list(bpy.data.node_groups)
    for tree in trees:
        yield from tree.nodes


def may_read_camera(node: bpy.types.Node) -> bool:
    """Return whether a shader node may tell where Cycles' camera is, whichever of its outputs is used."""
    if node.bl_idname == "ShaderNodeVectorTransform":
        return "CAMERA" in (node.convert_from, node.convert_to)  # pyright: ignore[reportAttributeAccessIssue]
    return node.bl_idname == "ShaderNodeScript"
