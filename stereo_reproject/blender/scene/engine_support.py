"""Parts of a scene that one engine shows and the other does not: reported, so that nothing is silently black.

The lists are of what was rendered: every node that Blender has, in either engine, in 4.5 and in 5.2.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import bpy

from ...images.effects import Effect
from ...views.camera import Camera
from .materials import Shadings, uses_nodes
from .node_trees import is_fed, upstream
from .rendered import CYCLES
from .rig import stereo_cameras
from .visible import Seen, visible_objects
from .working import evaluated, rendered_layer

EEVEE_TARGET = "EEVEE"

NOT_IN_EEVEE: dict[str, str] = {
    "ShaderNodeBsdfHair": "is as matte as plain diffuse there",
    "ShaderNodeBsdfHairPrincipled": "is matte there",
    "ShaderNodeBsdfToon": "is as matte as plain diffuse there",
    "ShaderNodeBsdfRayPortal": "is transparent there",
    "ShaderNodeBsdfSheen": "is as matte as plain diffuse there",
    "ShaderNodeBevel": "leaves corners sharp there",
    "ShaderNodeTexIES": "is black there",
    "ShaderNodeScript": "is left out there",
}
"""Nodes that EEVEE does not know, and what it shows in place."""

NOT_IN_CYCLES: dict[str, str] = {
    "ShaderNodeShaderToRGB": "is left out there, with what it turns into a colour",
    "ShaderNodeEeveeSpecular": "is black there",
}
"""Nodes that Cycles does not know, and what it shows in place."""


def engine_warnings(scene: bpy.types.Scene) -> list[str]:
    """Return a line for each material, light and world of a working scene that EEVEE and Cycles show differently,
    because one of them does not know what it uses.
    """
    cameras = stereo_cameras(evaluated(scene.camera, scene), scene.render)
    warnings = [
        line for material in _visible_materials(scene, cameras.values()) for line in _of_shader(material, "material")
    ]
    layer = rendered_layer(scene)
    world = layer.world_override or scene.world
    if world is not None:
        warnings += _of_shader(world, "world")
    instances = (instance.object for instance in layer.depsgraph.object_instances)
    lamps = {item.data.original.name: None for item in instances if item.type == "LIGHT" and not item.hide_render}
    for lamp in map(bpy.data.lights.get, lamps):
        warnings += _of_light(lamp)
    return warnings


def unmatched_materials(scene: bpy.types.Scene, cameras: Iterable[Camera]) -> str | None:
    """Return why what EEVEE shows of a material cannot be warped, or matched to what Cycles shows, in words; None if
    all can.

    EEVEE draws a blended material over the picture and gives it no depth: it would be warped with what lies behind it.
    """
    shadings = Shadings(scene.render.engine)
    see_through = Effect.ALPHA | Effect.TRANSMISSION
    for material in _visible_materials(scene, cameras, shadings):
        if material.surface_render_method == "BLENDED" and shadings.of(material).effects & see_through:
            return f"material {material.name!r} is blended, and EEVEE gives it no depth to be warped by"
    return None


def _visible_materials(
    scene: bpy.types.Scene, cameras: Iterable[Camera], shadings: Shadings | None = None
) -> list[bpy.types.Material]:
    """Return the materials that these cameras may see, sorted by name. shadings, if given, already knows the effects of
    materials and need not find them out again.
    """
    seen = visible_objects(scene, cameras, shadings or Shadings(scene.render.engine))
    found = {material.name: material for item in seen for material in _materials_of(item)}
    return [found[name] for name in sorted(found)]


def _materials_of(item: Seen) -> Iterator[bpy.types.Material]:
    """Yield the materials of an object and of its hair."""
    yield from (material for material in (*item.materials, *item.hair) if material is not None)


def _of_shader(owner: bpy.types.Material | bpy.types.World, kind: str) -> Iterator[str]:
    """Yield the warnings about a material or a world. Each engine reads a shader from an output node of its own, if
    there is one.
    """
    if not uses_nodes(owner):
        return
    outputs = {engine: owner.node_tree.get_output_node(engine) for engine in (EEVEE_TARGET, CYCLES)}
    if all(outputs.values()) and len({output.name for output in outputs.values()}) > 1:
        yield f"{kind} {owner.name!r} has an output for EEVEE and another for Cycles: they need not look the same"
    for engine, other, unknown in ((EEVEE_TARGET, "EEVEE", NOT_IN_EEVEE), (CYCLES, "Cycles", NOT_IN_CYCLES)):
        output = outputs[engine]
        if output is None:
            yield f"{kind} {owner.name!r} has no output that {other} reads: it is black there"
            continue
        yield from _unknown_nodes(output, unknown, f"{kind} {owner.name!r}", other)


def _unknown_nodes(output: bpy.types.Node, unknown: dict[str, str], what: str, engine: str) -> Iterator[str]:
    """Yield a warning for each kind of node that feeds the output and that the engine does not know. unknown says by
    the type of node what is shown instead; what names the material or world.
    """
    met = {source.node.bl_idname: source.node.bl_label for source, _ in upstream(list(output.inputs))}
    for name, label in sorted(met.items()):
        if name in unknown:
            yield f"{what} uses {label}, which {engine} does not know: it {unknown[name]}"


def _of_light(lamp: bpy.types.Light) -> Iterator[str]:
    """Yield the warnings about a light. EEVEE takes its colour and power and ignores its nodes, and has it shine even
    where Cycles makes a portal of it.
    """
    if lamp.type == "AREA" and lamp.cycles.is_portal:
        yield f"light {lamp.name!r} is a portal in Cycles, and EEVEE has it shine"
    if uses_nodes(lamp):
        output = lamp.node_tree.get_output_node(CYCLES)
        if output is not None and is_fed(output.inputs["Surface"]) and not _is_plain(output):
            yield f"light {lamp.name!r} has nodes, which EEVEE does not know: it shines with its own colour there"


def _is_plain(output: bpy.types.Node) -> bool:
    """Return whether a light's nodes change nothing: its output is fed only by a white emission of strength 1."""
    sources = [source.node for source, _ in upstream([output.inputs["Surface"]])]
    if len(sources) != 1 or sources[0].bl_idname != "ShaderNodeEmission":
        return False
    colour, strength = sources[0].inputs["Color"], sources[0].inputs["Strength"]
    return tuple(colour.default_value)[:3] == (1.0, 1.0, 1.0) and strength.default_value == 1.0
