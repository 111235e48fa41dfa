"""Files that show many views of one frame: their quilt, a sheet of small pictures, and a movie that goes from the
leftmost camera to the rightmost and back.

Pictures go through the scene's view transform, as a pair's do. Displays know no transparency, so that PNGs and movies
show views over black.
"""

from __future__ import annotations

import math
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import lru_cache
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...delivery.quilts import Quilt, grid_for, quilt_bands
from ...images.exr import in_halves
from ...images.exr_stream import StreamedPart, streamed_exr
from ...images.png import write_png, write_png_bands
from ...images.resizing import made_smaller
from ...settings.views import ViewsSettings
from ..scene.working import changed
from .delivery import NOTHING, deliver_movie, deliver_picture, empty_scene_like
from .movie import movie_scene, only_file
from .pictures import drawn, read_png
from .wiggle import MOVIE_FRAMES_PER_SECOND, MOVIE_SECONDS, SIDE_STEP_PX

Pictures = Sequence[NDArray[np.float32]]
"""Views (H, W, 4) from the leftmost camera to the rightmost, scene-linear, all of one size. Each is asked for when it
is needed, so that a sequence may read them from files."""

SHEET_PX = 1600
"""Width of a contact sheet, as far as its pictures allow: what most screens show."""

LEAST_SHEET_PICTURE_PX = 96
"""Least width of a picture in a contact sheet: of less, its name has no room."""

GAP_PX = 6
BACKGROUND = 24

SWEEP_SECONDS = 4.0
"""Seconds for which a sweep goes to the right and back, about: with the 48 views of most displays each is then shown
for a single frame of the movie."""

MOST_SWEEP_PX = 1920
"""Longest side of a sweep: it is to be looked at, not kept."""


@contextmanager
def display_pixels(scene: bpy.types.Scene, aspect: float | None, size: tuple[int, int] | None) -> Iterator[None]:
    """Have the scene's pixels of such a shape that a view of this size, (width, height), is as wide over its height as
    the display, for the time of a `with` block. size None stands for the scene's own; aspect None leaves the pixels as
    they are."""
    render = scene.render
    share = render.resolution_percentage / 100.0
    width, height = size or (int(render.resolution_x * share), int(render.resolution_y * share))
    shape = {} if aspect is None else _pixel_aspects(aspect * height / width)
    with changed(render, **shape):
        yield


def _pixel_aspects(ratio: float) -> dict[str, float]:
    """Return Blender's settings of pixels that are `ratio` times as wide as high: neither may be below 1."""
    return {"pixel_aspect_x": max(1.0, ratio), "pixel_aspect_y": max(1.0, 1.0 / ratio)}


def quilt_of(scene: bpy.types.Scene, views: ViewsSettings, view_size: tuple[int, int]) -> Quilt | None:
    """Return the grid of the quilt of views of this size, (width, height) in pixels; None where no quilt is made. The
    scene's pixels must have their shape."""
    if views.columns is None or views.rows is None:
        return None
    width, height = view_size
    shape = width * scene.render.pixel_aspect_x / (height * scene.render.pixel_aspect_y)
    return Quilt(views.columns, views.rows, views.aspect or shape, view_size)


def write_quilt(
    scene: bpy.types.Scene,
    pictures: Pictures,
    columns: int,
    rows: int,
    path: Path,
    *,
    frame: int | None = None,
    metadata: Mapping[str, str] = NOTHING,
) -> None:
    """Write the quilt of views to `path`: as a PNG through the view transform that the scene has at `frame` (None: the
    present one), or as an EXR of half floats, scene-linear. metadata are texts for the file's header.

    One row of views is held at a time. Raises StereoReprojectError.
    """
    height, width = pictures[0].shape[:2]
    bands = quilt_bands(pictures, columns, rows)
    size = columns * width, rows * height
    if path.suffix == ".exr":
        with streamed_exr(path, [StreamedPart("RGBA", texts=metadata)], size, np.float16) as stream:
            for band in bands:
                stream.write({letter: in_halves(band[..., k]) for k, letter in enumerate("RGBA")})
        return
    with tempfile.TemporaryDirectory() as folder, _at(scene, frame) as empty:
        shown = (_shown(empty, band, Path(folder)) for band in bands)
        write_png_bands(path, size, shown, texts=metadata)


def write_contact_sheet(
    scene: bpy.types.Scene, pictures: Pictures, names: Sequence[str], path: Path, *, frame: int | None = None
) -> None:
    """Write a PNG of small pictures of all views in their order, from the top left on in rows, each below its name.
    frame is as for `write_quilt`. Raises StereoReprojectError."""
    columns, rows = grid_for(len(pictures))
    width, height = _sheet_picture_size(scene, pictures[0], columns)
    small = [_resized(picture, width, height) for picture in pictures]
    small += [np.zeros_like(small[0])] * (columns * rows - len(small))
    lines = [np.concatenate(small[k : k + columns], axis=1) for k in range(0, len(small), columns)]
    with tempfile.TemporaryDirectory() as folder, _at(scene, frame) as empty:
        shown = _shown(empty, np.concatenate(lines), Path(folder))
        titles = [drawn(Path(folder) / "name.png", [(name, None)], width) for name in names]
    name_height = max(title.shape[0] for title in titles)
    step_x, step_y = width + GAP_PX, name_height + height + GAP_PX
    sheet = np.full((rows * step_y, columns * step_x - GAP_PX, 3), BACKGROUND, np.uint8)
    for k, title in enumerate(titles):
        row, column = divmod(k, columns)
        y, x = row * step_y, column * step_x
        sheet[y : y + title.shape[0], x : x + width] = title
        picture = shown[row * height : (row + 1) * height, column * width : (column + 1) * width]
        sheet[y + name_height : y + name_height + height, x : x + width] = picture
    write_png(path, sheet)


