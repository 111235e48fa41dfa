"""The paths of a scene's files: the output path of a render, and those of File Output nodes."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

import bpy

from ...errors import BadInputError
from ...images.exr import VIEWS
from ...words import Words
from ..engines.render import output_path
from ..scene.compositor import file_outputs
from ..scene.working import changed

BLEND_FOLDER = "{blend_dir}"


def write_beside(scene: bpy.types.Scene, original: Path) -> None:
    """Have the open file, which is a copy of `original`, write where that would: its output path and File Output nodes
    that are relative to the file now point to the folder of the original.
    """
    scene.render.filepath = _beside(scene.render.filepath, original)
    for node in file_outputs(scene):
        for name in ("base_path", "directory"):
            if hasattr(node, name):
                setattr(node, name, _beside(getattr(node, name), original))


def _beside(path: str, original: Path) -> str:
    """Return an output path in which the original's folder stands in place of // and of the .blend's folder."""
    folder = output_path(original.parent)
    if path.startswith("//"):
        path = f"{folder}/{path[2:]}"
    return path.replace(BLEND_FOLDER, folder)


def check_file_outputs(scene: bpy.types.Scene) -> None:
    """Raise BadInputError when a File Output node of the scene would write beside a file that was never saved."""
    if not scene.render.use_compositing:
        return
    for node in file_outputs(scene):
        folder = getattr(node, "directory", getattr(node, "base_path", ""))
        if not node.mute and needs_a_saved_file(folder):
            raise BadInputError(
                Words(
                    "the compositing node {node} writes beside a file that was never saved: save it, or mute that",
                    node=repr(node.name),
                )
            )


def needs_a_saved_file(path: str) -> bool:
    """Return whether an output path is relative to the .blend, and the open file was never saved."""
    return not bpy.data.filepath and (path.startswith("//") or BLEND_FOLDER in path)


def output_name(scene: bpy.types.Scene) -> str:
    """Return the last part of the scene's output path: what the names of its files begin with, before Blender adds
    frame, view and extension. Templates stay for Blender to fill in; of one that stands for folders, only the last part
    counts.
    """
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
    """Return the text that a template of the output path, such as {blend_name}, stands for; the template itself where
    Blender does not know it.
    """
    bare = {"use_multiview": False, "use_file_extension": False}
    try:
        with changed(scene.render, filepath=f"{NOWHERE}/{template}", **bare):
            path = scene.render.frame_path(frame=0)
    except RuntimeError:
        # It is said of the whole path.
        return template
    return path.removeprefix(f"{NOWHERE}/").removesuffix("0000")


def _literal(text: str) -> str:
    """Return the text with its braces doubled, so that Blender does not take them for a template."""
    return text.replace("{", "{{").replace("}", "}}")


MOVIE_EXTENSION = re.compile(r"\.(mp4|m4v|mov|mkv|webm|avi|ogv|ogg|mpg|mpeg|flv|dv)$", re.IGNORECASE)


def without_movie_extension(scene: bpy.types.Scene) -> str:
    """Return `output_name`, without the extension if it is the name of a movie and already has one."""
    name = output_name(scene)
    return MOVIE_EXTENSION.sub("", name) if scene.render.is_movie_format else name


def output_stem(scene: bpy.types.Scene) -> str:
    """Return the text that the names of the frames' files begin with: templates filled in, and without the # that stand
    for the frame's number. The scene's format must be one of pictures, and its path must have passed `output_files`.
    """
    unnumbered = f"{NOWHERE}/{output_name(scene).replace('#', '')}"
    with changed(scene.render, filepath=unnumbered, use_multiview=False, use_file_extension=False):
        return Path(scene.render.frame_path(frame=0)).name.removesuffix("0000")


def output_files(
    scene: bpy.types.Scene,
    frames: Iterable[int],
    *,
    folder: str | None = None,
    span: range | None = None,
    mono: bool = False,
) -> dict[int, list[Path]]:
    """Return, by frame number, the files that each frame's pair is written to by the scene's own settings: one, or one
    for each eye; with mono, the file of its one view.

    folder, if given, replaces the scene's own folder. span is given for a movie: the range of frames that Blender puts
    into its name; each frame then has the movie's path. Raises BadInputError when the output path cannot be used, and
    when two eyes would go into one file.
    """
    render = scene.render
    if not getattr(render, "save_output", True):
        raise BadInputError("Output is switched off in Output properties: no file of an animation would be written")
    if needs_a_saved_file(render.filepath):
        raise BadInputError("the output path is relative to a file that was never saved: save it, or change the path")
    apart = render.image_settings.views_format == "INDIVIDUAL" and not mono
    if apart:
        _check_suffixes(render)
    ends = {} if span is None else {"frame_start": span.start, "frame_end": span.stop - 1}
    views = [{"view": view} for view in VIEWS] if apart else [{}]

    def place(path: str) -> Path:
        return Path(path if folder is None else f"{folder}/{SEPARATOR.split(path)[-1]}")

    try:
        with changed(render, use_multiview=not mono), changed(scene, **ends):
            files = {frame: [place(render.frame_path(frame=frame, **view)) for view in views] for frame in frames}
    except RuntimeError as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ")
        raise BadInputError(Words("the output path cannot be used: {reason}", reason=reason)) from error
    if len(views) > 1 and span is None:
        _check_apart(files)
    return files


def _check_apart(files: Mapping[int, list[Path]]) -> None:
    """Raise BadInputError where two eyes would go into one file: because views have the same suffix, or because a
    suffix of digits makes a name that of another frame. Names that differ in case alone count as one, since on many
    drives they are.
    """
    owners: dict[str, Words] = {}
    for frame, paths in files.items():
        for view, path in zip(VIEWS, paths, strict=True):
            eye = Words("the {view} eye of frame {frame}", view=Words(view), frame=frame)
            other = owners.setdefault(str(path).casefold(), eye)
            if other != eye:
                raise BadInputError(
                    Words(
                        "{other} and {eye} would go into the same file, {name}: change the file suffix of a view in"
                        " Output > Stereoscopy",
                        other=other,
                        eye=eye,
                        name=path.name,
                    )
                )


def _check_suffixes(render: bpy.types.RenderSettings) -> None:
    """Raise BadInputError where the suffix of a view's file names has a slash, which would lead into another folder."""
    for view in render.views:
        if view.name in VIEWS and SEPARATOR.search(view.file_suffix):
            raise BadInputError(
                Words(
                    "the file suffix {suffix} of the view {view} leads to another folder: change it in Output >"
                    " Stereoscopy",
                    suffix=repr(view.file_suffix),
                    view=repr(view.name),
                )
            )
