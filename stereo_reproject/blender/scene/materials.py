"""Effects of a material, from its nodes as far as they reach the output; unlinked sockets count with their values."""

from __future__ import annotations

from dataclasses import dataclass, replace

import bpy

from ...images.effects import Effect
from ...warp.tuning import TUNING as WARP_TUNING
from .node_trees import WORLD_OUTPUTS, Groups, constant, depends_on_camera, is_constant, is_fed, origin, upstream
from .rendered import CYCLES

MAX_CAUSTIC_ROUGHNESS = 0.25
"""Roughness below which a surface is taken to throw caustics."""

NOTHING = Effect(0)

LEAVES: dict[str, tuple[Effect, str]] = {
    "ShaderNodeBsdfAnisotropic": (Effect.GLOSSY, "Color"),
    "ShaderNodeBsdfMetallic": (Effect.GLOSSY, "Base Color"),
    "ShaderNodeBsdfSheen": (Effect.GLOSSY, "Color"),
    "ShaderNodeBsdfHair": (Effect.GLOSSY, "Color"),
    "ShaderNodeBsdfHairPrincipled": (Effect.GLOSSY, ""),
    "ShaderNodeEeveeSpecular": (Effect.GLOSSY | Effect.ALPHA, ""),
    "ShaderNodeBsdfGlass": (Effect.GLOSSY | Effect.TRANSMISSION, "Color"),
    "ShaderNodeBsdfRefraction": (Effect.TRANSMISSION, "Color"),
    "ShaderNodeBsdfRayPortal": (Effect.TRANSMISSION, "Color"),
    "ShaderNodeBsdfTransparent": (Effect.ALPHA, "Color"),
    "ShaderNodeSubsurfaceScattering": (Effect.SUBSURFACE, "Color"),
    "ShaderNodeHoldout": (Effect.CATCHER, ""),
    "ShaderNodeBsdfTranslucent": (NOTHING, "Color"),
    "ShaderNodeBackground": (NOTHING, "Color"),
}
"""Effects of each closure, and the socket that takes all of it away when it is black."""

PRINCIPLED = "ShaderNodeBsdfPrincipled"

MIRROR_COLOURS = {
    "ShaderNodeBsdfAnisotropic": "Color",
    "ShaderNodeBsdfMetallic": "Base Color",
    PRINCIPLED: "Base Color",
}
"""Closures that may be a flat mirror, and the socket that has the share of light that they, or their metallic part,
reflect straight on."""

ROUGHNESS_ROUNDING = 1e-6
"""Roughness by which a socket's float32 may be above the number that was meant."""

EMISSIONS = ("ShaderNodeEmission", "ShaderNodeBackground")

VOLUME_SOURCES: dict[str, tuple[str, ...]] = {
    "ShaderNodeVolumeAbsorption": ("Density",),
    "ShaderNodeVolumeScatter": ("Density",),
    "ShaderNodeVolumePrincipled": ("Density", "Emission Strength", "Blackbody Intensity"),
    "ShaderNodeEmission": ("Strength",),
}
"""The sockets of volume closures that leave nothing of them when all are 0."""


@dataclass(frozen=True)
class Shading:
    """Effects of a shader. sharp: those of GLOSSY and TRANSMISSION that are smooth enough to throw caustics. displaced:
    True where the shader moves the surface, so that it may leave the bounds that Blender knows. mirrored: share of the
    light that it may at most reflect straight on, smoothly enough for a flat mirror.
    """

    effects: Effect = NOTHING
    sharp: Effect = NOTHING
    displaced: bool = False
    mirrored: float = 0.0

    def __or__(self, other: Shading) -> Shading:
        return Shading(
            self.effects | other.effects,
            self.sharp | other.sharp,
            self.displaced or other.displaced,
            self.mirrored + other.mirrored,
        )

    @property
    def may_mirror(self) -> bool:
        """True where the shader may reflect as much as a flat mirror whose image is looked for: `warp/mirrors`."""
        return self.mirrored >= WARP_TUNING.least_reflectance


