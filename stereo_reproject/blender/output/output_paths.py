"""The paths of a scene's files: the output path of a render, and those of File Output nodes."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

import bpy

from ...errors import BadInputError
from ...images.exr import VIEWS
from ..engines.render import output_path
from ..scene.compositor import file_outputs
from ..scene.working import changed

BLEND_FOLDER = "{blend_dir}"


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


def check_file_outputs(scene: bpy.types.Scene) -> None:
    """Raises BadInputError when a File Output node would write beside a file that was never saved."""
    if not scene.render.use_compositing:
        return
    for node in file_outputs(scene):
        folder = getattr(node, "directory", getattr(node, "base_path", ""))
        if not node.mute and _needs_a_saved_file(folder):
            raise BadInputError(
                f"the compositing node {node.name!r} writes beside a file that was never saved: save it, or mute that"
            )


def _needs_a_saved_file(path: str) -> bool:
    return not bpy.data.filepath and (path.startswith("//") or BLEND_FOLDER in path)


def output_name(scene: bpy.types.Scene) -> str:
    """The last part of the scene's output path, to which Blender adds frame, view and extension: the beginning of a
    file's name and nothing else, whatever the path's templates stand for."""
    last = SEPARATOR.split(scene.render.filepath)[-1]
    name = ""
    for part in TEMPLATE.split(last):
        *folders, rest = SEPARATOR.split(_filled_in(scene, part) if TEMPLATE.fullmatch(part) else part)
        # What a template says of folders is the path's; without any it is left for Blender to fill in.
        name = _literal(rest) if folders else name + part
    return "" if name == os.pardir else name


SEPARATOR = re.compile(r"[/\\]")

TEMPLATE = re.compile(r"(?<!\{)(\{[^{}]*\})(?!\})")
"""One of Blender's, and none of the braces that stand for themselves."""

NOWHERE = "/frames"
"""A folder that no file is written to: for a name's sake."""


def _filled_in(scene: bpy.types.Scene, template: str) -> str:
    """The text that a template of the output path stands for; the template itself where Blender knows none."""
    bare = {"use_multiview": False, "use_file_extension": False}
    try:
        with changed(scene.render, filepath=f"{NOWHERE}/{template}", **bare):
            path = scene.render.frame_path(frame=0)
    except RuntimeError:
        # It is said of the whole path.
        return template
    return path.removeprefix(f"{NOWHERE}/").removesuffix("0000")


def _literal(text: str) -> str:
    return text.replace("{", "{{").replace("}", "}}")


MOVIE_EXTENSION = re.compile(r"\.(mp4|m4v|mov|mkv|webm|avi|ogv|ogg|mpg|mpeg|flv|dv)$", re.IGNORECASE)


def without_movie_extension(scene: bpy.types.Scene) -> str:
    """`output_name`, in which the name of a movie may have its extension already."""
    name = output_name(scene)
    return MOVIE_EXTENSION.sub("", name) if scene.render.is_movie_format else name


def output_stem(scene: bpy.types.Scene) -> str:
    """Return the path as the names of frames begin: its templates filled in, and without the # for the frame's number.

    The scene's format is one of pictures, and `output_files` have been found.
    """
    unnumbered = f"{NOWHERE}/{output_name(scene).replace('#', '')}"
    with changed(scene.render, filepath=unnumbered, use_multiview=False, use_file_extension=False):
        return Path(scene.render.frame_path(frame=0)).name.removesuffix("0000")


def output_files(
    scene: bpy.types.Scene, frames: Iterable[int], *, folder: str | None = None, span: range | None = None
) -> dict[int, list[Path]]:
    """The files that the pair of each frame is written to by the scene's own settings. A movie's are the same for all
    frames of its span, and named by that. They lie in `folder`, wherever the scene would write them, unless it is None.

    Raises BadInputError when the output path cannot be used, and when two eyes would go into one file.
    """
    render = scene.render
    if not getattr(render, "save_output", True):
        raise BadInputError("Output is switched off in Output properties: no file of an animation would be written")
    if _needs_a_saved_file(render.filepath):
        raise BadInputError("the output path is relative to a file that was never saved: save it, or change the path")
    if render.image_settings.views_format == "INDIVIDUAL":
        _check_suffixes(render)
    ends = {} if span is None else {"frame_start": span.start, "frame_end": span.stop - 1}
    views = [{}] if render.image_settings.views_format != "INDIVIDUAL" else [{"view": view} for view in VIEWS]

    def place(path: str) -> Path:
        return Path(path if folder is None else f"{folder}/{SEPARATOR.split(path)[-1]}")

    try:
        with changed(render, use_multiview=True), changed(scene, **ends):
            files = {frame: [place(render.frame_path(frame=frame, **view)) for view in views] for frame in frames}
    except RuntimeError as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ")
        raise BadInputError(f"the output path cannot be used: {reason}") from error
    if len(views) > 1 and span is None:
        _check_apart(files)
    return files


def _check_apart(files: Mapping[int, list[Path]]) -> None:
    """Raises BadInputError where two eyes have one file: by equal suffixes, or by a suffix of digits, with which a
    frame's name is that of another frame.

    Names that differ in case alone count as one wherever the files go: on many drives they are, and frames are copied.
    """
    owners: dict[str, str] = {}
    for frame, paths in files.items():
        for view, path in zip(VIEWS, paths, strict=True):
            eye = f"the {view} eye of frame {frame}"
            other = owners.setdefault(str(path).casefold(), eye)
            if other != eye:
                raise BadInputError(
                    f"{other} and {eye} would go into the same file, {path.name}: change the file suffix of a view in"
                    " Output > Stereoscopy"
                )


def _check_suffixes(render: bpy.types.RenderSettings) -> None:
    """Raises BadInputError where the end of an eye's file name is not part of a name but leads to another folder."""
    for view in render.views:
        if view.name in VIEWS and SEPARATOR.search(view.file_suffix):
            raise BadInputError(
                f"the file suffix {view.file_suffix!r} of the view {view.name!r} leads to another folder:"
                " change it in Output > Stereoscopy"
            )
