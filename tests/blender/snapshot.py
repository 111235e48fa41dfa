"""Everything of the open file by value, to be compared before and after."""

import warnings

import bpy

RESULTS = ("Render Result", "Viewer Node")
OF_THE_WINDOW = ("window_managers", "screens", "workspaces", "all_ids")


def values_of(block, depth=3):
    """All that RNA tells of a datablock, and of what belongs to it."""
    found = {}
    for prop in getattr(block, "bl_rna", block.rna_type).properties:
        name = prop.identifier
        if name in ("rna_type", "original", "depsgraph", "bl_rna") or prop.type == "COLLECTION":
            continue
        value = getattr(block, name)
        if prop.type != "POINTER":
            found[name] = tuple(value) if getattr(prop, "is_array", False) else value
        elif value is None or isinstance(value, bpy.types.ID):
            found[name] = None if value is None else value.name
        elif depth and hasattr(value, "bl_rna"):
            found[name] = values_of(value, depth - 1)
    return found


def tree_of(block):
    """A datablock's node tree, which is itself one or is embedded in it."""
    if isinstance(block, bpy.types.NodeTree):
        return block
    tree = getattr(block, "node_tree", None)
    return tree if isinstance(tree, bpy.types.NodeTree) else None


def nodes_of(tree):
    """The nodes by value, with what their sockets hold, and the links."""
    found = {}
    for node in tree.nodes:
        found[node.name] = values_of(node, 1)
        found[node.name, "inputs"] = [values_of(socket, 0) for socket in node.inputs]
    found["links"] = [
        (link.from_node.name, link.from_socket.name, link.to_node.name, link.to_socket.name, link.is_valid)
        for link in tree.links
    ]
    return found


def everything():
    """All datablocks by value, with their nodes and with what a scene keeps in lists; but for what a window looks at,
    and for what shows the last result."""
    found = {}
    with warnings.catch_warnings():
        # Some of what is read is on its way out of Blender.
        warnings.simplefilter("ignore")
        for prop in bpy.data.bl_rna.properties:
            if prop.type != "COLLECTION" or prop.identifier in OF_THE_WINDOW:
                continue
            for block in getattr(bpy.data, prop.identifier):
                if block.name in RESULTS:
                    continue
                library = block.library.name if block.library else None
                found[prop.identifier, block.name, library] = values_of(block)
                tree = tree_of(block)
                if tree is not None:
                    found[prop.identifier, block.name, library, "nodes"] = nodes_of(tree)
        for scene in bpy.data.scenes:
            for owner, name in ((scene, "view_layers"), (scene.render, "views"), (scene, "timeline_markers")):
                for item in getattr(owner, name):
                    found[scene.name, name, item.name] = values_of(item, 1)
    return found
