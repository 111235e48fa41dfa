"""The common part of operators that run a job: one at a time, with the window usable, or at once for a script."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence
from functools import partial
from typing import ClassVar

import bpy

from ..stereo_reproject.blender.scene.denoiser import NO_DENOISER
from ..stereo_reproject.blender.scene.rendered import camera_at, check_engine, check_layers
from ..stereo_reproject.blender.scene.rig import check_camera, check_engine_shows
from ..stereo_reproject.errors import StereoReprojectError
from ..stereo_reproject.words import Words
from . import screen_here, slots, under_way
from .kept import STEREO_REPROJECT_OT_open_kept, keep_files
from .redraw import redraw_panels
from .results import has_preview, result_of
from .run import BackgroundJob, other_windows
from .run_words import RunProgress, cancelled_and_on, cancelled_words, run_progress, ways_to_say
from .text import reported, sentence, shown

TICK_SECONDS = 0.1

CANCELLED_SECONDS = 30.0
"""Time for which the panels say that a job was cancelled that leaves nothing behind."""

DOUBLE_CLICKS = 1.5
"""Blender's times for a double click after the start of a job in which a click does not cancel it."""

_running: list[BackgroundJob] = []
"""The run that is under way, if any."""


_timers: list[bpy.types.Timer] = []

_shown_progress: list[RunProgress] = []
"""Progress of the job that is under way, as the window was told it last; none before that."""

_forgetting: list[Callable[[], None]] = []
"""Call that is due for the words about the last cancelled job, if any."""

_said: set[str] = set()
"""Warnings that need to be reported once, as nothing can be done about them in this Blender, and were."""


def running() -> BackgroundJob | None:
    """Return the job that is under way, or None."""
    return _running[0] if _running else None


def progress_shown() -> RunProgress:
    """Return the progress of the job that is under way as every place of the window says it: panels may be drawn at
    any moment, and status bars only when they are told.
    """
    return _shown_progress[0] if _shown_progress else run_progress(_running[0])


def stop_running() -> None:
    """End the job that is under way, at once, and remove its files. If it has finished a pair that nobody has taken,
    that is first copied to where it stays, and a line with its folder is printed.
    """
    while _running:
        run = _running.pop()
        try:
            words = _words_of_kept(run) if run.finished else ""
            if words:
                # Nobody is left to report to: the extension is switched off, or another file is opened.
                print(f"Stereo Reproject was ended{words}")
        finally:
            run.close()
            under_way.give_back(close=False)
    _quiet()


def _quiet() -> None:
    """Stop the timer of the job that is over, and clear the status bar of every window."""
    _shown_progress.clear()
    while _timers:
        bpy.context.window_manager.event_timer_remove(_timers.pop())
        _clear_status()
        _show(None)


