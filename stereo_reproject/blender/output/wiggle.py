"""A pair as a wiggle: the eyes as a screen shows them, one after the other, in an animated GIF or a movie."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...errors import BadInputError
from ...images.exr import VIEWS
from ...images.resizing import made_smaller
from ...words import Words
from .delivery import deliver_movie
from .layouts import display_values
from .movie import CONTAINERS, movie_scene, only_file
from .pictures import read_pixels

GIF = ".gif"
SUFFIXES = (GIF, ".mp4")
"""Extensions of the files that a wiggle can be written to."""

MOVIE_SECONDS = 10.0
"""Length of a wiggle as a movie, at least: players stop at its end unless they are told to play it again."""

MOVIE_FRAMES_PER_SECOND = 30

SIDE_STEP_PX = 2
"""Sides of a movie are a multiple of this: H.264 stores one value of colour for 2 x 2 pixels."""


def check_wiggle_path(path: Path) -> None:
    """Raise BadInputError unless a wiggle can be written to this path, by its extension and its folder."""
    if path.suffix.lower() not in SUFFIXES:
        raise BadInputError(Words("{name} must end in {endings}", name=path.name, endings=" or ".join(SUFFIXES)))
    if not path.parent.is_dir():
        raise BadInputError(Words("there is no folder {folder}: make it, or choose another", folder=path.parent))
    if path.is_dir():
        raise BadInputError(Words("{path} is a folder: choose another name", path=path))


def wiggle_size(sides: tuple[int, ...], percentage: float, *, suffix: str) -> tuple[int, ...]:
    """Return the sides of a wiggle in pixels, made smaller to this percentage of those of the pair. suffix is the
    extension of its file: a movie's sides are even.
    """
    step = 1 if suffix == GIF else SIDE_STEP_PX
    return tuple(max(int(0.01 * percentage * side / step), 1) * step for side in sides)


def wiggle_pictures(
    views: Mapping[str, NDArray[np.float32]], percentage: float, *, suffix: str
) -> list[NDArray[np.uint8]]:
    """Return the pictures of a wiggle, left and right, in bytes (h, w, 3), made smaller to this percentage.

    views are the eyes (H, W, 3) as a screen shows them, from 0 to 1. suffix is the extension of the file that they are
    for: a movie's sides are even.
    """
    height, width = wiggle_size(views[VIEWS[0]].shape[:2], percentage, suffix=suffix)
    smaller = [made_smaller(views[view], width, height) for view in VIEWS]
    return [np.round(255.0 * np.clip(picture, 0.0, 1.0)).astype(np.uint8) for picture in smaller]


def write_wiggle_movie(pictures: Sequence[Path], folder: Path, seconds: float) -> Path:
    """Write the pictures of a wiggle, PNG files, as an MP4 into `folder`, and return its path. Each is shown for about
    `seconds`, a whole number of frames, again and again for `MOVIE_SECONDS`. Raises StereoReprojectError.

    Blender renders to encode, in an empty file in place of the open one: call this in a process of its own.
    """
    # Factory settings would also remove the libraries of all extensions, since none is enabled in them.
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    # Blender renders nothing without one.
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    held = max(round(seconds * MOVIE_FRAMES_PER_SECOND), 1)
    rounds = int(np.ceil(MOVIE_SECONDS * MOVIE_FRAMES_PER_SECOND / (held * len(pictures))))
    shown = []
    for path in pictures:
        picture = read_pixels(path)
        shown.append(np.dstack([picture[..., :3], np.ones(picture.shape[:2], np.float32)]))
    suffix = next(suffix for suffix in SUFFIXES if suffix in CONTAINERS)
    with movie_scene(scene, suffix) as copy, display_values(copy):
        copy.render.fps, copy.render.fps_base = MOVIE_FRAMES_PER_SECOND, 1.0
        frames = range(1, 1 + rounds * held * len(shown))
        deliver_movie(copy, lambda frame: shown[(frame - 1) // held % len(shown)], folder, frames=frames)
    return only_file(folder)
