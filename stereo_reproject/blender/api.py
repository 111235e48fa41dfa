"""What a script calls, in Blender or with Blender as a Python module: a handful of functions on the open file.

    from stereo_reproject.blender.api import compare, inspect, render_animation, render_frame

Within the extension the package is `bl_ext.user_default.stereo_reproject.stereo_reproject`. Each blocks until it is
done, leaves the scene as it was, and raises `BadInputError` when something that was asked for cannot be done, and
`StereoReprojectError` when a render fails; both with one line that says what to do. docs/scripting.md has an example
of each.
"""

from __future__ import annotations

import os
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy

from ..errors import BadInputError, StereoReprojectError
from ..settings import SceneOverrides, StereoSettings
from ..work_folder import pair_files, publish, superseded_by, work_folder
from .animation import render_animation_files
from .frame import render_files
from .inspection import inspect_scene

__all__ = (
    "BadInputError",
    "SceneOverrides",
    "StereoReprojectError",
    "StereoSettings",
    "compare",
    "inspect",
    "render_animation",
    "render_frame",
)


def render_frame(
    output: str | os.PathLike[str], settings: StereoSettings | None = None, *, scene: bpy.types.Scene | None = None
) -> dict[str, Any]:
    """Render the pair of one frame into the folder `output`, and return its report.

    The files are those of `python -m stereo_reproject render`; they are there whole or not at all. scene is the active
    one, its current frame unless the settings name another.
    """
    settings = settings or StereoSettings()
    if not os.fspath(output):
        raise BadInputError("the output is empty; name a folder for the result")
    folder, files = Path(os.path.abspath(output)), pair_files(compare=settings.compare)  # noqa: PTH100 - links stay
    with work_folder(folder, files) as work:
        report, _ = render_files(_scene(scene), settings, work, files=files)
        publish(work, folder, files, superseded=superseded_by(files), between_steps=lambda: None)
    return report


def compare(
    output: str | os.PathLike[str], settings: StereoSettings | None = None, *, scene: bpy.types.Scene | None = None
) -> dict[str, Any]:
    """The same, and Blender's multiview in the same run: `speedup`, `noise_ratio`, `worst_tiles` and more."""
    settings = replace(settings or StereoSettings(), compare=True)
    return render_frame(output, settings, scene=scene)["compare"]


def render_animation(
    settings: StereoSettings | None = None,
    *,
    frames: range | None = None,
    scene: bpy.types.Scene | None = None,
) -> dict[str, Any]:
    """Render the pairs of many frames into the scene's own output path, format and stereo layout; a report of them all.

    frames are the scene's, unless given. When it ends early, frames that are finished stay.
    """
    scene = _scene(scene)
    with work_folder(Path(tempfile.gettempdir()), ()) as work:
        return render_animation_files(scene, settings or StereoSettings(), work, frames=frames)


def inspect(
    settings: StereoSettings | None = None, *, scene: bpy.types.Scene | None = None, sketch: bool = True
) -> dict[str, Any]:
    """What the scene calls for and what its pair will cost, as `python -m stereo_reproject inspect --json` prints it.

    Without a sketch nothing is rendered and nothing predicted.
    """
    with work_folder(Path(tempfile.gettempdir()), ()) as work:
        return inspect_scene(_scene(scene), settings or StereoSettings(), work, sketch=sketch)


def _scene(scene: bpy.types.Scene | None) -> bpy.types.Scene:
    if scene is None:
        return bpy.context.scene
    if not isinstance(scene, bpy.types.Scene):
        raise BadInputError(f"scene must be one of bpy.data.scenes, not {scene!r}")
    return scene