class JobOperator:
    """Mixin of operators that run a job in a process of its own, one job at a time. With a window, Blender stays usable
    and Esc ends the job; without one, the operator waits for it. A subclass starts its job in `start`, and hands over
    the result in `take`.

    uses_render_result: True where the result becomes the Render Result. Then the operator waits for another render of
    the user's to end, and goes on even if its scene is deleted.
    """

    uses_render_result: ClassVar[bool] = True

    def start(self, scene: bpy.types.Scene) -> BackgroundJob:
        """Start the job for this scene and return it; each subclass has its own. Raises StereoReprojectError."""
        raise NotImplementedError

    def fits_pictures(self, scene: bpy.types.Scene) -> bool:
        """Return whether the pictures of the job are fitted to the Image Editor that shows them."""
        return has_preview(scene)

    def take(self, scene: bpy.types.Scene | None, run: BackgroundJob) -> str:
        """Hand the results of a finished run over to the user, and return a line that says what they are. scene is None
        if it was deleted while the job ran. Each subclass has its own. Raises StereoReprojectError.
        """
        raise NotImplementedError

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether a job can start now: there is a scene, and neither a job nor a render of Blender's is
        running.
        """
        if _running:
            cls.poll_message_set(shown("A stereo job is running already: Esc ends it"))
            return False
        if bpy.app.is_job_running("RENDER"):
            cls.poll_message_set(shown("Blender is rendering: wait until it is done"))
            return False
        return context.scene is not None

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Start the job and leave it to `modal`, so that the window stays usable; without a window, run it by
        `execute`.
        """
        if context.window is None:
            return self.execute(context)
        if not self._start(context, self._open_windows):
            return {"CANCELLED"}
        manager = context.window_manager
        self._told: Sequence[Sequence[str]] = []
        _timers.append(manager.event_timer_add(TICK_SECONDS, window=context.window))
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def _open_windows(self, context: bpy.types.Context) -> None:
        """Have an Image Editor ready that shows the eyes, and Esc end the job in every window. It must be called before
        the run has its thread: in 4.5 an operator that is told its context does not bear another one's.
        """
        if self.uses_render_result:
            under_way.open_editor(fit=self.fits_pictures(context.scene))
        for window in other_windows(context):
            with context.temp_override(window=window):  # pyright: ignore[reportGeneralTypeIssues] - not in the stubs
                bpy.ops.stereo_reproject.listen("INVOKE_DEFAULT")

    def modal(self, _context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Handle a window event while the job runs: Esc cancels the job, the timer shows progress and takes the
        result.
        """
        run = running()
        if run is None:
            return {"CANCELLED"}
        if ends_job(event):
            run.cancel()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        run.looks += 1
        now = run_progress(run)
        _shown_progress[:] = [now]
        self._tell([[shown(line) for line in lines] for lines in ways_to_say(now)])
        under_way.update(run.picture)
        # A check of a scene that was deleted is of no use; a pair is.
        if _scene_of(run) is None and not self.uses_render_result:
            run.cancel()
        # Blender has one render at a time, and the user may have begun another.
        delivers = self.uses_render_result and run.error is None
        if not run.finished or (delivers and bpy.app.is_job_running("RENDER")):
            return {"PASS_THROUGH"}
        _quiet()
        return self._finish()

    def cancel(self, _context: bpy.types.Context) -> None:
        """End the job. Blender calls this when the window is closed, or another file is opened."""
        stop_running()

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Run the job and wait until it is over: for scripts, and where there is no window."""
        if not self._start(context):
            return {"CANCELLED"}
        run = _running[0]
        try:
            run.wait()
            return self._finish()
        finally:
            if run in _running:
                stop_running()

    def _start(self, context: bpy.types.Context, before: Callable[[bpy.types.Context], None] = lambda _: None) -> bool:
        """Check the scene, call `before`, and start the job. Return whether it was started; if not, the user is shown
        the error.
        """
        scene = context.scene
        try:
            if scene.stereo_reproject.source_engine == "scene":
                check_engine(scene)
            camera, chosen = check_camera(camera_at(scene, scene.frame_current)), scene.stereo_reproject.source_engine
            check_engine_shows(camera, scene.render.engine if chosen == "scene" else chosen.upper())
            check_layers(scene)
            before(context)
            slots.note_start()
            _running.append(self.start(scene))
        except (StereoReprojectError, OSError) as error:
            under_way.give_back()
            self._end_without_result({"ERROR"}, sentence(reported(error)), scene)
            return False
        result = result_of(scene)
        result.ended, result.frames_stay = "", False
        return True

    def _end_without_result(
        self, kind: set[str], words: str, scene: bpy.types.Scene | None, *, existing: str | None = None
    ) -> None:
        """Report, as this kind, why a job has no result, and keep it for the scene's panels: the report may be lost
        with the window that was opened for the job. Where frames of an animation stay, existing says what the next run
        does with them, and the report how to go on; the panels say so by what is set then.
        """
        self.report(kind, words if existing is None else reported(cancelled_and_on(words, existing)))
        if scene is not None:
            result = result_of(scene)
            result.ended, result.failed, result.frames_stay = words, kind == {"ERROR"}, existing is not None

    def _finish(self) -> set[str]:
        """Hand over the result of the run that is over, and return what Blender expects: {"FINISHED"} or {"CANCELLED"}.
        Errors and warnings are shown to the user, not raised.
        """
        run = _running.pop()
        taken = False
        try:
            if run.error is not None:
                raise run.error
            words = self.take(_scene_of(run), run)
            taken = True
        except StereoReprojectError as error:
            if run.cancelled:
                words = reported(cancelled_words(run))
                existing = _existing_of_cancelled(run)
                self._end_without_result({"INFO"}, words, _scene_of(run), existing=existing)
                if existing is None:
                    # It says nothing that anyone needs to know for longer.
                    _forget_later(run, words)
            else:
                words = sentence(reported(error)) + reported(_words_of_kept(run))
                self._end_without_result({"ERROR"}, words, _scene_of(run))
            return {"CANCELLED"}
        except Exception as error:  # noqa: BLE001 - the user is to hear of it in a line, and the console in full
            traceback.print_exc()
            reason = sentence(str(error))
            what = Words("A defect of Stereo Reproject: {kind}: {reason}", kind=type(error).__name__, reason=reason)
            self._end_without_result({"ERROR"}, reported(what) + reported(_words_of_kept(run)), _scene_of(run))
            return {"CANCELLED"}
        finally:
            under_way.give_back()
            if not taken:
                run.close()
        for warning in run.warnings:
            if warning not in _said:
                self.report({"WARNING"}, sentence(reported(warning)))
        _said.update({NO_DENOISER} & set(run.warnings))
        self.report({"INFO"}, words)
        return {"FINISHED"}

    def _tell(self, ways: Sequence[Sequence[str]]) -> None:
        """Show a text about progress in every window's status bar, and over the pictures of the run, if it is another
        than before. The first of the ways to say it is its single line; the others are for where that has no room.
        """
        # Where the sidebar lies over the 3D View, that is drawn anew with it: not more often than there is news.
        if ways != self._told:
            self._told = ways
            _show(ways[0][0])
            under_way.say(ways)


def _existing_of_cancelled(run: BackgroundJob) -> str | None:
    """Return the setting by which the next run takes the frames that stay of a cancelled animation; None where none
    stay."""
    animation = run.animation
    if animation is None or not (run.frames_finished or animation.there_already()):
        return None
    return animation.settings.existing


def _forget_later(run: BackgroundJob, words: str) -> None:
    """Have `_forget_words` called after a while, and no more for what was said before."""
    while _forgetting:
        earlier = _forgetting.pop()
        if bpy.app.timers.is_registered(earlier):
            bpy.app.timers.unregister(earlier)
    _forgetting.append(partial(_forget_words, run, words))
    bpy.app.timers.register(_forgetting[-1], first_interval=CANCELLED_SECONDS)


def _forget_words(run: BackgroundJob, words: str) -> None:
    """Have the panels of a run's scene no longer say why its last job ended, if these are the words."""
    scene = _scene_of(run)
    if scene is not None and result_of(scene).ended == words:
        result_of(scene).ended = ""
        redraw_panels()


def _words_of_kept(run: BackgroundJob) -> str:
    """Move the pair of a run that could not be handed over to where it stays. Return words about that, to be added to
    an error message; "" if the run has no pair.
    """
    try:
        folder = keep_files(run)
    except OSError as error:
        return Words(". The pair could not be kept either: {reason}", reason=error.strerror or str(error))
    if folder is None:
        return ""
    where = Words(STEREO_REPROJECT_OT_open_kept.bl_label)
    return Words(". The pair is kept in {folder}: Render > {where}", folder=folder, where=where)


def _scene_of(run: BackgroundJob) -> bpy.types.Scene | None:
    """Return the scene that a run was started for; None if it was deleted since."""
    return next((scene for scene in bpy.data.scenes if scene.session_uid == run.uid), None)


def _show(text: str | None) -> None:
    """Show a text in every window's status bar, and draw the panels anew. With None, only the panels are drawn anew."""
    for window in bpy.context.window_manager.windows if text is not None else ():
        # The text belongs to the workspace of the context, whichever it is asked of.
        with bpy.context.temp_override(window=window):  # pyright: ignore[reportGeneralTypeIssues] - as above
            window.workspace.status_text_set(text)
    redraw_panels()


def _clear_status() -> None:
    """Clear the status bar of every workspace, also of those that are not shown now."""
    for workspace in bpy.data.workspaces:
        with bpy.context.temp_override(workspace=workspace):  # pyright: ignore[reportGeneralTypeIssues] - as above
            workspace.status_text_set(None)


def ends_job(event: bpy.types.Event) -> bool:
    """Return whether an event of a window ends the running job: Esc, unless it puts an eyedropper away."""
    return event.type == "ESC" and event.value == "PRESS" and not screen_here.is_out()


class STEREO_REPROJECT_OT_listen(bpy.types.Operator):
    """Have Esc end the running job in this window too"""

    bl_idname = "stereo_reproject.listen"
    bl_label = "Listen for Esc"
    bl_options = {"INTERNAL"}

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Begin to receive the events of this window."""
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, _context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Cancel the job on Esc, and pass other events on; end when no job runs any more."""
        run = running()
        if run is None:
            return {"FINISHED", "PASS_THROUGH"}
        if event.type == "ESC" and event.value == "PRESS" and screen_here.is_out():
            screen_here.put_away()
            return {"RUNNING_MODAL"}
        if ends_job(event):
            run.cancel()
            return {"RUNNING_MODAL"}
        return {"PASS_THROUGH"}


class STEREO_REPROJECT_OT_cancel(bpy.types.Operator):
    """End the stereo job that is running. Of an animation, the frames that are finished stay"""

    bl_idname = "stereo_reproject.cancel"
    bl_label = "Cancel"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        """Return whether a job is running."""
        return bool(_running)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Cancel the running job, unless it has only just begun: then the click is the second one of a double click on
        the button that was here before.
        """
        double_click = 1e-3 * context.preferences.inputs.mouse_double_click_time
        # By the clock a window that is slow to draw would take the second click for a late one.
        if _running[0].looks * TICK_SECONDS < DOUBLE_CLICKS * double_click:
            return {"CANCELLED"}
        return self.execute(context)

    def execute(self, _context: bpy.types.Context) -> set[str]:
        """Cancel the running job."""
        _running[0].cancel()
        return {"FINISHED"}
