"""The folder, names and formats of an animation's frames, by the scene's own output settings and what replaces them."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import bpy

from ...delivery.layouts import LAYOUTS, tagged_name
from ...delivery.projection import MoviePanorama
from ...errors import BadInputError
from ...files import beside_name
from ...images.exr import VIEWS
from ...jobs.plain_paths import check_names
from ...sequence.journal import Journal
from ...sequence.listing import Listing
from ...sequence.report import report_path
from ...settings.animation import AnimationSettings
from ...settings.frame import SceneOverrides
from ...words import Words
from ..scene.rendered import scene_frames
from ..scene.rig import frame_region
from .image_settings import format_values, writes_half_floats
from .layouts import PNG16, as_ordered, layout_of
from .movie import check_movie, movie_files, movie_warnings, write_movie
from .movie_panorama import movie_panorama, shows_panorama
from .output_paths import check_file_outputs, output_files, output_stem

AS_IT_IS = SceneOverrides()


@dataclass(frozen=True)
class Output:
    """The output of an animation. name is what the files' names begin with; files are each frame's, by its number: one,
    or one for each eye. layout is the frames', movie_layout that of a movie made of them (None: one that we have no
    name for, or one view alone). values are all settings of the format; half_floats is True for an EXR of 16 bits.
    panorama is the part of the sphere that a movie shows (None: a planar one, one whose layout has no name, or one that
    no mark can say); lacks_mark is True for the last of these.
    """

    folder: Path
    name: str
    files: Mapping[int, list[Path]]
    layout: str | None
    file_format: str
    movie_layout: str | None
    values: Mapping[str, Any]
    half_floats: bool
    panorama: MoviePanorama | None
    lacks_mark: bool

    @property
    def all_files(self) -> list[Path]:
        """Files of all frames, in the frames' order."""
        return [path for of_frame in self.files.values() for path in of_frame]

    def movies(self, scene: bpy.types.Scene, path: Path) -> list[Path]:
        """Return the paths of the movies that `write_movie` makes of all frames: one, or one for each eye."""
        return movie_files(scene, path, self.movie_layout)

    def movie_warnings(self, path: Path) -> list[str]:
        """Return warnings where players cannot know by the movie's name or mark how its frames are to be shown."""
        return movie_warnings(path, self.movie_layout, self.panorama, lacks_mark=self.lacks_mark)

    def movie_size(self, scene: bpy.types.Scene, size: tuple[int, int] | None) -> tuple[int, int]:
        """Return the width and height of the movie in pixels; size is that of an eye, None for the scene's own."""
        region = frame_region(scene.render)
        width, height = size or (region.width, region.height)
        layout = LAYOUTS[self.movie_layout or "individual"]
        return layout.across * width, layout.down * height

    def write_movie(self, scene: bpy.types.Scene, path: Path, folder: Path) -> list[Path]:
        """Write the movie of all frames into `folder`, under the name that `path` has, and return what was made. Raises
        BadInputError and StereoReprojectError."""
        form, panorama = self.file_format, self.panorama
        return write_movie(scene, self.files, path, self.movie_layout, folder, file_format=form, panorama=panorama)


def output_of(
    scene: bpy.types.Scene, options: AnimationSettings, overrides: SceneOverrides = AS_IT_IS
) -> tuple[AnimationSettings, Output]:
    """Return the options completed by what the scene says, and the output of their frames. overrides are those of the
    render, which may make a panorama of the scene, or one view.

    A scene whose own format is a movie first has its frames in pictures, in a folder beside the movie. Raises
    BadInputError when files cannot be written.
    """
    frames = tuple(scene_frames(scene)) if options.frames is None else options.frames
    asked, options = options, replace(options, frames=frames)
    check_file_outputs(scene)
    own_movies = options.layout == "individual" or (scene.render.is_movie_format and asked.movie is None)
    if scene.render.is_movie_format:
        options = _with_movie(scene, options, asked, frames, mono=overrides.mono)
    with as_ordered(scene, options.output, options.layout, options.file_format):
        # With a folder of their own, there and nowhere else, whatever the scene's path says.
        files = output_files(scene, frames, folder=options.output, mono=overrides.mono)
        settings = scene.render.image_settings
        layout = None if overrides.mono else options.layout or layout_of(scene)
        values = {"layout": layout, **format_values(scene)}
        folder = files[frames[0]][0].parent
        shown = _of_movie(layout, own_movies)
        half = writes_half_floats(scene)
        asked_panorama = overrides.panorama
        panorama = None if shown is None else movie_panorama(scene, frames, asked_panorama)
        lacks_mark = panorama is None and shown is not None and shows_panorama(scene, frames, asked_panorama)
        stem, file_format = output_stem(scene), settings.file_format
        output = Output(folder, stem, files, layout, file_format, shown, values, half, panorama, lacks_mark)
    if options.movie is not None:
        options = replace(options, movie=str(_movie_path(scene, options.movie, output)))
    check_output(output, options)
    return options, output


