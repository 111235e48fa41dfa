"""The frames of a scene, one after the other, into the files that the scene's own output settings ask for.

Which frames, and that each is rendered once, is `sequence.frames`'s; `frame_maker` renders them and has them written.
"""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import asdict, dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any

import bpy

from ...delivery.layouts import LAYOUTS
from ...errors import BadInputError, OtherRunError, StereoReprojectError
from ...files import flush, flush_folder, put_in_place
from ...jobs.supervisor import Session
from ...jobs.warn_once import WarnOnce
from ...jobs.work_folder import work_folder
from ...pipeline.stages import Stage
from ...sequence.fingerprints import Fingerprints, FrameState, digest
from ...sequence.frames import FramePlan, plan_frames, render_frames
from ...sequence.journal import Journal
from ...sequence.movie_notes import MovieNote
from ...sequence.other_runs import announcement, check_frames_stayed, settle
from ...sequence.output_errors import failed_output
from ...sequence.progress import AnimationProgress, Listener
from ...sequence.report import report_path, write_animation_report
from ...sequence.runs import run_at_work
from ...sequence.writer_process import WriterJob
from ...settings.animation import AnimationSettings, spelled
from ...settings.frame import SceneOverrides, StereoSettings
from ..output.animation_output import Output, output_of
from ..output.frame_writer import holes_name
from ..output.movie import movie_files, movie_warnings, try_movie, write_movie
from ..scene.fingerprint import scene_fingerprints
from ..scene.rig import frame_region
from ..scene.warnings import scene_warnings
from ..scene.working import changed, scene_frames
from .frame_maker import BlenderFrameMaker, FrameContext

ANIMATION_FILES = ("left.exr", "right.exr")
"""Files of the last frame's eyes, which an animation leaves besides its own where that is asked for."""

ANNOUNCED_FRAMES = 20_000
"""Number of frames from which the user is told that they are planned, since that takes seconds."""


@dataclass(frozen=True)
class SavedScene:
    """The .blend that a scene was saved in, and its session: what the open Blender knows about it and the file does not
    tell.
    """

    blend: Path
    session: Session


@dataclass(frozen=True)
class _Run:
    """A run of an animation: what the steps from planning to the movie need.

    for_movie_alone: True where frames are rendered only to become a movie, and removed then. warnings are gathered for
    the animation's report.
    """

    scene: bpy.types.Scene
    output: Output
    context: FrameContext
    listener: Listener
    warnings: WarnOnce
    for_movie_alone: bool


def render_animation_files(
    scene: bpy.types.Scene,
    settings: StereoSettings,
    options: AnimationSettings,
    work: Path,
    saved: SavedScene,
    *,
    files: Sequence[str] = (),
    listener: Listener | None = None,
) -> dict[str, Any]:
    """Render the pair of each frame, and have Blender write it to the scene's output path, format and stereo layout.

    A file appears under its final name when it is whole. files are some of `ANIMATION_FILES`: eyes of the last frame,
    left in work/out. work is a private folder; saved is the scene's file, for the writer to open. Return the
    animation's report. Raises BadInputError and StereoReprojectError; frames that are finished by then stay.
    """
    listener = listener or Listener()
    # `warnings_ahead` has said these, before the first frame.
    warnings = WarnOnce(listener.warn, given=scene_warnings(scene, settings.scene))
    listener = replace(listener, warn=warnings)
    for_movie_alone = scene.render.is_movie_format and options.output is None
    _say_many(scene, options, listener)
    options, output = output_of(scene, options)
    journal = Journal(output.folder, output.name)
    _check_movies(scene, options, output, journal, for_movie_alone=for_movie_alone)
    wanted = Fingerprints(_settings_digest(settings, output), _scene_prints(scene, settings.scene))
    with _folder_for(output.folder, work) as private, ExitStack() as stack:
        stack.enter_context(_errors_of_output(output.folder))
        token = stack.enter_context(_run_in(journal, output, wanted, listener))
        context = FrameContext(settings, options, journal, wanted, token, output.half_floats)
        run = _Run(scene, output, context, listener, warnings, for_movie_alone)
        plan = _announced_plan(run)
        if options.movie is not None and plan.todo:
            _try_movie(scene, settings, Path(options.movie), output, private / "tried")
        failed, last = dict(options.skip), None
        if plan.todo:
            order = _order(saved, output, options, private)
            last = _render_planned(run, plan, failed, order, work, keeps_last=bool(files))
        report, movies = _finish(run, plan, failed)
    if for_movie_alone:
        with contextlib.suppress(OSError):
            output.folder.rmdir()
    written = [*([] if for_movie_alone else output.all_files), *movies]
    done = {"rendered": len(plan.todo), "there_already": sorted(plan.kept), "last": last}
    done["movies"] = [str(path) for path in movies]
    return {**report, "files": [str(path) for path in written], **done}


