"""A movie of an animation's finished frames, in the scene's own codec, with the stereo layout where players look."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from functools import lru_cache
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...delivery.layouts import LAYOUTS, contradicting_degrees, contradicting_tag, says, tagged_name
from ...delivery.marks import write_marks_of
from ...delivery.projection import MoviePanorama
from ...errors import BadInputError, StereoReprojectError
from ...files import made_in
from ...images.exr import VIEWS, read_colours
from ...words import Words
from ..scene.rendered import main_layer
from .delivery import deliver_movie
from .image_settings import format_kept
from .layouts import LINEAR, display_values
from .pictures import read_pixels

CONTAINERS = {
    ".mp4": "MPEG4",
    ".m4v": "MPEG4",
    ".mov": "QUICKTIME",
    ".mkv": "MKV",
    ".webm": "WEBM",
    ".avi": "AVI",
    ".ogv": "OGG",
}
"""Blender's names of them, by a movie's extension."""

WITHOUT_MARKS = (".avi", ".ogv")
"""Extensions of containers that have no place for a mark."""

SQUEEZED = ("side-by-side-half", "top-bottom-half")
"""Layouts whose mark is that of the whole one."""

ONLY_CODECS = {"WEBM": ("WEBM", "AV1"), "OGG": ("THEORA",)}
"""Containers that take only some, their usual one first; what others hold is for Blender to say."""


def check_movie(path: Path) -> None:
    """Raise BadInputError when a movie cannot be written to this path: the extension is none of `CONTAINERS`, or a
    folder is there.
    """
    if path.suffix.lower() not in CONTAINERS:
        raise BadInputError(Words("{path} must end in one of {endings}", path=path, endings=", ".join(CONTAINERS)))
    if path.is_dir():
        raise BadInputError(Words("{path} is a folder where a movie is to be written", path=path))


def movie_files(scene: bpy.types.Scene, path: Path, layout: str | None) -> list[Path]:
    """Return the paths of the movies that `write_movie` makes of frames in this layout: one, or one for each eye."""
    return [path.with_stem(f"{path.stem}{suffix}") for suffix, _ in _parts(scene, layout)]


def movie_warnings(
    path: Path, layout: str | None, panorama: MoviePanorama | None = None, *, lacks_mark: bool = False
) -> list[str]:
    """Return warnings where players would take the movie for one of another layout or projection, or cannot know its
    own; else an empty list. panorama is the part of the sphere that it shows, None for a planar movie. lacks_mark: True
    for a panorama that no mark can say, whose panorama is None too.
    """
    if layout is None:
        return []
    degrees = contradicting_degrees(path, panorama)
    if not lacks_mark:
        return _name_warnings(path, layout, panorama, degrees)
    said = f"movies have no mark for such a panorama: players show {path.name} as a flat picture"
    if degrees is not None:
        said = f"players take {degrees} in {path.name} for an equirectangular panorama, which it is not"
    return [f"{said}; they know equirectangular ones", *_name_warnings(path, layout, None, None)]


def _name_warnings(path: Path, layout: str, panorama: MoviePanorama | None, degrees: str | None) -> list[str]:
    """Return warnings of a movie's name, by its layout and the part of the sphere that it shows. degrees is a word in
    it by which players would take the movie for another panorama, None without any."""
    tag, warnings = contradicting_tag(path, LAYOUTS[layout]), []
    if tag is not None:
        warnings.append(f"players take {tag} in {path.name} for another layout than {layout}")
    if degrees is not None:
        shown = "a planar one" if panorama is None else _panorama_in_words(panorama)
        warnings.append(f"players take {degrees} in {path.name} for another projection than {shown}")
    marked = path.suffix.lower() not in WITHOUT_MARKS
    named = tagged_name(path, LAYOUTS[layout], panorama).name
    if warnings or says(path, LAYOUTS[layout], None if marked else panorama) or (marked and layout not in SQUEEZED):
        return warnings
    alone = panorama is not None and says(path, LAYOUTS[layout])
    what = _panorama_in_words(panorama) if alone else layout
    return [f"players know {what} by its name alone: {named} tells it"]


def _panorama_in_words(panorama: MoviePanorama) -> str:
    """Return what part of the sphere is shown, in words."""
    return f"a panorama of {panorama.horizontal_degrees:.3g}°"


def write_movie(
    scene: bpy.types.Scene,
    pictures: Mapping[int, Sequence[Path]],
    path: Path,
    layout: str | None,
    folder: Path,
    *,
    file_format: str,
    panorama: MoviePanorama | None = None,
) -> list[Path]:
    """Write a movie of these frames' files into `folder`, under the name that `path` has, and return what was made.
    With the layout "individual" there is one movie for each eye, and its name ends in the eye's suffix.

    pictures are the files of each frame, by its number. Eyes in files of their own are put side by side. file_format is
    that of the pictures. The movie's header tells players the layout, and which part of the sphere is shown:
    `panorama`, None for planar pictures. Raises BadInputError and StereoReprojectError.
    """
    folder.mkdir(exist_ok=True)
    finished = []
    with movie_scene(scene, path.suffix.lower()) as copy:
        for suffix, part in _parts(scene, layout):
            of_part = {frame: files[part] for frame, files in pictures.items()}
            made, height = _encode(copy, of_part, folder, file_format)
            finished.append(made.replace(folder / f"{path.stem}{suffix}{path.suffix}"))
            write_marks_of(finished[-1], LAYOUTS[layout or "individual"].at_height(height), panorama)
    return finished


def _parts(scene: bpy.types.Scene, layout: str | None) -> list[tuple[str, slice]]:
    """Return for each movie the ending of its name, and a slice that says which of a frame's files go into it."""
    if layout != "individual":
        return [("", slice(2))]
    views = [view for name in VIEWS for view in scene.render.views if view.name == name]
    return [(view.file_suffix, slice(k, k + 1)) for k, view in enumerate(views)]


