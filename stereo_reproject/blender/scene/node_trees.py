"""Node trees followed backwards: from a socket to what feeds it, through reroutes, muted nodes and groups."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

Groups = tuple[bpy.types.Node, ...]
"""The group nodes that one is inside of, the outermost first."""

Value = float | tuple[float, ...]

AS_CAMERA_RAYS_SEE = {
    "Is Camera Ray": 1.0,
    "Is Shadow Ray": 0.0,
    "Is Diffuse Ray": 0.0,
    "Is Glossy Ray": 0.0,
    "Is Singular Ray": 0.0,
    "Is Reflection Ray": 0.0,
    "Is Transmission Ray": 0.0,
    "Is Volume Scatter Ray": 0.0,
    "Ray Depth": 0.0,
    "Diffuse Depth": 0.0,
    "Glossy Depth": 0.0,
    "Transmission Depth": 0.0,
    "Portal Depth": 0.0,
}
"""Outputs of Light Path where a camera ray meets a surface: the same for both eyes. Their values for reflections and
shadows belong to the surface that reflects or is lit."""

CAMERA_DEPENDENT_OUTPUTS: dict[str, tuple[str, ...] | None] = {
    "ShaderNodeLightPath": ("Ray Length", "Transparent Depth"),
    "ShaderNodeTexCoord": ("Camera", "Window", "Reflection"),
    "ShaderNodeNewGeometry": ("Incoming",),
    "ShaderNodeHairInfo": ("Tangent Normal",),
    "ShaderNodeLayerWeight": None,
    "ShaderNodeFresnel": None,
    "ShaderNodeCameraData": None,
    "ShaderNodeScript": None,
    "ShaderNodeShaderToRGB": None,
}
"""Nodes from which a shader knows where it is seen from, and their outputs that say so (None: all of them)."""

WORLD_OUTPUTS: dict[str, tuple[str, ...] | None] = {
    "ShaderNodeTexCoord": ("Camera", "Window"),
    "ShaderNodeCameraData": None,
    "ShaderNodeScript": None,
}
"""Outputs of nodes that depend on the camera in a world's shader, in which both eyes see the same in the same
direction, whatever is made of that direction."""

GROUPS = (bpy.types.ShaderNodeGroup, bpy.types.ShaderNodeCustomGroup)


def origin(socket: bpy.types.NodeSocket, groups: Groups = ()) -> tuple[bpy.types.NodeSocket | None, Groups]:
    """Return what feeds an input: an output of the node that does something, or the unlinked input whose own value
    counts. None where a muted node or an empty group lets nothing through.

    groups are the group nodes that the socket is inside of. Those that the result is inside of are returned with it.
    """
    current: bpy.types.NodeSocket | None = socket
    while current is not None:
        if not current.is_output:
            # To list a socket's links Blender looks through all of the tree.
            links = (current.links or ()) if current.is_linked else ()
            link = next((link for link in links if _works(link)), None)
            if link is None:
                return current, groups
            current = link.from_socket
            continue
        node = current.node
        if node.mute:
            current = next((link.from_socket for link in node.internal_links if link.to_socket == current), None)
        elif node.bl_idname == "NodeReroute":
            current = node.inputs[0]
        elif isinstance(node, GROUPS):
            current, groups = _group_result(node, current.identifier), (*groups, node)
        elif node.bl_idname == "NodeGroupInput" and groups:
            current, groups = _by_identifier(groups[-1].inputs, current.identifier), groups[:-1]
        else:
            return current, groups
    return None, groups


def _works(link: bpy.types.NodeLink) -> bool:
    """Return whether a link carries a value: it is valid, not muted, and comes from a socket in use."""
    return link.is_valid and not link.is_muted and link.from_socket.enabled


def _group_result(node: bpy.types.Node, identifier: str) -> bpy.types.NodeSocket | None:
    """Return the input of the group's output node that feeds its output of this identifier; None where there is
    none.
    """
    tree = node.node_tree
    if tree is None:
        return None
    results = [inner for inner in tree.nodes if inner.bl_idname == "NodeGroupOutput"]
    result = next((inner for inner in results if inner.is_active_output), None)
    return None if result is None else _by_identifier(result.inputs, identifier)


def _by_identifier(sockets: bpy.types.bpy_prop_collection, identifier: str) -> bpy.types.NodeSocket | None:
    """Return the socket of this identifier; None where there is none."""
    return next((socket for socket in sockets if socket.identifier == identifier), None)


def constant(socket: bpy.types.NodeSocket, groups: Groups = ()) -> Value | None:
    """Return the socket's value, a number or a tuple, where it is the same all over the surface as camera rays see it;
    None where it may vary. groups is as for `origin`.
    """
    source, inside = origin(socket, groups)
    if source is None:
        return None
    if source.is_output:
        if source.node.bl_idname == "ShaderNodeLightPath":
            return AS_CAMERA_RAYS_SEE.get(source.name)
        if source.node.bl_idname == "ShaderNodeMath" and source.node.operation == "MULTIPLY":
            # glTF's importer multiplies a texture by a factor that is often 0.
            return 0.0 if any(is_constant(factor, inside, 0.0) for factor in source.node.inputs[:2]) else None
        if source.node.bl_idname not in ("ShaderNodeValue", "ShaderNodeRGB"):
            return None
    value = getattr(source, "default_value", None)
    if isinstance(value, (bool, int, float)):
        return float(value)
    return tuple(value) if source.type in ("RGBA", "VECTOR") and value is not None else None


def is_constant(socket: bpy.types.NodeSocket, groups: Groups, wanted: float, *, slack: float = 1e-5) -> bool:
    """Return whether a socket has this value all over the surface, within Cycles' own slack. A colour counts only as 0,
    when it is black. groups is as for `origin`.
    """
    value = constant(socket, groups)
    if value is None:
        return False
    if isinstance(value, tuple):
        return wanted == 0.0 and max(value[:3]) <= slack
    return abs(value - wanted) <= slack


def is_fed(socket: bpy.types.NodeSocket, groups: Groups = ()) -> bool:
    """Return whether a node feeds the socket, so that its own value does not count. groups is as for `origin`."""
    source, _ = origin(socket, groups)
    return source is not None and source.is_output


def upstream(sockets: list[bpy.types.NodeSocket], groups: Groups = ()) -> Iterator[tuple[bpy.types.NodeSocket, Groups]]:
    """Yield each output that takes part in feeding the sockets, once, with the group nodes that its node is inside of.
    groups are those that the sockets are inside of.
    """
    waiting = [(socket, groups) for socket in sockets if socket.is_output or socket.is_linked]
    met = set()
    while waiting:
        source, inside = origin(*waiting.pop())
        if source is None or not source.is_output:
            continue
        key = (source.node.as_pointer(), source.identifier, *(group.as_pointer() for group in inside))
        if key in met:
            continue
        met.add(key)
        yield source, inside
        waiting.extend((socket, inside) for socket in source.node.inputs if socket.is_linked and socket.enabled)


def depends_on_camera(
    sockets: list[bpy.types.NodeSocket],
    groups: Groups = (),
    outputs: dict[str, tuple[str, ...] | None] = CAMERA_DEPENDENT_OUTPUTS,
) -> bool:
    """Return whether the value of any of the sockets may differ between the eyes at the same point. outputs are those
    of nodes that depend on the camera; groups is as for `origin`.
    """
    return any(_tells(source, outputs) for source, _ in upstream(sockets, groups))


def _tells(source: bpy.types.NodeSocket, outputs: dict[str, tuple[str, ...] | None]) -> bool:
    """Return whether this output of a node tells the shader where it is seen from."""
    node = source.node
    if node.bl_idname == "ShaderNodeVectorTransform":
        return "CAMERA" in (node.convert_from, node.convert_to)
    if node.bl_idname == "ShaderNodeWireframe":
        return node.use_pixel_size
    if node.bl_idname not in outputs:
        return False
    names = outputs[node.bl_idname]
    return names is None or source.name in names
