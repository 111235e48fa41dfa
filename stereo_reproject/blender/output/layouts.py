"""The layout in which a frame holds both eyes, and the format it is written in: Blender's, but for one of our own."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...delivery.anaglyph import dubois
from ...errors import BadInputError, StereoReprojectError
from ...jobs.plain_paths import misread
from ...words import Words
from ..engines.render import output_path
from ..scene.working import changed
from .delivery import NOTHING, EyesAt, deliver_frames
from .image_settings import SIDE_BY_SIDE, format_kept, set_changed
from .output_paths import NOWHERE, output_name, without_movie_extension
from .pictures import check_png, read_png

DUBOIS = "anaglyph-dubois"

PNG16 = "PNG16"
"""A PNG of 16 bits, of which movies are made where no format of pictures is chosen."""

MULTILAYER = "OPEN_EXR_MULTILAYER"
LINEAR = ("OPEN_EXR", MULTILAYER, "HDR")

_TOP = {"display_mode": "TOPBOTTOM", "use_squeezed_frame": False}
_ROWS = {"display_mode": "INTERLACE", "use_interlace_swap": False}
STEREO_3D: Mapping[str, Mapping[str, Any]] = {
    "side-by-side": SIDE_BY_SIDE,
    "side-by-side-half": {**SIDE_BY_SIDE, "use_squeezed_frame": True},
    "cross-eyed": {**SIDE_BY_SIDE, "use_sidebyside_crosseyed": True},
    "top-bottom": _TOP,
    "top-bottom-half": {**_TOP, "use_squeezed_frame": True},
    "anaglyph-red-cyan": {"display_mode": "ANAGLYPH", "anaglyph_type": "RED_CYAN"},
    "anaglyph-green-magenta": {"display_mode": "ANAGLYPH", "anaglyph_type": "GREEN_MAGENTA"},
    "anaglyph-yellow-blue": {"display_mode": "ANAGLYPH", "anaglyph_type": "YELLOW_BLUE"},
    "interlace-rows": {**_ROWS, "interlace_type": "ROW_INTERLEAVED"},
    "interlace-columns": {**_ROWS, "interlace_type": "COLUMN_INTERLEAVED"},
    "interlace-checkerboard": {**_ROWS, "interlace_type": "CHECKERBOARD_INTERLEAVED"},
}
"""Blender's own stereo 3D formats by the names of `delivery.layouts`, and what each is in `stereo_3d_format`."""

VIEWS_FORMATS = {"individual": "INDIVIDUAL", "multi-view": "MULTIVIEW"}


def is_our_own(layout: str | None) -> bool:
    """Return whether the layout is one that Blender does not have and that we make ourselves."""
    return layout == DUBOIS


def layout_of(scene: bpy.types.Scene) -> str | None:
    """Return the name, as in `delivery.layouts`, of the layout in which the scene's own output settings store both
    views; None where the layout has no name there.
    """
    settings = scene.render.image_settings
    for name, views_format in VIEWS_FORMATS.items():
        if settings.views_format == views_format:
            return name
    stereo = settings.stereo_3d_format
    fits = (all(getattr(stereo, key) == value for key, value in values.items()) for values in STEREO_3D.values())
    return next((name for name, fit in zip(STEREO_3D, fits, strict=True) if fit), None)


@contextmanager
def as_ordered(
    scene: bpy.types.Scene, output: str | None, layout: str | None, file_format: str | None
) -> Iterator[None]:
    """Have the scene's output path, layout and format as they are ordered, for the time of a `with` block; they are
    restored afterwards. None leaves each as the scene has it.

    output is a folder: of the scene's own path, the last part stays as the beginning of the files' names. Where Blender
    would take the folder's path for something else, the names are right, and the folder is a placeholder. Raises
    BadInputError when layout and format do not go together.
    """
    render = scene.render
    with ExitStack() as changes:
        if output is not None:
            # Pictures in place of a movie are not called as one.
            name = output_name(scene) if file_format is None else without_movie_extension(scene)
            folder = output_path(Path(output)) if misread(output) is None else NOWHERE
            changes.enter_context(changed(render, filepath=f"{folder}/{'' if name == os.curdir else name}"))
        changes.enter_context(format_kept(render.image_settings))
        if file_format is not None:
            set_format(render.image_settings, file_format)
        if layout is not None:
            _set_layout(scene, layout, changes)
        yield


def set_format(settings: bpy.types.ImageFormatSettings, name: str) -> None:
    """Set the output to a format of pictures, by Blender's name of it or `PNG16`. Raises BadInputError when Blender has
    none of this name.
    """
    wanted, depth = ("PNG", "16") if name == PNG16 else (name, None)
    known = _formats(settings)
    if wanted not in known:
        raise BadInputError(
            Words("the format must be one of {choices}, not {name}", choices=", ".join(known), name=repr(name))
        )
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE" if wanted == MULTILAYER else "IMAGE"
    settings.file_format = wanted
    if depth is not None:
        settings.color_depth = depth


