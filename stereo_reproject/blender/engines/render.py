"""One render call: a view, or both, of a working scene, into arrays."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy

from ...errors import BadInputError, StereoReprojectError
from ...images.exr import read_render
from ...images.passes import Passes
from ...words import Words
from ..scene.rendered import CYCLES
from ..scene.working import changed, rendered_layer


@dataclass(frozen=True)
class Rendered:
    """A finished render call: passes by view name, the seconds of the call, and the part of them in which Cycles synced
    the scene (0 if several views were rendered). attributes are the texts in the header of the file that Blender wrote.
    layers has the passes of the view layers that were asked for, by view name and then by layer.
    """

    views: dict[str, Passes]
    seconds: float
    sync_seconds: float
    attributes: dict[str, str]
    layers: dict[str, dict[str, Passes]] = field(default_factory=dict)


def render_views(
    scene: bpy.types.Scene,
    views: tuple[str, ...],
    folder: Path,
    *,
    seed: int | None = None,
    layers: Sequence[str] = (),
) -> Rendered:
    """Render these views of a scene that `working_scene` has set up. seed, if given, is Cycles' for this render alone.
    folder is private. layers are the view layers whose passes are all to be returned; those of the first that is
    rendered are in any case. Raises StereoReprojectError when Blender cannot render.
    """
    for view in scene.render.views:
        view.use = view.name in views
    path = folder / "render.exr"
    _write_exr(scene.render, path)
    start = time.perf_counter()
    # The scene may stay for the next frame, whose seed must not follow from what was rendered before.
    seeded = {} if seed is None or scene.render.engine != CYCLES else {"seed": seed}
    try:
        with changed(scene.cycles, **seeded):
            result = call_render(scene, write_still=True)
    except RuntimeError as error:
        raise StereoReprojectError(Words("the render failed: {reason}", reason=" ".join(str(error).split()))) from error
    if "FINISHED" not in result or not path.exists():
        raise BadInputError("the render was cancelled, or its result could not be written: is the disk full?")
    seconds = time.perf_counter() - start
    layer = rendered_layer(scene).name
    passes: dict[str, Passes] = {}
    attributes: dict[str, str] = {}
    for view in views:
        passes[view], attributes = read_render(path, layer=layer, view=view)
    of_layers = {view: {name: read_render(path, layer=name, view=view)[0] for name in layers} for view in views}
    path.unlink()
    sync = cycles_seconds(attributes, layer, "synchronization")
    # For several views, Cycles counts the other views' render time as synchronization.
    return Rendered(passes, seconds, sync if len(views) == 1 else 0.0, attributes, of_layers)


def _write_exr(render: bpy.types.RenderSettings, path: Path) -> None:
    """Set the output to an EXR file at this path that holds all passes and views as 32-bit floats."""
    settings = render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    settings.color_depth = "32"
    settings.exr_codec = "NONE"
    settings.views_format = "MULTIVIEW"
    settings.color_management = "FOLLOW_SCENE"
    render.filepath = output_path(path)
    render.use_overwrite = True
    render.use_placeholder = False


def call_render(scene: bpy.types.Scene, **how: bool) -> set[str]:
    """Call Blender's render operator for this scene and return its result, {"FINISHED"} if all went well. how may be
    `write_still=True` or `animation=True`, as the operator has them.
    """
    # Told a scene by name it would take the local one where a linked one has the same, and the context's frame.
    with bpy.context.temp_override(scene=scene):  # pyright: ignore[reportGeneralTypeIssues] - not in the stubs
        return set(bpy.ops.render.render(**how))


def output_path(path: Path) -> str:
    """Return a path as Blender's output path must have it: {...} would be a template there, and is escaped."""
    return str(path).replace("{", "{{").replace("}", "}}")


def written_to(render: bpy.types.RenderSettings, path: str) -> dict[str, Any]:
    """Return render settings, as values by name, with which Blender writes files to an output path; existing files are
    replaced, and saving is on even where the user has switched it off.
    """
    files = {"filepath": path, "use_overwrite": True, "use_placeholder": False}
    return {**files, "save_output": True} if hasattr(render, "save_output") else files


def cycles_seconds(attributes: Mapping[str, str], layer: str, part: str) -> float:
    """Return the seconds that Cycles spent on a view layer in one part of its work, "render" or "synchronization".
    attributes are the texts in the header of the file; 0 where they do not tell.
    """
    return _seconds(attributes.get(f"cycles.{layer}.{part}_time", ""))


def _seconds(text: str) -> float:
    """Return the seconds of a duration as Cycles writes it, '01:02.50'; 0 for anything else."""
    total = 0.0
    for part in text.split(":"):
        try:
            total = 60.0 * total + float(part)
        except ValueError:
            return 0.0
    return total