def _announced_plan(run: _Run) -> FramePlan:
    """Find out which frames are to be rendered, tell the listener, and return the plan."""
    context = run.context
    there = all(path.exists() for path in _movies_of(run.scene, context.options, run.output))
    plan = _plan(context.journal, run.output, context.wanted, context.options, run.listener, movies_are_there=there)
    for doubt in context.journal.records.new_doubts():
        run.listener.warn(doubt)
    _say_plan(plan, context.options, run.listener)
    return plan


def _render_planned(
    run: _Run, plan: FramePlan, failed: dict[int, str], order: WriterJob, work: Path, *, keeps_last: bool
) -> int | None:
    """Render the frames of the plan, and have `order`'s writer write them. Return the number of the last one, whose
    eyes are left in work/out if keeps_last; None if no frame was rendered here. Frames that fail go into `failed`, with
    the reason.
    """
    context = run.context
    progress = AnimationProgress(plan, len(run.output.files), run.listener, failed)
    maker = BlenderFrameMaker(run.scene, order, context, work, run.listener.on_stage, keeps_last=keeps_last)
    with closing(maker):
        try:
            render_frames(plan, context.journal, context.wanted, context.token, maker, progress.frame_listener)
        except StereoReprojectError as error:
            _report_early_end(error, run, failed)
            raise
        return maker.leave(work / "out")


def _finish(run: _Run, plan: FramePlan, failed: dict[int, str]) -> tuple[dict[str, Any], list[Path]]:
    """Write the report and the movies of an animation whose frames are rendered. Return the report and the paths of the
    movies. Raises StereoReprojectError if a frame has failed.
    """
    context, options = run.context, run.context.options
    run.listener.on_stage(Stage.WRITE, "")
    check_frames_stayed(context.journal, _finished(run.output, plan, failed), context.wanted)
    report = write_animation_report(context.journal, context.wanted, options, failed, run.warnings.given)
    _check_all_rendered(failed, len(run.output.files))
    # Another run may have made one meanwhile.
    _check_movies(run.scene, options, run.output, context.journal, for_movie_alone=run.for_movie_alone)
    movies = _movie(run.scene, options, run.output, context.journal, run.listener)
    if run.for_movie_alone:
        _remove_waiting(context.journal, run.output, movies[0], context.token)
    return report, movies


@contextmanager
def _run_in(journal: Journal, output: Output, wanted: Fingerprints, listener: Listener) -> Iterator[str]:
    """Announce this run in the journal, for the time of a `with` block; yields its token, by which other runs know it.
    Raises OtherRunError where a run with other settings is at work on the same frames.
    """
    _make_journal(journal)
    try:
        with run_at_work(journal.runs, announcement(journal, output.files, wanted)) as token:
            waits = "waits to see whether another run is at work"
            settle(journal, output.files, wanted, token, lambda _: listener.on_stage(Stage.PLAN, waits))
            yield token
    finally:
        journal.place.remove_empty()


def _finished(output: Output, plan: FramePlan, failed: Mapping[int, str]) -> list[int]:
    """Return the frames that count as rendered by these settings. Failed ones are left out, and so are those that are
    kept although they are of other settings.
    """
    whatever = {frame for frame, state in plan.kept.items() if state is not FrameState.WHOLE}
    return [frame for frame in output.files if frame not in failed and frame not in whatever]


def _make_journal(journal: Journal) -> None:
    """Make the journal's folder, if it is missing. Raises BadInputError where a file has its name."""
    try:
        journal.place.make()
    except FileExistsError as error:
        raise BadInputError(
            f"{journal.folder} is no folder, and one of that name belongs there for what is known of the frames:"
            " move it, or choose another folder"
        ) from error


def _say_many(scene: bpy.types.Scene, options: AnimationSettings, listener: Listener) -> None:
    """Tell the listener that planning begins; for a very long animation also that it takes a moment."""
    listener.on_stage(Stage.PLAN, "")
    frames = scene_frames(scene) if options.frames is None else options.frames
    if len(frames) >= ANNOUNCED_FRAMES and not options.goes_on:
        listener.note(f"plans {len(frames)} frames, which takes a moment")