def material_shading(material: bpy.types.Material, engine: str = CYCLES) -> Shading:
    """Return the effects of a material. Without nodes, Cycles renders it plainly diffuse, and EEVEE with its metallic
    and specular settings.
    """
    if not uses_nodes(material):
        glossy = engine != CYCLES and (material.metallic > 0.0 or material.specular_intensity > 0.0)
        return Shading(Effect.GLOSSY if glossy else NOTHING)
    output = _output(material, engine)
    if output is None:
        return Shading()
    shading = _closure(output.inputs["Surface"]) | Shading(_volume(output.inputs["Volume"]))
    if _has_bump(output):
        shading |= Shading(Effect.BUMP)
    moved = is_fed(output.inputs["Displacement"])
    return shading | Shading(Effect.BUMP if moved else NOTHING, displaced=moved and _displaces(material))


class Shadings:
    """The shadings of materials for one engine, each found out once."""

    def __init__(self, engine: str) -> None:
        self._engine = engine
        self._known: dict[int, Shading] = {}

    def of(self, material: bpy.types.Material) -> Shading:
        """Return `material_shading` of the material, from memory after the first call."""
        key = material.as_pointer()
        if key not in self._known:
            self._known[key] = material_shading(material, self._engine)
        return self._known[key]


def world_shading(world: bpy.types.World, engine: str = CYCLES) -> Effect:
    """Return the effects of the world. Eyes that look in the same direction see the same of it, unless its shader knows
    the camera or it has a volume.
    """
    output = _output(world, engine) if uses_nodes(world) else None
    if output is None:
        return NOTHING
    from_camera = depends_on_camera([output.inputs["Surface"]], outputs=WORLD_OUTPUTS)
    return (Effect.CAMERA_DEPENDENT if from_camera else NOTHING) | _volume(output.inputs["Volume"])


def uses_nodes(owner: bpy.types.Material | bpy.types.World | bpy.types.Light) -> bool:
    """Return whether the look of a material, world or light comes from its nodes, rather than from its plain
    settings.
    """
    # From 5.0 on nodes are always used, and asking is deprecated.
    return owner.node_tree is not None and (bpy.app.version >= (5, 0) or owner.use_nodes)


def _output(owner: bpy.types.Material | bpy.types.World, engine: str) -> bpy.types.Node | None:
    """Return the output node that the engine reads; None where there is none for it."""
    return owner.node_tree.get_output_node(CYCLES if engine == CYCLES else "EEVEE")


def _displaces(material: bpy.types.Material) -> bool:
    """Return whether the material's displacement moves the surface itself, rather than only its shading."""
    return material.displacement_method != "BUMP"


def _has_bump(output: bpy.types.Node) -> bool:
    """Return whether a Bump node with a height has any part in the surface that feeds this output node."""
    for source, inside in upstream([output.inputs["Surface"]]):
        node = source.node
        if node.bl_idname == "ShaderNodeBump" and not is_constant(node.inputs["Strength"], inside, 0.0):
            height = next(socket for socket in node.inputs if socket.identifier == "Height")
            if is_fed(height, inside):
                return True
    return False


def _closure(socket: bpy.types.NodeSocket, groups: Groups = (), *, weighted: bool = False) -> Shading:
    """Return the effects of the shader that feeds a socket. groups are the group nodes that the socket is inside of;
    weighted is True where the shader's share in a mix depends on the camera.
    """
    source, groups = origin(socket, groups)
    if source is None or not source.is_output:
        return Shading()
    node = source.node
    if node.bl_idname == "ShaderNodeMixShader":
        return _mixed(node, groups, weighted)
    if node.bl_idname == "ShaderNodeAddShader":
        return _closure(node.inputs[0], groups, weighted=weighted) | _closure(node.inputs[1], groups, weighted=weighted)
    shading = _principled(node, groups) if node.bl_idname == PRINCIPLED else _leaf(node, groups)
    from_camera = depends_on_camera(list(node.inputs), groups) or node.bl_idname == "ShaderNodeScript"
    effects = Effect.CAMERA_DEPENDENT if from_camera else NOTHING
    if weighted or from_camera:
        effects |= _directional_emission(node, groups, weighted)
    return shading | Shading(effects, mirrored=_mirrored(node, groups))


