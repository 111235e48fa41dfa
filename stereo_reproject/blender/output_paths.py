"""Where a scene's files go: the output path of a render, and those of File Output nodes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

from ..errors import BadInputError
from ..exr import VIEWS
from .render import output_path
from .scene import changed

BLEND_FOLDER = "{blend_dir}"

FILE_OUTPUT = "CompositorNodeOutputFile"


def write_beside(scene: bpy.types.Scene, original: Path) -> None:
    """Have the open file, a copy of `original`, write where that would."""
    scene.render.filepath = _beside(scene.render.filepath, original)
    for node in file_outputs(scene):
        for name in ("base_path", "directory"):
            if hasattr(node, name):
                setattr(node, name, _beside(getattr(node, name), original))


def _beside(path: str, original: Path) -> str:
    folder = output_path(original.parent)
    if path.startswith("//"):
        path = f"{folder}/{path[2:]}"
    return path.replace(BLEND_FOLDER, folder)


def file_outputs(scene: bpy.types.Scene) -> Iterator[bpy.types.Node]:
    """The nodes of the scene's compositor that write files, those in groups too."""
    if hasattr(scene, "compositing_node_group"):
        tree = scene.compositing_node_group
    else:
        tree = scene.node_tree if scene.use_nodes else None
    trees, seen = [tree], set()
    while trees:
        tree = trees.pop()
        if tree is None or tree in seen:
            continue
        seen.add(tree)
        for node in tree.nodes:
            if node.bl_idname == FILE_OUTPUT:
                yield node
            elif hasattr(node, "node_tree"):
                trees.append(node.node_tree)


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


def output_files(scene: bpy.types.Scene, frame: int, *, span: range | None = None) -> tuple[Path, list[Path]]:
    """Where a frame's pair is written by the scene's own settings: the file's path without a view's suffix, and all of
    its files. A movie's are the same for all frames of its span, and named by that.

    Raises BadInputError when the output path cannot be used.
    """
    render = scene.render
    if not getattr(render, "save_output", True):
        raise BadInputError("Output is switched off in Output properties: no file of an animation would be written")
    if render.filepath.startswith("//") and not bpy.data.filepath:
        raise BadInputError("the output path is relative to a file that was never saved: save it, or change the path")
    ends = {} if span is None else {"frame_start": span[0], "frame_end": span[-1]}
    try:
        with changed(render, use_multiview=True), changed(scene, **ends):
            plain = Path(render.frame_path(frame=frame))
            if render.image_settings.views_format != "INDIVIDUAL":
                return plain, [plain]
            return plain, [Path(render.frame_path(frame=frame, view=view)) for view in VIEWS]
    except RuntimeError as error:
        raise BadInputError(f"the output path cannot be used: {' '.join(str(error).split())}") from error
