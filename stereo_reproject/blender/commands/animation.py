"""The frames of a scene, one after the other, into files that a later run can rely on.

What is rendered of each, a pair or many views, is one of `frame_kinds`. Which frames, and that each is rendered once,
is `sequence.frames`'s, asked by `animation_plan`; `frame_maker` renders them and has them written; `animation_movie`
makes them a movie.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import bpy

from ...errors import BadInputError, OtherRunError, StereoReprojectError
from ...jobs.supervisor import Session
from ...jobs.warn_once import WarnOnce
from ...jobs.work_folder import work_folder
from ...pipeline.stages import Stage
from ...sequence.fingerprints import Fingerprints, FrameState
from ...sequence.frames import FramePlan, render_frames
from ...sequence.journal import Journal
from ...sequence.other_runs import announcement, check_frames_stayed, settle
from ...sequence.output_errors import failed_output
from ...sequence.progress import AnimationProgress, Listener
from ...sequence.report import write_animation_report
from ...sequence.runs import run_at_work
from ...sequence.writer_process import WriterJob
from ...settings.animation import AnimationSettings, spelled
from ...settings.frame import StereoSettings, for_mono
from ...words import Words
from ..output.animation_output import Output
from ..scene.warnings import scene_warnings
from .animation_movie import check_movies, make_movie, movies_of, remove_waiting_frames, try_encoder
from .animation_plan import (
    announce_plan,
    announce_planning,
    planned_frames,
    scene_prints,
    settings_digest,
)
from .frame_kinds import FrameKind, Pairs
from .frame_maker import FrameContext, MakerJob

ANIMATION_FILES = ("left.exr", "right.exr")
"""Files of the last frame's eyes, which an animation leaves besides its own where that is asked for."""


@dataclass(frozen=True)
class SavedScene:
    """The .blend that a scene was saved in, its session, which is what the open Blender knows about it and the file
    does not tell, and a private folder for the work on it.
    """

    blend: Path
    session: Session
    work: Path


@dataclass(frozen=True)
class _Run:
    """A run of an animation: what the steps from planning to the movie need.

    for_movie_alone: True where frames are rendered only to become a movie, and removed then. warnings are gathered for
    the animation's report.
    """

    kind: FrameKind
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
    saved: SavedScene,
    *,
    files: Sequence[str] = (),
    listener: Listener | None = None,
) -> dict[str, Any]:
    """Render the pair of each frame, or its one view, and have Blender write it to the scene's output path, format and
    stereo layout.

    A file appears under its final name when it is whole. files are some of `ANIMATION_FILES`: eyes of the last frame,
    left in the folder `out` of saved.work. saved is the scene's file, for the writer to open. Return the animation's
    report. Raises BadInputError and StereoReprojectError; frames that are finished by then stay.
    """
    settings = for_mono(settings) if options.mono else settings
    return render_frames_of(Pairs(settings), scene, options, saved, files=files, listener=listener or Listener())


def render_frames_of(
    kind: FrameKind,
    scene: bpy.types.Scene,
    options: AnimationSettings,
    saved: SavedScene,
    *,
    files: Sequence[str] = (),
    listener: Listener,
) -> dict[str, Any]:
    """Do the work of `render_animation_files` for frames of any kind; files are those of the last frame that a kind can
    leave besides."""
    with kind.shaped(scene):
        return _rendered(kind, scene, options, saved, files, listener)


def _rendered(
    kind: FrameKind,
    scene: bpy.types.Scene,
    options: AnimationSettings,
    saved: SavedScene,
    files: Sequence[str],
    listener: Listener,
) -> dict[str, Any]:
    """Do the work of `render_frames_of`, in a scene whose pixels have their shape."""
    settings = kind.settings
    # `warnings_ahead` has said these, before the first frame.
    warnings = WarnOnce(listener.warn, given=scene_warnings(scene, settings.scene))
    listener = replace(listener, warn=warnings)
    for_movie_alone = scene.render.is_movie_format and options.output is None
    announce_planning(scene, options, listener)
    options, output = kind.output(scene, options)
    journal = Journal(output.folder, output.name)
    check_movies(scene, options, output, journal, for_movie_alone=for_movie_alone)
    wanted = Fingerprints(settings_digest(settings, output, reuse=options.reuse), scene_prints(scene, settings.scene))
    beside, errors = _folder_for(output.folder, saved.work), _errors_of_output(output.folder)
    with beside as private, errors, _run_in(journal, output, wanted, listener) as token:
        context = FrameContext(settings, options, journal, wanted, token, output.half_floats)
        run = _Run(kind, scene, output, context, listener, warnings, for_movie_alone)
        report = _made(run, saved, private, keeps_last=bool(files))
    if for_movie_alone:
        with contextlib.suppress(OSError):
            output.folder.rmdir()
    return report


def _made(run: _Run, saved: SavedScene, private: Path, *, keeps_last: bool) -> dict[str, Any]:
    """Make the run's frames and its movie, and return the animation's report. private is a folder on the drive of the
    frames; keeps_last is as for `_render_planned`."""
    plan, options, output = _announced_plan(run), run.context.options, run.output
    if options.movie is not None and plan.todo:
        try_encoder(run.scene, run.context.settings, Path(options.movie), output, private / "tried")
    failed, last = dict(options.skip), None
    if plan.todo:
        order = _order(saved, run, private)
        last = _render_planned(run, plan, failed, order, saved.work, keeps_last=keeps_last)
    report, movies = _finish(run, plan, failed)
    written = [*([] if run.for_movie_alone else output.all_files), *movies]
    done = {"rendered": len(plan.todo), "there_already": sorted(plan.kept), "last": last}
    done["movies"] = [str(path) for path in movies]
    return {**report, "files": [str(path) for path in written], **done}


def _announced_plan(run: _Run) -> FramePlan:
    """Find out which frames are to be rendered, tell the listener, and return the plan."""
    context = run.context
    there = all(path.exists() for path in movies_of(run.scene, context.options, run.output))
    plan = planned_frames(
        context.journal,
        run.output,
        context.wanted,
        context.options,
        run.listener,
        files=run.kind.files(run.scene, run.output, context.journal, context.options),
        movies_are_there=there,
    )
    for doubt in context.journal.records.new_doubts():
        run.listener.warn(doubt)
    announce_plan(plan, context.options, run.listener)
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
    maker = run.kind.maker(MakerJob(run.scene, order, context, work, run.listener, keeps_last))
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
    check_movies(run.scene, options, run.output, context.journal, for_movie_alone=run.for_movie_alone)
    movies = make_movie(run.scene, options, run.output, context.journal, run.listener)
    if run.for_movie_alone:
        remove_waiting_frames(context.journal, run.output, movies[0], context.token)
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
            Words(
                "{folder} is no folder, and one of that name belongs there for what is known of the frames: move it,"
                " or choose another folder",
                folder=journal.folder,
            )
        ) from error


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
        raise StereoReprojectError(
            Words(
                "{failed} of {all} frames failed ({frames}); frame {frame}: {why}",
                failed=len(failed),
                all=frames,
                frames=spelled(failed),
                frame=frame,
                why=why,
            )
        )


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


def _order(saved: SavedScene, run: _Run, private: Path) -> WriterJob:
    """Return the order for the writer process: the file that it opens, and where and how it writes frames. private is a
    folder for what is handed over.
    """
    output, options = run.output, run.context.options
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
        **run.kind.order(output),
    )
