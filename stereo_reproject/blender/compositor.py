"""The scene's compositing nodes: what they ask for, and those that write files of their own."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

PASSIVE = {"CompositorNodeRLayers", "CompositorNodeComposite", "CompositorNodeViewer", "NodeGroupOutput"}
"""Nodes that hand the render through."""

FILE_OUTPUT = "CompositorNodeOutputFile"
RENDER_LAYERS = "CompositorNodeRLayers"
OUTPUTS = ("CompositorNodeComposite", "NodeGroupOutput")


def compositor_tree(scene: bpy.types.Scene) -> bpy.types.NodeTree | None:
    if hasattr(scene, "compositing_node_group"):
        return scene.compositing_node_group
    return scene.node_tree if scene.use_nodes else None


def has_compositor(scene: bpy.types.Scene) -> bool:
    """Whether the compositing nodes do more than hand the render through."""
    tree = compositor_tree(scene)
    return tree is not None and any(node.bl_idname not in PASSIVE for node in tree.nodes)


def compositor_blocker(scene: bpy.types.Scene) -> str | None:
    """Why the pair cannot go through the scene's compositor, or None."""
    tree = compositor_tree(scene)
    if tree is None or not scene.render.use_compositing:
        return None
    rendered = next((layer.name for layer in scene.view_layers if layer.use), None)
    for node in compositor_nodes(scene):
        if node.bl_idname != RENDER_LAYERS or node.mute:
            continue
        if node.scene not in (None, scene):
            return f"its node {node.name!r} shows the scene {node.scene.name!r}"
        if node.layer != rendered:
            return f"its node {node.name!r} shows the view layer {node.layer!r}, and only {rendered!r} is rendered"
    outputs = [node for node in tree.nodes if node.bl_idname in OUTPUTS]
    if not any(socket.is_linked for node in outputs for socket in node.inputs):
        return "nothing is linked to its output"
    return None


def compositor_nodes(scene: bpy.types.Scene) -> Iterator[bpy.types.Node]:
    """All nodes of the scene's compositor, those in groups too."""
    trees, seen = [compositor_tree(scene)], set()
    while trees:
        tree = trees.pop()
        if tree is None or tree in seen:
            continue
        seen.add(tree)
        for node in tree.nodes:
            yield node
            if hasattr(node, "node_tree"):
                trees.append(node.node_tree)


def file_outputs(scene: bpy.types.Scene) -> list[bpy.types.Node]:
    """The nodes that write files."""
    return [node for node in compositor_nodes(scene) if node.bl_idname == FILE_OUTPUT]


@contextmanager
def file_outputs_muted(scene: bpy.types.Scene) -> Iterator[None]:
    """Nothing is written but the result: for what is rendered to be looked at."""
    muted = [(node.id_data, node.name) for node in file_outputs(scene) if not node.mute]
    try:
        for tree, name in muted:
            tree.nodes[name].mute = True
        yield
    finally:
        for tree, name in muted:
            tree.nodes[name].mute = False