def write_sweep(scene: bpy.types.Scene, pictures: Pictures, path: Path, *, frame: int | None = None) -> None:
    """Write an MP4 that shows the views from the leftmost camera to the rightmost and back, again and again for about
    ten seconds. frame is as for `write_quilt`. Raises StereoReprojectError."""
    order = [*range(len(pictures)), *range(len(pictures) - 2, 0, -1)]
    held = max(round(SWEEP_SECONDS * MOVIE_FRAMES_PER_SECOND / len(order)), 1)
    rounds = math.ceil(MOVIE_SECONDS * MOVIE_FRAMES_PER_SECOND / (held * len(order)))
    width, height = _sweep_size(pictures[0])
    frames = range(1, 1 + rounds * held * len(order))
    with (
        tempfile.TemporaryDirectory() as folder,
        _at(scene, frame) as empty,
        movie_scene(empty, ".mp4") as copy,
    ):
        copy.render.fps, copy.render.fps_base = MOVIE_FRAMES_PER_SECOND, 1.0
        ffmpeg = copy.render.ffmpeg
        ffmpeg.codec, ffmpeg.audio_codec, ffmpeg.constant_rate_factor = "H264", "NONE", "HIGH"
        # Blender asks several times in a row.
        opaque = lru_cache(maxsize=2)(lambda k: _opaque(_resized_once(pictures, k, (width, height), Path(folder))))
        out = Path(folder) / "encoded"
        deliver_movie(copy, lambda frame: opaque(order[(frame - 1) // held % len(order)]), out, frames=frames)
        shutil.move(only_file(out), path)


def _at(scene: bpy.types.Scene, frame: int | None) -> AbstractContextManager[bpy.types.Scene]:
    """Have an empty scene with the settings that `scene` has at a frame (None: the present one), which nothing
    animates, for the time of a `with` block."""
    return empty_scene_like(scene, scene.frame_current if frame is None else frame)


def _shown(scene: bpy.types.Scene, picture: NDArray[np.float32], folder: Path) -> NDArray[np.uint8]:
    """Return a picture (H, W, 4), scene-linear, in bytes (H, W, 3) through the scene's view transform, over black where
    it is transparent. folder takes a file meanwhile. Raises StereoReprojectError."""
    path = folder / "shown.png"
    deliver_picture(scene, _opaque(picture), path)
    return np.round(255.0 * read_png(path)).astype(np.uint8)


def _opaque(picture: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a picture (H, W, 4) over black: its colour is premultiplied."""
    opaque = picture.astype(np.float32, copy=True)
    opaque[..., 3] = 1.0
    return opaque


def _resized(picture: NDArray[np.float32], width: int, height: int) -> NDArray[np.float32]:
    """Return a picture (H, W, 4) made smaller to this size; one that has it already as it is."""
    return picture if picture.shape[:2] == (height, width) else made_smaller(picture, width, height)


def _resized_once(pictures: Pictures, number: int, size: tuple[int, int], folder: Path) -> NDArray[np.float32]:
    """Return a picture (H, W, 4) made smaller to this size, (width, height). It is made but once: the folder keeps it,
    in half floats."""
    path = folder / f"{number}.npy"
    if not path.exists():
        np.save(path, in_halves(_resized(pictures[number], *size)))
    return np.load(path).astype(np.float32)


def _sheet_picture_size(scene: bpy.types.Scene, picture: NDArray[np.float32], columns: int) -> tuple[int, int]:
    """Return the width and height of a picture in a contact sheet of so many columns. Where the scene's pixels are not
    square, it is made smaller along one side, so that what it shows has its shape."""
    height, width = picture.shape[:2]
    wide = scene.render.pixel_aspect_x / scene.render.pixel_aspect_y
    largest = max(SHEET_PX // columns - GAP_PX, LEAST_SHEET_PICTURE_PX)
    small = max(min(largest, width, round(width * wide)), 1)
    return small, max(min(round(small * height / (width * wide)), height), 1)


def _sweep_size(picture: NDArray[np.float32]) -> tuple[int, int]:
    """Return the width and height of a sweep: even, and of no more than `MOST_SWEEP_PX`."""
    sides = picture.shape[1], picture.shape[0]
    scale = min(1.0, MOST_SWEEP_PX / max(sides))
    width, height = (max(int(scale * side / SIDE_STEP_PX), 1) * SIDE_STEP_PX for side in sides)
    return width, height