def try_movie(scene: bpy.types.Scene, path: Path, width: int, height: int, folder: Path) -> None:
    """Raise BadInputError unless the scene's encoder can make a movie of this size, so that it is known before frames
    are rendered. A movie of one black frame is written into `folder`.
    """
    folder.mkdir(exist_ok=True)
    black = np.zeros((height, width, 4), np.float32)
    try:
        with movie_scene(scene, path.suffix.lower()) as copy:
            deliver_movie(copy, lambda _: black, folder / "tried", frames=range(1, 2))
        only_file(folder / "tried")
    except StereoReprojectError as error:
        size = f"{width} x {height}"
        raise BadInputError(
            Words(
                "no {ending} of {size} pixels can be made by the encoder set in Output: {reason}",
                ending=path.suffix,
                size=size,
                reason=str(error),
            )
        ) from error


@contextmanager
def movie_scene(scene: bpy.types.Scene, suffix: str) -> Iterator[bpy.types.Scene]:
    """Have a copy of the scene that is set to write movies, without the collections of its objects, so that none is
    evaluated, for the time of a `with` block; the copy is removed afterwards. suffix is the extension of the movie,
    such as ".mp4".
    """
    copy = scene.copy()
    name = copy.name
    try:
        for collection in list(copy.collection.children):
            copy.collection.children.unlink(collection)
        settings, ffmpeg = copy.render.image_settings, copy.render.ffmpeg
        codec = ffmpeg.codec
        with format_kept(settings):
            if hasattr(settings, "media_type"):
                settings.media_type = "VIDEO"
            settings.file_format = "FFMPEG"
            if codec not in ("NONE", ffmpeg.codec):
                # Of settings that were never those of the scene's own format, Blender makes its defaults.
                ffmpeg.codec = codec
            container = CONTAINERS[suffix]
            ffmpeg.format = container
            ffmpeg.use_autosplit = False
            only = ONLY_CODECS.get(container)
            if only is not None and ffmpeg.codec not in only:
                ffmpeg.codec = only[0]
            yield copy
    finally:
        bpy.data.scenes.remove(bpy.data.scenes[name])


