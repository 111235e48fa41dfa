"""Play a stereo animation whose eyes are files of their own, also where the scene's Stereoscopy is off.

Blender's own View Animation looks for the files that the scene's settings would give a plain render, and finds none.
"""

from __future__ import annotations

from pathlib import Path

import bpy

from ..stereo_reproject.blender.scene.working import changed
from ..stereo_reproject.images.exr import VIEWS
from ..stereo_reproject.words import Words
from .text import reported

VIEWING = "View Stereo Animation (Ctrl Shift F11)"

PLAYS_BOTH = "Play the stereo animation that was rendered to the scene's output path, both eyes in one picture"
PLAYS_LEFT = (
    "Play the left eye of the stereo animation that was rendered to the scene's output path: Blender's player shows"
    " one file. Look at Frame, beside it, shows both eyes"
)
"""Tooltips, by the layout of the files."""


def needs_our_player(scene: bpy.types.Scene) -> bool:
    """Return whether Blender's own View Animation would not find the scene's stereo animation, but look for other
    files.
    """
    render = scene.render
    return not render.use_multiview and render.image_settings.views_format == "INDIVIDUAL"


def _frame_file(scene: bpy.types.Scene, frame: int, view: str) -> Path:
    """Return the path of a frame of the animation, or of its movie, by the scene's output settings. view names the eye
    whose file it is; "" stands for the file that both eyes share.
    """
    return Path(bpy.path.abspath(scene.render.frame_path(frame=frame, view=view)))


def files_of(scene: bpy.types.Scene, frame: int) -> tuple[Path, ...]:
    """Return the paths of a frame's files by the scene's output settings: the left and the right eye's, or the one of
    both.
    """
    apart = scene.render.image_settings.views_format == "INDIVIDUAL"
    return tuple(_frame_file(scene, frame, view) for view in (VIEWS if apart else ("",)))


class RENDER_OT_stereo_reproject_view_animation(bpy.types.Operator):
    """Play the stereo animation that was rendered to the scene's output path"""

    bl_idname = "render.stereo_reproject_view_animation"
    bl_label = "View Stereo Animation"

    @classmethod
    def description(cls, context: bpy.types.Context, _properties: bpy.types.OperatorProperties) -> str:
        """Return the button's tooltip, which says which eyes are played."""
        apart = context.scene.render.image_settings.views_format == "INDIVIDUAL"
        return PLAYS_LEFT if apart else PLAYS_BOTH

    unless_plain: bpy.props.BoolProperty(
        name="Unless Plain",
        description="Leave it to Blender's own View Animation where that finds its files",
        default=False,
        options={"HIDDEN", "SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Play the animation; if `unless_plain` is set and Blender's own player finds its files, leave the key to
        that.
        """
        scene = context.scene
        if self.unless_plain and (not needs_our_player(scene) or _frame_file(scene, scene.frame_start, "").exists()):
            return {"PASS_THROUGH"}
        return self.execute(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Play the animation in Blender's player, with Stereoscopy switched on meanwhile."""
        scene = context.scene
        path = files_of(scene, scene.frame_start)[0]
        if not path.exists():
            what = Words("There is no stereo animation to play: {path} does not exist, render it first", path=path)
            self.report({"ERROR"}, reported(what))
            return {"CANCELLED"}
        views = scene.render.views
        shown = next((k for k, view in enumerate(views) if view.name == VIEWS[0]), views.active_index)
        # Blender's player takes the active view's files, and none but with Stereoscopy.
        with changed(scene.render, use_multiview=True), changed(views, active_index=shown):
            try:
                return set(bpy.ops.render.play_rendered_anim())
            except RuntimeError as error:
                self.report({"ERROR"}, " ".join(str(error).removeprefix("Error: ").split()))
                return {"CANCELLED"}