def _plan(
    journal: Journal,
    output: Output,
    wanted: Fingerprints,
    options: AnimationSettings,
    listener: Listener,
    *,
    movies_are_there: bool,
) -> FramePlan:
    """Look at the files of all frames, and return which are to be rendered and which are kept.

    movies_are_there: True if no movie is left to be made. Raises BadInputError if Overwrite is off and there is nothing
    to do.
    """
    untouched = {*options.skip, *options.finished}
    files = {frame: list(paths) for frame, paths in output.files.items() if frame not in untouched}
    for frame, paths in files.items() if options.holes else ():
        paths.append(output.folder / holes_name(journal, frame))
    looked = count(1)
    plan = plan_frames(
        journal,
        files,
        wanted,
        options.existing,
        on_look=lambda _: listener.on_stage(Stage.PLAN, f"{next(looked)} of {len(files)} frames looked at"),
    )
    if options.existing == "keep" and not plan.todo and not options.goes_on and movies_are_there:
        there = output.all_files[0]
        raise BadInputError(f"{there} and all others are there already: switch on Overwrite in Output")
    return plan


def _report_early_end(error: StereoReprojectError, run: _Run, failed: Mapping[int, str]) -> None:
    """Write the report of a run that `error` has ended early. Nothing is written if another run has the frames, which
    then writes the report, or if there is nothing to report. An OSError is passed over.
    """
    context = run.context
    with contextlib.suppress(OSError):
        if not isinstance(error, OtherRunError) and (failed or context.journal.records.read_all()):
            texts = run.warnings.given
            write_animation_report(context.journal, context.wanted, context.options, failed, texts)


def _check_all_rendered(failed: dict[int, str], frames: int) -> None:
    """Raise StereoReprojectError if `failed`, reasons by frame number, has any; frames is how many there were in
    all.
    """
    if failed:
        frame, why = next(iter(failed.items()))
        raise StereoReprojectError(f"{len(failed)} of {frames} frames failed ({spelled(failed)}); frame {frame}: {why}")


@contextmanager
def _errors_of_output(folder: Path) -> Iterator[None]:
    """Turn an OSError that is raised in a `with` block into an error of one line about this output folder."""
    try:
        yield
    except OSError as error:
        raise failed_output(folder, error) from error


@contextmanager
def _folder_for(frames: Path, work: Path) -> Iterator[Path]:
    """Have a private folder on the same drive as the folder of frames, for the time of a `with` block; it yields the
    path. The folder lies in `work` where that is itself in the folder of frames.
    """
    if frames.is_dir() and (work / os.pardir).samefile(frames):
        private = work / "frames"
        private.mkdir(exist_ok=True)
        yield private
    else:
        with work_folder(frames, ()) as beside:
            yield beside / "tmp"


def _settings_digest(settings: StereoSettings, output: Output) -> str:
    """Return a digest of the settings on which a frame's files depend, the number of the frame and `compare` left
    out.
    """
    fields = asdict(replace(settings, compare=False, scene=replace(settings.scene, frame=None)))
    return digest({"settings": fields, "output": output.values})


def _scene_prints(scene: bpy.types.Scene, overrides: SceneOverrides) -> dict[str, str]:
    """Return the scene's fingerprints: a digest for each kind of datablock, and the version of Blender, since another
    one renders another picture. Values that the overrides replace (size, samples, seed) do not count: the overrides are
    in the digest of the settings.
    """
    with ExitStack() as changes:
        if overrides.size is not None:
            size = {"resolution_x": 1920, "resolution_y": 1080, "resolution_percentage": 100}
            changes.enter_context(changed(scene.render, **size))
        if overrides.samples is not None:
            changes.enter_context(changed(scene.cycles, samples=1))
            changes.enter_context(changed(scene.eevee, taa_render_samples=1))
            for layer in scene.view_layers:
                changes.enter_context(changed(layer, samples=0))
        if overrides.seed is not None:
            changes.enter_context(changed(scene.cycles, seed=0))
        prints = scene_fingerprints(scene)
    return {"Blender": ".".join(map(str, bpy.app.version[:2])), **prints}


