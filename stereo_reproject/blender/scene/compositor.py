"""The scene's compositing nodes: what they ask for, and those that write files of their own."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from ...images.passes import COLOUR_PASS

PASSIVE = {"CompositorNodeRLayers", "CompositorNodeComposite", "CompositorNodeViewer", "NodeGroupOutput"}
"""Nodes that hand the render through."""

FILE_OUTPUT = "CompositorNodeOutputFile"
RENDER_LAYERS = "CompositorNodeRLayers"
OF_A_SCENE = (RENDER_LAYERS, "CompositorNodeCryptomatteV2")
"""Nodes that show what a scene has rendered."""

PASS_OF_SOCKET = {"Image": COLOUR_PASS}
"""Sockets of a Render Layers node that are not called as their passes are."""

TYPES = {"VALUE": "VALUE", "VECTOR": "VECTOR", "RGBA": "COLOR"}
"""Types of passes, by the types of the sockets."""

OUTPUTS = ("CompositorNodeComposite", "NodeGroupOutput")


def compositor_tree(scene: bpy.types.Scene) -> bpy.types.NodeTree | None:
    """Return the scene's compositing nodes, of Blender 5 or 4.5; None where it has none."""
    if hasattr(scene, "compositing_node_group"):
        return scene.compositing_node_group
    return scene.node_tree if scene.use_nodes else None


def has_compositor(scene: bpy.types.Scene) -> bool:
    """Return whether the scene has compositing nodes that do more than pass the render through. Whether they are
    switched on in the render settings does not count.
    """
    tree = compositor_tree(scene)
    return tree is not None and any(node.bl_idname not in PASSIVE for node in tree.nodes)


def compositor_blocker(scene: bpy.types.Scene) -> str | None:
    """Return why the pair cannot go through the scene's compositor, in words; None if it can, or if there is none. A
    node that shows a view layer that is switched off is no reason: it shows nothing, as after any render.
    """
    if compositor_tree(scene) is None or not scene.render.use_compositing:
        return None
    nodes = [node for node in compositor_nodes(scene) if not node.mute]
    for node in nodes:
        if _shows_a_render(node) and node.scene not in (None, scene):
            return f"its node {node.name!r} shows the scene {node.scene.name!r}"
    if not gives_a_picture(scene) and not any(node.bl_idname == FILE_OUTPUT for node in nodes):
        return "nothing is linked to its output"
    return None


def is_composited(scene: bpy.types.Scene) -> bool:
    """Return whether the pair goes through the scene's compositor: it has one that is switched on and not blocked."""
    there = scene.render.use_compositing and compositor_tree(scene) is not None
    return there and compositor_blocker(scene) is None


def gives_a_picture(scene: bpy.types.Scene) -> bool:
    """Return whether anything is linked to the output of the scene's compositor."""
    tree = compositor_tree(scene)
    outputs = [] if tree is None else [node for node in tree.nodes if node.bl_idname in OUTPUTS]
    return any(socket.is_linked for node in outputs for socket in node.inputs)


def shows_a_render(scene: bpy.types.Scene) -> bool:
    """Return whether any node of the scene's compositor, unless muted, shows what a scene has rendered."""
    return any(_shows_a_render(node) for node in compositor_nodes(scene) if not node.mute)


def _shows_a_render(node: bpy.types.Node) -> bool:
    """Return whether a node of the compositor shows what a scene has rendered."""
    return node.bl_idname in OF_A_SCENE and getattr(node, "source", "RENDER") == "RENDER"


def wired_passes(scene: bpy.types.Scene) -> dict[str, dict[str, str]]:
    """Return the passes that linked sockets of the compositor show, by view layer: each pass's name with its type
    ("VALUE", "VECTOR" or "COLOR") as Blender's render engines have it.
    """
    wired: dict[str, dict[str, str]] = {}
    for node in compositor_nodes(scene):
        if node.bl_idname == RENDER_LAYERS:
            passes = wired.setdefault(node.layer, {})
            for socket in node.outputs:
                if socket.is_linked and socket.name != "Alpha":
                    passes[PASS_OF_SOCKET.get(socket.name, socket.name)] = TYPES.get(socket.type, "VALUE")
    return wired


def compositor_nodes(scene: bpy.types.Scene) -> Iterator[bpy.types.Node]:
    """Yield all nodes of the scene's compositor, those within groups too."""
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
    """Return the File Output nodes of the scene's compositor, which write files of their own."""
    return [node for node in compositor_nodes(scene) if node.bl_idname == FILE_OUTPUT]


@contextmanager
def file_outputs_muted(scene: bpy.types.Scene) -> Iterator[None]:
    """Mute the compositor's File Output nodes, for the time of a `with` block, so that only the result itself is made;
    those that were not muted before are on again afterwards, also after an error.
    """
    muted = [(node.id_data, node.name) for node in file_outputs(scene) if not node.mute]
    try:
        for tree, name in muted:
            tree.nodes[name].mute = True
        yield
    finally:
        for tree, name in muted:
            tree.nodes[name].mute = False
