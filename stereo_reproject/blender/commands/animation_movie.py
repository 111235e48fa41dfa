"""The movie of an animation: whether it can be made, and its making once all frames are there."""

from __future__ import annotations

import contextlib
import shutil
from pathlib import Path

import bpy

from ...errors import BadInputError
from ...files import flush, flush_folder, put_in_place
from ...jobs.work_folder import work_folder
from ...pipeline.stages import Stage
from ...sequence.journal import Journal
from ...sequence.movie_notes import MovieNote
from ...sequence.progress import Listener
from ...sequence.report import report_path
from ...settings.animation import AnimationSettings, spelled
from ...settings.frame import StereoSettings
from ...words import Words
from ..output.animation_output import Output
from ..output.movie import try_movie


def movies_of(scene: bpy.types.Scene, options: AnimationSettings, output: Output) -> list[Path]:
    """Return the paths of the movies to be made of all frames: none, one, or one for each eye."""
    return [] if options.movie is None else output.movies(scene, Path(options.movie))


def check_movies(
    scene: bpy.types.Scene, options: AnimationSettings, output: Output, journal: Journal, *, for_movie_alone: bool
) -> None:
    """Raise BadInputError if a file with the movie's name must not be replaced: it is no movie of these frames, or of
    more frames than there are now.
    """
    # What was known of a movie that alone was asked for went with the frames that it was made of.
    if options.existing == "overwrite" or (options.existing == "resume" and for_movie_alone):
        return
    how = Words("switch on Overwrite in Output" if options.existing == "keep" else "--overwrite replaces it")
    for path in movies_of(scene, options, output):
        try:
            note = journal.movies.read(path) if path.exists() else MovieNote(None)
        except OSError as error:
            raise BadInputError(Words("{path} cannot be read ({reason})", path=path, reason=error.strerror)) from error
        if note is None:
            message = "{path} is there already and is no movie of these frames: {how}, another name keeps it"
            raise BadInputError(Words(message, path=path, how=how))
        lost = (note.frames or frozenset()) - output.files.keys()
        if lost:
            raise BadInputError(
                Words(
                    "{path} is a movie of more frames, and the new one would lack {frames}: name those frames too;"
                    " {how}, another name keeps it",
                    path=path,
                    frames=spelled(lost),
                    how=how,
                )
            )


def try_encoder(scene: bpy.types.Scene, settings: StereoSettings, path: Path, output: Output, folder: Path) -> None:
    """Make a movie of one black frame, to find out before rendering whether the encoder and the movie's folder can be
    used. The parameter `folder` is a private one for the trial. Raises BadInputError.
    """
    width, height = output.movie_size(scene, settings.scene.size)
    with work_folder(path.parent, ()):
        pass
    try_movie(scene, path, width, height, folder)


def make_movie(
    scene: bpy.types.Scene, options: AnimationSettings, output: Output, journal: Journal, listener: Listener
) -> list[Path]:
    """Write the movie of all frames and return the paths: none if none is asked for, one, or one for each eye."""
    if options.movie is None:
        return []
    path = Path(options.movie)
    listener.on_stage(Stage.MOVIE, "")
    for warning in output.movie_warnings(path):
        listener.warn(warning)
    with work_folder(path.parent, ()) as beside:
        made = output.write_movie(scene, path, beside / "out")
        return [_put_noted(movie, path.with_name(movie.name), journal, output) for movie in made]


def _put_noted(movie: Path, place: Path, journal: Journal, output: Output) -> Path:
    """Move a finished movie to its place, note in the journal which frames it shows, and return the path."""
    with journal.movies.noted(movie, place, output.files):
        return _put_in_place(movie, place)


def _put_in_place(made: Path, destination: Path) -> Path:
    """Move a finished file to its place on the same drive, where it appears whole; return the path. Raises
    BadInputError if it cannot be put there; the message then names the spare file that has it.
    """
    flush(made)
    try:
        placed = put_in_place(made, destination)
        flush_folder(destination.parent)
        return placed
    except OSError as error:
        spare = destination.with_stem(f"{destination.stem}-new-{made.stat().st_mtime_ns}")
        with contextlib.suppress(OSError):
            made.replace(spare)
        where = Words("the new one is {name}", name=spare.name) if spare.exists() else Words("the new one is lost")
        raise BadInputError(
            Words(
                "{destination} cannot be replaced ({reason}): {where}",
                destination=destination,
                reason=error.strerror,
                where=where,
            )
        ) from error


def remove_waiting_frames(journal: Journal, output: Output, movie: Path, own: str) -> None:
    """Remove the frames that were rendered only for the movie, and their journal; their report moves beside the movie.

    own is this run's token: while any other run is at work on the frames, nothing is removed. Errors are passed over.
    """
    if journal.runs.any_lives(but=own):
        return
    with contextlib.suppress(OSError):
        for kind in (".json", ".png", ".svg"):
            report = report_path(journal).with_suffix(kind)
            if report.exists():
                report.replace(movie.with_name(f"{movie.stem}_animation{kind}"))
        for path in output.all_files:
            path.unlink(missing_ok=True)
        shutil.rmtree(journal.folder, ignore_errors=True)
