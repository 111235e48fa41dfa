"""Parts of a scene that read its picture's size or the camera's lens: a packed render has others, and looks different.

A driver reads the scene that is rendered only by a context property, by Python, or as the scene's own: one that names a
scene reads the user's, which nothing changes, and one that names a camera reads the user's camera.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator

import bpy

PYTHON = re.compile(r"\b(bpy|depsgraph)\b")
CAMERA_INFO = "GeometryNodeCameraInfo"


def what_reads(scene: bpy.types.Scene, paths: Collection[str]) -> str | None:
    """Return what reads one of these properties of a working scene, in words; None if nothing does. paths are from the
    scene, as drivers name them, such as "render.resolution_x".

    Geometry nodes and constraints that read the camera or the picture's shape count as reading all of them.
    """
    for block, owner in _driven(scene):
        for curve in owner.animation_data.drivers:
            if not curve.mute and _reads(curve.driver, block, scene, paths):
                kind = block.bl_rna.name.lower()
                return f"a driver of {kind} {block.name!r} reads the picture's size or the camera"
    for tree in bpy.data.node_groups:
        if tree.users and any(_is_used(node) for node in tree.nodes if node.bl_idname == CAMERA_INFO):
            return f"geometry nodes {tree.name!r} read the camera by Camera Info"
    for item in scene.objects:
        if any(constraint.type == "FOLLOW_TRACK" and constraint.enabled for constraint in item.constraints):
            return f"object {item.name!r} follows a track by the camera and the picture's shape"
    return None


def _is_used(node: bpy.types.Node) -> bool:
    """Return whether a node is on and any of its outputs is linked."""
    return not node.mute and any(output.is_linked for output in node.outputs)


def _driven(scene: bpy.types.Scene) -> Iterator[tuple[bpy.types.ID, bpy.types.ID]]:
    """Yield the datablocks that have drivers, each with the owner of the drivers: itself or its own node tree. Of
    scenes, only the working scene is looked at.
    """
    lists = (prop.identifier for prop in bpy.data.bl_rna.properties if prop.type == "COLLECTION")
    for name in lists:
        for block in getattr(bpy.data, name) if name != "scenes" else [scene]:
            for owner in (block, getattr(block, "node_tree", None)):
                animation = getattr(owner, "animation_data", None)
                if owner is not None and animation is not None and len(animation.drivers) > 0:
                    yield block, owner


def _reads(driver: bpy.types.Driver, block: bpy.types.ID, scene: bpy.types.Scene, paths: Collection[str]) -> bool:
    """Return whether a driver of `block` reads any of the scene's properties of these paths. A Python expression counts
    if it has the name of one.
    """
    if driver.type == "SCRIPTED" and PYTHON.search(driver.expression):
        names = {path.rpartition(".")[2] for path in paths}
        return any(re.search(rf"\b{name}\b", driver.expression) for name in names)
    return any(
        _path(target, variable.type, block, scene) in paths
        for variable in driver.variables
        for target in variable.targets
    )


def _path(target: bpy.types.DriverTarget, kind: str, block: bpy.types.ID, scene: bpy.types.Scene) -> str | None:
    """Return the path, such as "render.resolution_x", of the working scene's property that a variable of a driver
    reads; None where it reads anything else. target is one of the variable's targets, kind its type, block the
    datablock that has the driver.
    """
    if kind == "CONTEXT_PROP" or (kind == "SINGLE_PROP" and target.id == scene):
        return target.data_path
    own = kind == "SINGLE_PROP" and block == scene.camera and target.id == block
    return f"camera.{target.data_path}" if own else None
