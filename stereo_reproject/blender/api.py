"""Functions for scripts, in Blender or with Blender as a Python module, on the open file.

    from stereo_reproject.blender.api import compare, inspect, render_animation, render_frame

Within the extension the package is `bl_ext.user_default.stereo_reproject.stereo_reproject`. Each blocks until it is
done, leaves the scene as it was, and raises `BadInputError` when something that was asked for cannot be done, and
`StereoReprojectError` when a render fails; both with one line that says what to do. docs/scripting.md has an example
of each.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy

from ..errors import BadInputError, StereoReprojectError
from ..jobs.supervisor import Session
from ..jobs.work_folder import pair_files, publish, superseded_by, work_folder
from ..sequence.progress import Listener
from ..settings.animation import AnimationSettings
from ..settings.frame import SceneOverrides, StereoSettings
from .commands.animation import SavedScene, render_animation_files
from .commands.frame import render_files
from .commands.inspection import inspect_scene
from .commands.processes import save_copy
from .output.animation_output import existing_as_set
from .scene.rendered import layers_to_render
from .scene.warnings import warnings_ahead
from .scene.working import scene_key

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
    output: str | os.PathLike[str],
    settings: StereoSettings | None = None,
    *,
    scene: bpy.types.Scene | None = None,
    strict: bool = False,
) -> dict[str, Any]:
    """Render the pair of one frame into the folder `output`, and return its report.

    The files are those of `python -m stereo_reproject render`; they are there whole or not at all. scene is the active
    one, its current frame unless the settings name another. strict raises BadInputError for whatever the scene is
    known to lack before the first render; without it, the report's warnings name it.
    """
    settings = settings or StereoSettings()
    _check_scene(_scene(scene), settings, strict=strict)
    folder, files = Path(_absolute(output, "output")), pair_files(compare=settings.compare)
    with work_folder(folder, files) as work:
        report, made = render_files(_scene(scene), settings, work, files=files)
        files = tuple(made)
        publish(work, folder, files, superseded=superseded_by(files), between_steps=lambda: None)
    return report


def compare(
    output: str | os.PathLike[str],
    settings: StereoSettings | None = None,
    *,
    scene: bpy.types.Scene | None = None,
    strict: bool = False,
) -> dict[str, Any]:
    """Render a pair as `render_frame` does, then Blender's multiview too, and return their comparison: `speedup`,
    `honest_ratio`, `noise_ratio`, `worst_tiles` and more. The parameters are those of `render_frame`.
    """
    settings = replace(settings or StereoSettings(), compare=True)
    return render_frame(output, settings, scene=scene, strict=strict)["compare"]


# It has more parameters than our other functions may have: scripts call it with them, as docs/scripting.md says, and
# each stands for one option of `animate`.
def render_animation(
    settings: StereoSettings | None = None,
    *,
    frames: Iterable[int] | None = None,
    scene: bpy.types.Scene | None = None,
    output: str | os.PathLike[str] | None = None,
    existing: str | None = None,
    movie: str | os.PathLike[str] | None = None,
    layout: str | None = None,
    file_format: str | None = None,
    holes: bool = False,
    compare_every: int | None = None,
    reuse: int | None = None,
    mono: bool = False,
    strict: bool = False,
    on_frame: Callable[[Mapping[str, Any]], None] = lambda _: None,
) -> dict[str, Any]:
    """Render the pairs of many frames, as `python -m stereo_reproject animate` does, and return the animation's report.

    frames are by default the scene's, and they go into its own output path, format and stereo layout unless others are
    given; output is a folder. existing says what is done with frames that are there already: "refuse", "resume",
    "overwrite", or "keep" (whoever has rendered them); by default the scene's Overwrite decides. movie, layout,
    file_format, holes, compare_every, reuse and mono are those of `AnimationSettings`. on_frame is called with each
    finished frame: its number, seconds, traced fraction, and how far the animation is. strict is as for `render_frame`,
    and has no effect on the pictures. If the run ends early, frames that are finished stay.
    """
    settings = settings or StereoSettings()
    scene = _scene(scene)
    if not scene.users:
        raise BadInputError(f"scene {scene.name!r} is used by nothing, and would not be saved for the frames' writer")
    options = AnimationSettings(
        frames=None if frames is None else _frames(frames),
        existing=existing_as_set(scene) if existing is None else existing,
        output=None if output is None else _absolute(output, "output"),
        layout=layout,
        file_format=file_format,
        movie=movie if movie in (None, "") else _absolute(movie, "movie"),
        holes=holes,
        compare_every=compare_every,
        reuse=reuse,
        mono=mono,
    )
    first = options.frames[0] if options.frames else scene.frame_start
    _check_scene(scene, replace(settings, scene=replace(settings.scene, frame=first)), strict=strict)
    with work_folder(Path(tempfile.gettempdir()), ()) as work:
        session = Session(
            scene_key(scene),
            original=bpy.data.filepath,
            scripts=bpy.context.preferences.filepaths.use_scripts_auto_execute,
            layers=tuple(layers_to_render(scene)),
        )
        saved = SavedScene(save_copy(work), session, work)
        return render_animation_files(scene, settings, options, saved, listener=Listener(on_frame=on_frame))


def _absolute(path: Any, what: str) -> str:
    """Return a path as an absolute one, where // stands for the open file's folder as everywhere in Blender. what names
    the path in errors. Raises BadInputError for what is no path or cannot be used.
    """
    try:
        name = os.fspath(path)
    except TypeError as error:
        raise BadInputError(f"the {what} must be a path, not {path!r}") from error
    if not name:
        raise BadInputError(f"the {what} is empty; name a folder for the result")
    if name.startswith("//") and not bpy.data.filepath:
        raise BadInputError(f"the {what} is relative to a file that was never saved: save it, or change the path")
    folder = os.sep if name.endswith(("/", os.sep)) else ""
    # Links stay.
    return f"{os.path.abspath(bpy.path.abspath(name))}{folder}"  # noqa: PTH100


def _frames(frames: Iterable[int]) -> tuple[int, ...]:
    """Return the frame numbers as a tuple. Raises BadInputError where they are no series of numbers."""
    try:
        return tuple(frames)
    except TypeError as error:
        raise BadInputError(f"frames must be a range or a list of numbers, not {frames!r}") from error


def inspect(
    settings: StereoSettings | None = None,
    *,
    scene: bpy.types.Scene | None = None,
    sketch: bool = True,
    strict: bool = False,
) -> dict[str, Any]:
    """Return what `python -m stereo_reproject inspect --json` prints: the effects that the scene calls for, and the
    predicted cost of its pair.

    Without a sketch nothing is rendered and nothing predicted. strict is as for `render_frame`.
    """
    settings = settings or StereoSettings()
    _check_scene(_scene(scene), settings, strict=strict)
    with work_folder(Path(tempfile.gettempdir()), ()) as work:
        return inspect_scene(_scene(scene), settings, work, sketch=sketch)


def _check_scene(scene: bpy.types.Scene, settings: StereoSettings, *, strict: bool) -> None:
    """Raise BadInputError for settings that only `render_animation` makes and, with strict, if the scene is known to
    lack anything."""
    if settings.scene.mono:
        raise BadInputError("mono is no setting of a picture: say mono=True to render_animation")
    if strict:
        warnings_ahead(scene, settings.scene, strict=True)


def _scene(scene: bpy.types.Scene | None) -> bpy.types.Scene:
    """Return the scene that is meant: the one given, or without one the active scene. Raises BadInputError for anything
    else.
    """
    if scene is None:
        return bpy.context.scene
    if not isinstance(scene, bpy.types.Scene):
        raise BadInputError(f"scene must be one of bpy.data.scenes, not {scene!r}")
    return scene
