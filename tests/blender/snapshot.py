"""Everything of the open file by value, to be compared before and after."""

import warnings

import bpy


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


def everything():
    """All scenes, cameras and objects by value, with what a scene keeps in lists, and the names of all other blocks."""
    found = {}
    with warnings.catch_warnings():
        # Some of what is read is on its way out of Blender.
        warnings.simplefilter("ignore")
        for prop in bpy.data.bl_rna.properties:
            if prop.type == "COLLECTION":
                for block in getattr(bpy.data, prop.identifier):
                    by_value = isinstance(block, bpy.types.Scene | bpy.types.Camera | bpy.types.Object)
                    found[prop.identifier, block.name] = values_of(block) if by_value else None
        for scene in bpy.data.scenes:
            for owner, name in ((scene, "view_layers"), (scene.render, "views"), (scene, "timeline_markers")):
                for item in getattr(owner, name):
                    found[scene.name, name, item.name] = values_of(item, 1)
    for kind in ("images", "all_ids"):
        found.pop((kind, "Render Result"), None)
    return found