def _say_plan(plan: FramePlan, options: AnimationSettings, listener: Listener) -> None:
    """Tell the listener which frames are there, which are rendered, and which are rendered again for what reason."""
    by_state: dict[FrameState, list[int]] = {}
    for frame, state in plan.todo.items():
        by_state.setdefault(state, []).append(frame)
    if plan.kept and not options.goes_on:
        listener.note(f"{len(plan.kept)} of {len(plan.kept) + len(plan.todo)} frames are there already")
        if FrameState.MISSING in by_state:
            listener.note(f"to be rendered: {spelled(by_state[FrameState.MISSING])}")
    for state in (FrameState.DAMAGED, FrameState.UNKNOWN, FrameState.OTHER_SETTINGS):
        if options.existing != "overwrite" and state in by_state:
            listener.note(f"rendered again, for being {state.value}: {spelled(by_state[state])}")
    others = [frame for frame, state in plan.kept.items() if state is not FrameState.WHOLE]
    if others:
        listener.warn(
            f"kept, for Overwrite is off, though not of the scene and settings as they are: {spelled(others)}"
        )


def _order(saved: SavedScene, output: Output, options: AnimationSettings, private: Path) -> WriterJob:
    """Return the order for the writer process: the file that it opens, and where and how it writes frames. private is a
    folder for what is handed over.
    """
    return WriterJob(
        blend=str(saved.blend),
        # The writer renders nothing.
        session=replace(saved.session, devices=None),
        private=str(private),
        folder=str(output.folder),
        name=output.name,
        output=options.output,
        layout=options.layout,
        file_format=options.file_format,
    )


def _movies_of(scene: bpy.types.Scene, options: AnimationSettings, output: Output) -> list[Path]:
    """Return the paths of the movies to be made of all frames: none, one, or one for each eye."""
    return [] if options.movie is None else movie_files(scene, Path(options.movie), output.movie_layout)


def _check_movies(
    scene: bpy.types.Scene, options: AnimationSettings, output: Output, journal: Journal, *, for_movie_alone: bool
) -> None:
    """Raise BadInputError if a file with the movie's name must not be replaced: it is no movie of these frames, or of
    more frames than there are now.
    """
    # What was known of a movie that alone was asked for went with the frames that it was made of.
    if options.existing == "overwrite" or (options.existing == "resume" and for_movie_alone):
        return
    how = "switch on Overwrite in Output" if options.existing == "keep" else "--overwrite replaces it"
    for path in _movies_of(scene, options, output):
        try:
            note = journal.movies.read(path) if path.exists() else MovieNote(None)
        except OSError as error:
            raise BadInputError(f"{path} cannot be read ({error.strerror})") from error
        if note is None:
            what = "is there already and is no movie of these frames"
            raise BadInputError(f"{path} {what}: {how}, another name keeps it")
        lost = (note.frames or frozenset()) - output.files.keys()
        if lost:
            what = f"is a movie of more frames, and the new one would lack {spelled(lost)}"
            raise BadInputError(f"{path} {what}: name those frames too; {how}, another name keeps it")


def _movie(
    scene: bpy.types.Scene, options: AnimationSettings, output: Output, journal: Journal, listener: Listener
) -> list[Path]:
    """Write the movie of all frames and return the paths: none if none is asked for, one, or one for each eye."""
    if options.movie is None:
        return []
    path = Path(options.movie)
    listener.on_stage(Stage.MOVIE, "")
    for warning in movie_warnings(path, output.movie_layout):
        listener.warn(warning)
    with work_folder(path.parent, ()) as beside:
        made = write_movie(
            scene, output.files, path, output.movie_layout, beside / "out", file_format=output.file_format
        )
        return [_put_noted(movie, path.with_name(movie.name), journal, output) for movie in made]


def _put_noted(movie: Path, place: Path, journal: Journal, output: Output) -> Path:
    """Move a finished movie to its place, note in the journal which frames it shows, and return the path."""
    with journal.movies.noted(movie, place, output.files):
        return _put_in_place(movie, place)


def _try_movie(scene: bpy.types.Scene, settings: StereoSettings, path: Path, output: Output, folder: Path) -> None:
    """Make a movie of one black frame, to find out before rendering whether the encoder and the movie's folder can be
    used. The parameter `folder` is a private one for the trial. Raises BadInputError.
    """
    region = frame_region(scene.render)
    width, height = settings.scene.size or (region.width, region.height)
    layout = LAYOUTS[output.movie_layout or "individual"]
    with work_folder(path.parent, ()):
        pass
    try_movie(scene, path, layout.across * width, layout.down * height, folder)


def _remove_waiting(journal: Journal, output: Output, movie: Path, own: str) -> None:
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
        where = f"the new one is {spare.name}" if spare.exists() else "the new one is lost"
        raise BadInputError(f"{destination} cannot be replaced ({error.strerror}): {where}") from error