def check_output(output: Output, options: AnimationSettings) -> None:
    """Raise BadInputError if files of the frames, or of the movie, cannot be written: the drive does not take their
    names, or something else is in their place.
    """
    check_names(output.folder, _longest_names(output, options))
    there = Listing()
    for path in dict.fromkeys(filter(there.may_hold, output.all_files)):
        _check_can_be_written(path)


def _longest_names(output: Output, options: AnimationSettings) -> Iterator[str]:
    """Yield the longest names of the files that an animation makes in the end or meanwhile, to find out whether the
    drive takes them.
    """
    frame = max(output.files)
    yield from (path.name for path in output.files[frame])
    journal = Journal(output.folder, output.name)
    yield beside_name(f"{journal.name}{frame:04d}.json")
    yield beside_name(report_path(journal).name)
    if options.movie is not None:
        yield beside_name(f"{Path(options.movie).name}")


def _of_movie(layout: str | None, own_movies: bool) -> str | None:
    """Return the layout of a movie whose frames have this layout. Eyes in files of their own are put side by side,
    unless own_movies says that each eye is to have its own movie.
    """
    apart = layout == "multi-view" or (layout == "individual" and not own_movies)
    return "side-by-side" if apart else layout


def _with_movie(
    scene: bpy.types.Scene,
    options: AnimationSettings,
    asked: AnimationSettings,
    frames: Sequence[int],
    *,
    mono: bool,
) -> AnimationSettings:
    """Return the options for a scene whose own format is a movie: with that movie, and pictures of 16 bits until then.
    asked are the options as they were given, before frames were filled in. mono is as for `output_files`.
    """
    span = range(frames[0], frames[-1] + 1)
    with as_ordered(scene, options.output, None, None):
        movie = output_files(scene, frames[:1], folder=options.output, span=span, mono=mono)[frames[0]][0]
        if not mono and scene.render.image_settings.views_format == "INDIVIDUAL":
            suffix = next(view.file_suffix for view in scene.render.views if view.name == VIEWS[0])
            movie = movie.with_stem(movie.stem.removesuffix(suffix))
    output = options.output or str(movie.with_name(f"{movie.stem}.frames"))
    # A part of the frames is not worth a movie, unless it is asked for.
    own = None if options.output is not None and asked.frames is not None else str(movie)
    return replace(
        options,
        movie=own if options.movie is None else options.movie,
        file_format=options.file_format or PNG16,
        output=output,
    )


def _movie_path(scene: bpy.types.Scene, asked: str, output: Output) -> Path:
    """Return the path of the movie, as `movie_path` does, with a name that tells the layout where none is asked for."""
    stem = output.name.rstrip("#_-. ") or Path(bpy.data.filepath).stem or scene.name
    name = Path(f"{stem}.mp4")
    if output.movie_layout is not None:
        name = tagged_name(name, LAYOUTS[output.movie_layout], output.panorama)
    return movie_path(asked, output.folder, name.name)


def movie_path(asked: str, folder: Path, name: str) -> Path:
    """Return the path of a movie: `asked` itself; or the file of this name in it where it is a folder, and in `folder`
    where it is empty. Raises BadInputError where no movie can be written there.
    """
    path = Path(asked) if asked else folder
    if not asked or asked.endswith(("/", os.sep)) or path.is_dir():
        path = path / name
    check_movie(path)
    return path


def existing_as_set(scene: bpy.types.Scene) -> str:
    """Return what is to be done with frames that are there already, by the scene's own Overwrite: "overwrite" or
    "keep".
    """
    return "overwrite" if scene.render.use_overwrite else "keep"


def _check_can_be_written(path: Path) -> None:
    """Raise BadInputError when something other than a file is at this path, or when the file there cannot be
    written.
    """
    if path.is_dir():
        raise BadInputError(
            Words("{path} is a folder where a file is to be written: change the output path", path=path)
        )
    if path.exists() and not path.is_file():
        raise BadInputError(
            Words(
                "{path} is no regular file, where one is to be written: move it, or change the output path", path=path
            )
        )
    try:
        with contextlib.suppress(FileNotFoundError, NotADirectoryError), path.open("r+b"):
            pass
    except OSError as error:
        raise BadInputError(
            Words("{path} cannot be written ({reason}): is it in use?", path=path, reason=error.strerror)
        ) from error


def folders_of(output: Output) -> list[Path]:
    """Return the folders that the frames' files lie in, each once."""
    return list(dict.fromkeys(of_frame[0].parent for of_frame in output.files.values()))