def _formats(settings: bpy.types.ImageFormatSettings) -> list[str]:
    """Return Blender's names of the formats for pictures."""
    movies = {"AVI_JPEG", "AVI_RAW", "FFMPEG"}
    known = settings.bl_rna.properties["file_format"].enum_items  # pyright: ignore[reportAttributeAccessIssue]
    return [item.identifier for item in known if item.identifier not in movies]


def _set_layout(scene: bpy.types.Scene, layout: str, changes: ExitStack) -> None:
    """Set the scene's output to a layout; what is to be restored later goes into `changes`. Raises BadInputError where
    the file format cannot hold it.
    """
    settings = scene.render.image_settings
    if layout == DUBOIS and settings.file_format in LINEAR:
        raise BadInputError(
            Words(
                "{layout} is made of what screens show: choose a format such as PNG, not {format}",
                layout=layout,
                format=settings.file_format,
            )
        )
    views_format = VIEWS_FORMATS.get(layout, "STEREO_3D")
    if settings.file_format == MULTILAYER and views_format == "STEREO_3D":
        raise BadInputError(
            Words(
                "{multilayer} has no stereo 3D layouts such as {layout}: choose multi-view or another format",
                multilayer=MULTILAYER,
                layout=layout,
            )
        )
    try:
        set_changed(settings, {"views_format": views_format})
    except TypeError as error:
        raise BadInputError(
            Words(
                "{format} cannot hold {layout}: choose OPEN_EXR or {multilayer}",
                format=settings.file_format,
                layout=layout,
                multilayer=MULTILAYER,
            )
        ) from error
    changes.enter_context(changed(settings.stereo_3d_format, **STEREO_3D.get(layout, {})))


@contextmanager
def display_values(scene: bpy.types.Scene) -> Iterator[None]:
    """Have the scene's pictures written with their values as they are, without a view transform, for the time of a
    `with` block; its settings are restored afterwards.
    """
    settings = scene.render.image_settings
    view = {"view_transform": "Raw", "look": "None", "exposure": 0.0, "gamma": 1.0, "use_curve_mapping": False}
    if hasattr(scene.view_settings, "use_white_balance"):
        view["use_white_balance"] = False
    with (
        changed(scene.view_settings, **view),
        changed(scene.render, dither_intensity=0.0),
        changed(settings, color_management="FOLLOW_SCENE"),
    ):
        yield


def deliver_anaglyph(
    scene: bpy.types.Scene, eyes_at: EyesAt, folder: Path, *, frames: range, metadata: Mapping[str, str] = NOTHING
) -> None:
    """Write Dubois' anaglyph of the eyes of `frames` into a folder; parameters and naming are as for
    `delivery.deliver_frames`.

    It is made of the eyes as screens show them, after the compositor and the view transform. Raises
    StereoReprojectError.
    """
    sides = folder.with_name(f"{folder.name}-sides")
    with as_ordered(scene, None, "side-by-side", PNG16):
        deliver_frames(scene, eyes_at, sides, frames=frames, metadata=metadata)
        seen = {frame: read_png(Path(_frame_path(scene, sides, frame))) for frame in frames}
    folder.mkdir(exist_ok=True)
    for frame, both in seen.items():
        left, right = np.split(both, 2, axis=1)
        save_display_values(scene, dubois(left, right), Path(_frame_path(scene, folder, frame)))


def _frame_path(scene: bpy.types.Scene, folder: Path, frame: int) -> str:
    """Return the path that Blender gives a frame in this folder, by the scene's output name and format."""
    with changed(scene.render, filepath=f"{output_path(folder)}/{output_name(scene)}", use_multiview=False):
        return scene.render.frame_path(frame=frame)


def save_display_values(scene: bpy.types.Scene, picture: NDArray[np.float32], path: Path) -> None:
    """Write a picture (H, W, 3), whose values are those that a screen shows, to `path` in the scene's own format.
    Raises StereoReprojectError.
    """
    height, width = picture.shape[:2]
    image = bpy.data.images.new(path.stem, width, height, alpha=False, float_buffer=True, is_data=True)
    try:
        rgba = np.ones((height, width, 4), np.float32)
        rgba[..., :3] = picture[::-1]
        image.pixels.foreach_set(rgba.ravel())
        with display_values(scene):
            image.save_render(str(path), scene=scene)
    except RuntimeError as error:
        raise StereoReprojectError(
            Words("cannot write {name}: {reason}", name=path.name, reason=" ".join(str(error).split()))
        ) from error
    finally:
        bpy.data.images.remove(image)
    if path.suffix == ".png":
        check_png(path)
