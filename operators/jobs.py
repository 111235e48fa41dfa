"""The common part of operators that run a job: one at a time, with the window usable, or at once for a script."""

from __future__ import annotations

import traceback
from typing import ClassVar

import bpy

from ..stereo_reproject.blender.scene.rig import check_camera
from ..stereo_reproject.blender.scene.working import camera_at, check_engine, check_layers
from ..stereo_reproject.errors import StereoReprojectError
from ..stereo_reproject.jobs.progress import clock
from ..stereo_reproject.pipeline.stages import words_of
from . import slots
from .kept import STEREO_REPROJECT_OT_open_kept, keep_files
from .run import BackgroundJob

TICK_SECONDS = 0.1

_running: list[BackgroundJob] = []
"""The run that is under way, if any."""


_timers: list[bpy.types.Timer] = []


def running() -> BackgroundJob | None:
    return _running[0] if _running else None


def stop_running() -> None:
    """End what is under way, at once; a pair that is finished is kept on the disk."""
    while _running:
        run = _running.pop()
        try:
            words = _words_of_kept(run) if run.finished else ""
            if words:
                # Nobody is left to report to: the extension is switched off, or another file is opened.
                print(f"Stereo Reproject was ended{words}")
        finally:
            run.close()
    slots.unwatch()
    _quiet()


def _quiet() -> None:
    """No timer, and nothing in the status bar: nothing runs any more."""
    while _timers:
        bpy.context.window_manager.event_timer_remove(_timers.pop())
        _clear_status()
        _show(None)


def progress_of(run: BackgroundJob) -> tuple[float, str]:
    """Return the progress of a run, from 0 to 1, and in words."""
    fraction, remaining = run.far()
    words = [words_of(run.stage), *filter(None, [run.detail])]
    left = "" if remaining is None else f", {clock(remaining)} left"
    return fraction, f"{', '.join(words)}: {fraction:.0%}{left}"


class JobOperator:
    """Mixed into an operator: it says how its run starts and what is done with what comes of it."""

    uses_render_result: ClassVar[bool] = True

    def start(self, scene: bpy.types.Scene) -> BackgroundJob:
        """Raises StereoReprojectError."""
        raise NotImplementedError

    def take(self, scene: bpy.types.Scene | None, run: BackgroundJob) -> str:
        """Make what the run has left the user's, and say in a line what it is; without a scene, it was deleted
        meanwhile. Raises StereoReprojectError."""
        raise NotImplementedError

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if _running:
            cls.poll_message_set("A stereo job is running already: Esc ends it")
            return False
        if bpy.app.is_job_running("RENDER"):
            cls.poll_message_set("Blender is rendering: wait until it is done")
            return False
        return context.scene is not None

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if context.window is None:
            return self.execute(context)
        manager = context.window_manager
        # Before the run has its thread: in 4.5 an operator that is told its context does not bear another one's.
        for window in manager.windows:
            if window != context.window:
                with context.temp_override(window=window):  # pyright: ignore[reportGeneralTypeIssues] - not in the stubs
                    bpy.ops.stereo_reproject.listen("INVOKE_DEFAULT")
        if not self._start(context):
            return {"CANCELLED"}
        self._told = ""
        _timers.append(manager.event_timer_add(TICK_SECONDS, window=context.window))
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, _context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        run = running()
        if run is None:
            return {"CANCELLED"}
        if event.type == "ESC" and event.value == "PRESS":
            run.cancel()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        self._tell(progress_of(run)[1])
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
        """The window is closed, or another file is opened."""
        stop_running()

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self._start(context):
            return {"CANCELLED"}
        run = _running[0]
        try:
            run.wait()
            return self._finish()
        finally:
            if run in _running:
                stop_running()

    def _start(self, context: bpy.types.Context) -> bool:
        scene = context.scene
        try:
            if scene.stereo_reproject.source_engine == "scene":
                check_engine(scene)
            check_camera(camera_at(scene, scene.frame_current))
            check_layers(scene)
            slots.watch()
            _running.append(self.start(scene))
        except (StereoReprojectError, OSError) as error:
            slots.unwatch()
            self.report({"ERROR"}, sentence(error))
            return False
        return True

    def _finish(self) -> set[str]:
        """Hand over what came of the run, or say why there is nothing."""
        run = _running.pop()
        slots.unwatch()
        taken = False
        try:
            if run.error is not None:
                raise run.error
            words = self.take(_scene_of(run), run)
            taken = True
        except StereoReprojectError as error:
            if run.cancelled:
                self.report({"INFO"}, "Stereo render cancelled")
            else:
                self.report({"ERROR"}, sentence(error) + _words_of_kept(run))
            return {"CANCELLED"}
        except Exception as error:  # noqa: BLE001 - the user is to hear of it in a line, and the console in full
            traceback.print_exc()
            what = f"A defect of Stereo Reproject: {type(error).__name__}: {sentence(error)}"
            self.report({"ERROR"}, what + _words_of_kept(run))
            return {"CANCELLED"}
        finally:
            if not taken:
                run.close()
        for warning in run.warnings:
            self.report({"WARNING"}, sentence(warning))
        self.report({"INFO"}, words)
        return {"FINISHED"}

    def _tell(self, text: str) -> None:
        # Where the sidebar lies over the 3D View, that is drawn anew with it: not more often than there is news.
        if text != self._told:
            self._told = text
            _show(text)