def _encode(
    copy: bpy.types.Scene, pictures: Mapping[int, Sequence[Path]], folder: Path, file_format: str
) -> tuple[Path, int]:
    """Write one movie of the pictures in these files, and return its path and its height in pixels. Pictures of a
    linear format go through the scene's view transform; others have gone through it already.
    """
    linear = file_format in LINEAR
    layer = main_layer(copy)
    return encode(
        copy, pictures, lambda frame: _beside_each_other(pictures[frame], layer, linear=linear), folder, linear=linear
    )


def encode(
    copy: bpy.types.Scene,
    numbers: Iterable[int],
    picture_of: Callable[[int], NDArray[np.float32]],
    folder: Path,
    *,
    linear: bool,
) -> tuple[Path, int]:
    """Write one movie of the frames of these numbers into a folder, by a scene of `movie_scene`, and return its path
    and its height in pixels. picture_of returns the picture (H, W, 4) of a frame. With linear it is scene-linear and
    goes through the scene's view transform; without, it has the values that the movie is to show.
    """
    numbers = list(numbers)
    frames = _span(numbers)
    number_of = dict(zip(frames, numbers, strict=True))
    # Blender asks several times in a row.
    picture_at = lru_cache(maxsize=2)(lambda frame: picture_of(number_of[frame]))
    out = folder / f"encoded-{len(list(folder.iterdir()))}"
    with nullcontext() if linear else display_values(copy):
        deliver_movie(copy, picture_at, out, frames=frames)
    return only_file(out), picture_at(frames[-1]).shape[0]


def _beside_each_other(files: Sequence[Path], layer: str, *, linear: bool) -> NDArray[np.float32]:
    """Return the pictures (H, W, 4) of these files as one, from left to right; or the two views of a single EXR that
    holds both. linear is as for `read_opaque`.
    """
    views = read_colours(files[0], main=layer) if linear and files[0].suffix == ".exr" and len(files) == 1 else {}
    pictures = list(views.values()) or [read_opaque(path, linear=linear) for path in files]
    return np.concatenate(pictures, axis=1)


def _span(numbers: list[int]) -> range:
    """Return the numbers under which Blender renders the frames as a movie. They are the frames' own where these have
    one step, so that the sound fits; else they are numbered one after the other.
    """
    step = numbers[1] - numbers[0] if len(numbers) > 1 else 1
    regular = range(numbers[0], numbers[-1] + 1, step)
    return regular if list(regular) == numbers else range(numbers[0], numbers[0] + len(numbers))


def only_file(folder: Path) -> Path:
    """Return the one file in the folder. Raises StereoReprojectError where there is none, more than one, or an empty
    one.
    """
    made = made_in(folder) if folder.is_dir() else []
    if len(made) != 1 or not made[0].stat().st_size:
        raise StereoReprojectError("Blender wrote no movie: does its container take the codec that is set in Output?")
    return made[0]


def read_opaque(path: Path, *, linear: bool) -> NDArray[np.float32]:
    """Return the pixels (H, W, 4) of a picture file, row 0 at the top and alpha 1. With linear they are scene-linear;
    without, the values that the file holds, over black where it is transparent. Raises StereoReprojectError if it
    cannot be read.
    """
    stored = read_pixels(path, linear=linear)
    if not stored.size:
        raise StereoReprojectError(Words("{path} cannot be read: render it anew", path=path))
    height, width, channels = stored.shape
    picture = np.ones((height, width, 4), np.float32)
    picture[..., :3] = stored[..., :3]
    if not linear and channels == 4:
        # Blender gives colours that know nothing of alpha; over black, as it writes movies, they do.
        picture[..., :3] *= stored[..., 3:]
    return picture
