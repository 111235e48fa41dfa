"""Which effects a scene calls for that make a surface look different from each eye: only then are probes traced."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from .scene import evaluated

SAME_FROM_EVERYWHERE = {
    "ShaderNodeBsdfDiffuse",
    "ShaderNodeBsdfTranslucent",
    "ShaderNodeEmission",
    "ShaderNodeBackground",
    "ShaderNodeMixShader",
    "ShaderNodeAddShader",
    "ShaderNodeHoldout",
}
"""Shaders whose light does not depend on where it is seen from."""

DEPENDS_ON_THE_VIEW = {
    "ShaderNodeLightPath",
    "ShaderNodeLayerWeight",
    "ShaderNodeFresnel",
    "ShaderNodeCameraData",
    "ShaderNodeScript",
}
"""Inputs that tell a shader where it is seen from, and may make any shader depend on it."""


OUTPUTS_THAT_DEPEND_ON_THE_VIEW = {
    "ShaderNodeNewGeometry": ("Incoming",),
    "ShaderNodeTexCoord": ("Reflection", "Camera", "Window"),
}


def view_dependent_effects(scene: bpy.types.Scene) -> tuple[str, ...]:
    """What may make a warped pixel wrong, in words: empty for a scene that is diffuse throughout.

    Everything in the file that is used counts: instances and geometry nodes bring in what no scene lists, and a probe
    too many costs little.
    """
    effects: dict[str, None] = {}
    if evaluated(scene.camera, scene).data.dof.use_dof:
        effects["depth of field"] = None
    if scene.render.use_motion_blur:
        effects["motion blur"] = None
    if scene.world is not None and _volume(scene.world):
        effects["a world volume"] = None
    for item in bpy.data.objects:
        if item.type in ("CURVES", "VOLUME", "POINTCLOUD") or item.particle_systems:
            effects[f"{item.type.lower()} {item.name!r}"] = None
    for material in bpy.data.materials:
        if material.users > 0 and not material.is_grease_pencil and _view_dependent(material):
            effects[f"material {material.name!r}"] = None
    return tuple(effects)


def is_animated(owner: bpy.types.ID) -> bool:
    """Whether anything of the datablock changes with time."""
    animation = owner.animation_data
    return animation is not None and (
        animation.action is not None or len(animation.drivers) > 0 or len(animation.nla_tracks) > 0
    )


def has_grease_pencil(scene: bpy.types.Scene) -> bool:
    return any(item.type == "GREASEPENCIL" and not item.hide_render for item in scene.objects)


def uses_output(node_type: str, output: str) -> bool:
    """Whether any shader of the file makes use of this output of a node of this type."""
    owners = [*bpy.data.materials, *bpy.data.worlds, *bpy.data.lights]
    trees = [owner.node_tree for owner in owners if owner.node_tree is not None] + list(bpy.data.node_groups)
    nodes = (node for tree in trees for node in tree.nodes if node.bl_idname == node_type)
    return any(node.outputs[output].is_linked for node in nodes)


def _view_dependent(material: bpy.types.Material) -> bool:
    if material.node_tree is None:
        return material.metallic > 0.0 or material.specular_intensity > 0.0
    return any(_node_depends(node) for node in _nodes(material.node_tree)) or _volume(material)


def _node_depends(node: bpy.types.Node) -> bool:
    telling = OUTPUTS_THAT_DEPEND_ON_THE_VIEW.get(node.bl_idname, ())
    if node.bl_idname in DEPENDS_ON_THE_VIEW or any(node.outputs[name].is_linked for name in telling):
        return True
    shades = any(socket.type == "SHADER" for socket in node.outputs)
    return shades and node.bl_idname not in SAME_FROM_EVERYWHERE and node.bl_idname != "ShaderNodeGroup"


def _nodes(tree: bpy.types.NodeTree) -> Iterator[bpy.types.Node]:
    """The tree's nodes, those of its groups included, as far as anything is made of them."""
    for node in tree.nodes:
        if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None:
            yield from _nodes(node.node_tree)
        elif any(socket.is_linked for socket in node.outputs):
            yield node


def _volume(owner: bpy.types.Material | bpy.types.World) -> bool:
    if owner.node_tree is None:
        return False
    outputs = (node for node in owner.node_tree.nodes if "Output" in node.bl_idname)
    return any(node.inputs["Volume"].is_linked for node in outputs if "Volume" in node.inputs)