def _words_of_kept(run: BackgroundJob) -> str:
    """Keep the pair of a run that nobody has taken, and say where it is; nothing if there is none."""
    try:
        folder = keep_files(run)
    except OSError as error:
        return f". The pair could not be kept either: {error.strerror or error}"
    return (
        "" if folder is None else f". The pair is kept in {folder}: Render > {STEREO_REPROJECT_OT_open_kept.bl_label}"
    )


def _scene_of(run: BackgroundJob) -> bpy.types.Scene | None:
    """The scene that a run is of; None when it was deleted since."""
    return next((scene for scene in bpy.data.scenes if scene.session_uid == run.uid), None)


def sentence(what: object) -> str:
    """A message on one line, with a capital."""
    text = " ".join(str(what).split())
    return text[:1].upper() + text[1:]


def _show(text: str | None) -> None:
    """Show a text in every window's status bar, and draw the panels anew."""
    for window in bpy.context.window_manager.windows:
        # The text belongs to the workspace of the context, whichever it is asked of.
        if text is not None:
            with bpy.context.temp_override(window=window):  # pyright: ignore[reportGeneralTypeIssues] - as above
                window.workspace.status_text_set(f"{text}   |   Esc: Cancel")
        for area in window.screen.areas:
            if area.type in ("PROPERTIES", "VIEW_3D", "IMAGE_EDITOR"):
                for region in area.regions:
                    if region.type == "UI" or (region.type == "WINDOW" and area.type == "PROPERTIES"):
                        region.tag_redraw()


def _clear_status() -> None:
    """Clear the status bar of every workspace: one that was left under way still has its text."""
    for workspace in bpy.data.workspaces:
        with bpy.context.temp_override(workspace=workspace):  # pyright: ignore[reportGeneralTypeIssues] - as above
            workspace.status_text_set(None)


class STEREO_REPROJECT_OT_listen(bpy.types.Operator):
    """Have Esc end the running job in this window too"""

    bl_idname = "stereo_reproject.listen"
    bl_label = "Listen for Esc"
    bl_options = {"INTERNAL"}

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, _context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        run = running()
        if run is None:
            return {"FINISHED", "PASS_THROUGH"}
        if event.type == "ESC" and event.value == "PRESS":
            run.cancel()
            return {"RUNNING_MODAL"}
        return {"PASS_THROUGH"}


class STEREO_REPROJECT_OT_cancel(bpy.types.Operator):
    """End the stereo job that is running. Of an animation, the frames that are finished stay"""

    bl_idname = "stereo_reproject.cancel"
    bl_label = "Cancel"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        return bool(_running)

    def execute(self, _context: bpy.types.Context) -> set[str]:
        _running[0].cancel()
        return {"FINISHED"}