def _mixed(node: bpy.types.Node, groups: Groups, weighted: bool) -> Shading:
    """Return the effects of a Mix Shader node: of one side where the factor is always 0 or 1, else of both."""
    factor, first, second = node.inputs[:3]
    if is_constant(factor, groups, 0.0):
        return _closure(first, groups, weighted=weighted)
    if is_constant(factor, groups, 1.0):
        return _closure(second, groups, weighted=weighted)
    from_camera = depends_on_camera([factor], groups)
    weighted = weighted or from_camera
    one, other = (_closure(side, groups, weighted=weighted) for side in (first, second))
    share = constant(factor, groups)
    if isinstance(share, float):
        share = min(max(share, 0.0), 1.0)
        one = replace(one, mirrored=(1.0 - share) * one.mirrored)
        other = replace(other, mirrored=share * other.mirrored)
    return one | other | Shading(Effect.CAMERA_DEPENDENT if from_camera else NOTHING)


def _leaf(node: bpy.types.Node, groups: Groups) -> Shading:
    """Return the effects of a single closure node that is no Principled BSDF. An unknown node counts as depending on
    the camera.
    """
    if node.bl_idname in ("ShaderNodeEmission", "ShaderNodeScript"):
        return Shading()
    if node.bl_idname == "ShaderNodeBsdfDiffuse":
        return _rough_diffuse(node.inputs["Roughness"], groups)
    if node.bl_idname == "ShaderNodeBsdfToon":
        return Shading(Effect.GLOSSY if node.component == "GLOSSY" else NOTHING)
    if node.bl_idname not in LEAVES:
        # Nobody knows what it does.
        return Shading(Effect.CAMERA_DEPENDENT)
    effects, colour = LEAVES[node.bl_idname]
    if colour and not _has_refraction(node) and is_constant(node.inputs[colour], groups, 0.0):
        return Shading()
    sharp = effects & (Effect.GLOSSY | Effect.TRANSMISSION)
    return Shading(effects, sharp if _is_sharp(node, groups) else NOTHING)


def _has_refraction(node: bpy.types.Node) -> bool:
    """Return whether a node is a Metallic BSDF that takes its colour from its refraction. Its Base Color counts for
    nothing then, and Blender 4.5 does not find that input by its name.
    """
    return getattr(node, "fresnel_type", "") == "PHYSICAL_CONDUCTOR"


def _rough_diffuse(roughness: bpy.types.NodeSocket, groups: Groups) -> Shading:
    """Return the effects of a diffuse surface of this roughness: GLOSSY unless it is 0, since Oren and Nayar's rough
    surface throws more light back to where it comes from.
    """
    return Shading(NOTHING if is_constant(roughness, groups, 0.0) else Effect.GLOSSY)


def _is_sharp(node: bpy.types.Node, groups: Groups) -> bool:
    """Return whether a closure is smooth enough to throw caustics; a roughness from a texture may be."""
    roughness = next((socket for socket in node.inputs if socket.name == "Roughness"), None)
    if roughness is None or is_fed(roughness, groups):
        return True
    source, _ = origin(roughness, groups)
    return source is None or source.default_value < MAX_CAUSTIC_ROUGHNESS


