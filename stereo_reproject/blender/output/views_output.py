"""The folder for the files of many views, by the scene's own output path."""

from __future__ import annotations

import re
from pathlib import Path

import bpy

from ...errors import BadInputError
from ...words import Words
from ..scene.working import changed
from .output_paths import MOVIE_EXTENSION, SEPARATOR, needs_a_saved_file

SUFFIX = "_views"
"""End of the folder's name, after that of the frame."""

FRAME_TO_ITSELF = re.compile(r"(\d+)-\1$")
"""End of a movie's name, which has the first and the last frame; here both are the same."""


def views_folder(scene: bpy.types.Scene, frame: int) -> Path:
    """Return the absolute path of the folder for the views of a frame: beside the frame's picture as the scene's output
    path would name it, and called so, as in shot_0007_views. A path without a name of its own begins with that of the
    .blend. Raises BadInputError where the path cannot be used.
    """
    render = scene.render
    path = render.filepath
    if needs_a_saved_file(path):
        raise BadInputError("the output path is relative to a file that was never saved: save it, or change the path")
    span = {}
    if render.is_movie_format:
        path, span = MOVIE_EXTENSION.sub("", path), {"frame_start": frame, "frame_end": frame}
        path += "" if "#" in SEPARATOR.split(path)[-1] else "####"
    plain = {"filepath": path, "use_multiview": False, "use_file_extension": False}
    try:
        with changed(render, **plain), changed(scene, **span):
            picture = Path(render.frame_path(frame=frame))
    except RuntimeError as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ")
        raise BadInputError(Words("the output path cannot be used: {reason}", reason=reason)) from error
    name = FRAME_TO_ITSELF.sub(r"\1", picture.name)
    if name.isdigit():
        name = f"{Path(bpy.data.filepath).stem or scene.name}_{name}"
    return picture.parent.absolute() / f"{name}{SUFFIX}"