def _mirrored(node: bpy.types.Node, groups: Groups) -> float:
    """Return the share of light (0 to 1) that a closure node may at most reflect straight on, smoothly enough for a
    flat mirror. What a texture or another node feeds counts as 1.

    A dielectric reflects more at grazing angles, and the coat of a Principled BSDF a little: neither counts, or every
    polished floor would be a mirror.
    """
    if node.bl_idname not in MIRROR_COLOURS:
        return 0.0

    def at_most(name: str) -> float:
        value = constant(node.inputs[name], groups)
        if isinstance(value, tuple):
            return sum(value[:3]) / 3.0
        return 1.0 if value is None else value

    roughness = constant(node.inputs["Roughness"], groups)
    if isinstance(roughness, float) and roughness > WARP_TUNING.max_roughness + ROUGHNESS_ROUNDING:
        return 0.0
    film = node.inputs.get("Thin Film Thickness")
    by_film = film is not None and not is_constant(film, groups, 0.0)
    if by_film or _has_refraction(node):
        return 1.0
    colour = at_most(MIRROR_COLOURS[node.bl_idname])
    if node.bl_idname != PRINCIPLED:
        return colour
    ior = constant(node.inputs["IOR"], groups)
    bare = ((ior - 1.0) / (ior + 1.0)) ** 2 if isinstance(ior, float) else 1.0
    dielectric = 2.0 * at_most("Specular IOR Level") * bare
    metallic = at_most("Metallic")
    return max(dielectric, metallic * colour + (1.0 - metallic) * dielectric)


def _principled(node: bpy.types.Node, groups: Groups) -> Shading:
    """Return the effects of a Principled BSDF, by its layers from the outermost inwards, as Cycles evaluates them."""

    def is_value(name: str, wanted: float) -> bool:
        return name in node.inputs and is_constant(node.inputs[name], groups, wanted)

    effects = NOTHING if is_value("Alpha", 1.0) else Effect.ALPHA
    if not (is_value("Coat Weight", 0.0) and is_value("Sheen Weight", 0.0) and is_value("Metallic", 0.0)):
        effects |= Effect.GLOSSY
    if is_value("Metallic", 1.0):
        return Shading(effects, effects & Effect.GLOSSY if _is_sharp(node, groups) else NOTHING)
    if not is_value("Transmission Weight", 0.0):
        effects |= Effect.TRANSMISSION | Effect.GLOSSY
    specular = not (is_value("Specular IOR Level", 0.0) or is_value("IOR", 1.0))
    if specular or not is_value("Thin Film Thickness", 0.0):
        effects |= Effect.GLOSSY
    thin = is_value("Thin Wall", 1.0)
    if not (is_value("Subsurface Weight", 0.0) or is_value("Subsurface Scale", 0.0) or thin):
        effects |= Effect.SUBSURFACE
    sharp = effects & (Effect.GLOSSY | Effect.TRANSMISSION) if _is_sharp(node, groups) else NOTHING
    return Shading(effects, sharp) | _rough_diffuse(node.inputs["Diffuse Roughness"], groups)


def _directional_emission(node: bpy.types.Node, groups: Groups, weighted: bool) -> Effect:
    """Return DIRECTIONAL_EMISSION if the closure shines and its strength, colour or share depends on the camera; else
    no effect. weighted is as for `_closure`.
    """
    names = {PRINCIPLED: ("Emission Color", "Emission Strength")}
    names |= dict.fromkeys(EMISSIONS, ("Color", "Strength"))
    if node.bl_idname not in names:
        return NOTHING
    sockets = [node.inputs[name] for name in names[node.bl_idname]]
    if any(is_constant(socket, groups, 0.0) for socket in sockets):
        return NOTHING
    return Effect.DIRECTIONAL_EMISSION if weighted or depends_on_camera(sockets, groups) else NOTHING


def _volume(socket: bpy.types.NodeSocket) -> Effect:
    """Return VOLUME if a shader that leaves anything of a volume feeds the socket; else no effect."""
    for source, inside in upstream([socket]):
        node = source.node
        if source.type != "SHADER" or node.bl_idname in ("ShaderNodeMixShader", "ShaderNodeAddShader"):
            continue
        names = VOLUME_SOURCES.get(node.bl_idname, ())
        if not names or not all(is_constant(node.inputs[name], inside, 0.0) for name in names):
            return Effect.VOLUME
    return NOTHING
