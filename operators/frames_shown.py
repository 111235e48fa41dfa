"""Look at any frame of a stereo animation with both eyes: an image of its files, which follows the scene's timeline.

Blender's player shows one file, and so the left eye alone where each eye has its own.
"""

from __future__ import annotations

from contextlib import nullcontext
from typing import Any

import bpy

from ..stereo_reproject.blender.output.image_settings import set_changed, values_of
from ..stereo_reproject.blender.scene.working import changed
from ..stereo_reproject.errors import BadInputError, StereoReprojectError
from ..stereo_reproject.words import Words
from . import wiggling
from .fitting import ICON_PX, first_that_fits
from .jobs import running
from .looking import pair_editor
from .pictures import FRAMES, SHOWN_FRAME, frame_shown, frames_image, image_editors, kind_of, render_result
from .redraw import redraw_panels
from .text import reported, sentence, shown
from .view_images import made_images
from .view_modes import ANAGLYPH, mode_of, show
from .viewing import files_of


def missing_frame(scene: bpy.types.Scene, frame: int) -> str | None:
    """Return why a frame of the scene's animation cannot be looked at; None where its files are there."""
    if scene.render.is_movie_format:
        return Words("A movie has no files of single frames: play it")
    missing = next((path for path in files_of(scene, frame) if not path.exists()), None)
    if missing is None:
        return None
    return Words("Frame {frame} is not there: {path} does not exist", frame=frame, path=missing)


def _load(scene: bpy.types.Scene, frame: int) -> bpy.types.Image:
    """Load a frame of the scene's animation into the image of frames, and return that. Raises BadInputError where a
    file cannot be read; whether its files are there, `missing_frame` says.
    """
    path = str(files_of(scene, frame)[0])
    image = frames_image()
    try:
        if image is None:
            image = bpy.data.images.load(path)
            image.name, image.is_runtime_data = FRAMES, True
        else:
            image.filepath = path
    except RuntimeError as error:
        reason = " ".join(str(error).removeprefix("Error: ").split())
        raise BadInputError(Words("{path} cannot be read: {reason}", path=path, reason=reason)) from error
    settings = scene.render.image_settings
    # Blender looks for the other eye's file as the format of the views is set, and only with Stereoscopy.
    with changed(scene.render, use_multiview=True):
        if settings.views_format == "STEREO_3D":
            set_changed(image.stereo_3d_format, values_of(settings.stereo_3d_format))
        if settings.views_format != "MULTIVIEW":
            image.use_multiview = True
            image.views_format = settings.views_format
    image.reload()
    # What Blender wrote with the scene's view transform has it already; light as it is needs it.
    image.use_view_as_render = image.is_float
    image[SHOWN_FRAME] = frame
    return image


class STEREO_REPROJECT_OT_look_at_frame(bpy.types.Operator):
    """Look at this frame of the stereo animation in the Image Editor, both eyes, from its files. The picture follows
    the timeline, and a second press shows the Render Result"""

    bl_idname = "stereo_reproject.look_at_frame"
    bl_label = "Look at Stereo Frame"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the present frame's files are there, or another frame is looked at, and no job runs that is
        about to show its own.
        """
        problem = None if _frames_looked_at(context) else missing_frame(context.scene, context.scene.frame_current)
        cls.poll_message_set(shown(problem or "A stereo job is running: its pictures are shown in the Image Editor"))
        return problem is None and running() is None and context.window is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Show the present frame in the way in which the pair is looked at; where it is shown already, or is not there
        and another one is shown, the Render Result; report an error where the files cannot be read.
        """
        space = context.space_data
        here = nullcontext() if space is not None and space.type == "IMAGE_EDITOR" else pair_editor()
        try:
            with here:
                _show(bpy.context)
        except (StereoReprojectError, OSError) as error:
            self.report({"ERROR"}, sentence(reported(error)))
            return {"CANCELLED"}
        redraw_panels()
        return {"FINISHED"}


def _show(context: bpy.types.Context) -> None:
    """Show the present frame in the Image Editor of the context, or the Render Result where that frame is shown, or
    another one in place of a frame that is not there. Raises BadInputError, StereoReprojectError and OSError.
    """
    space, scene = context.space_data, context.scene
    wiggling.end(space)
    mode = mode_of(context) or ANAGLYPH
    now, result, missing = frame_shown(space.image), render_result(), missing_frame(scene, scene.frame_current)
    goes_back = now is not None and (now == scene.frame_current or missing is not None)
    if goes_back and result is not None:
        show(context, result, mode)
    elif missing is not None:
        raise BadInputError(missing)
    else:
        show(context, _load(scene, scene.frame_current), mode)


@bpy.app.handlers.persistent
def _follow(scene: bpy.types.Scene, *_: Any) -> None:
    """Show the frame that the scene has come to in Image Editors that show another of its frames; where its files are
    not there, they keep that. Blender calls this after a change of the frame, in a render's thread too.
    """
    image = frames_image()
    if image is None or image[SHOWN_FRAME] == scene.frame_current or bpy.app.is_job_running("RENDER"):
        return
    spaces = [area.spaces.active for window, area in image_editors() if window.scene == scene]
    showing = [space.image for space in spaces if frame_shown(space.image) is not None]
    if not showing or missing_frame(scene, scene.frame_current) is not None:
        return
    try:
        _load(scene, scene.frame_current)
        kinds = {kind for kind in map(kind_of, showing) if kind is not None}
        if kinds:
            # Of what alternates, the eye that is not shown just now too.
            made_images(scene, image, sorted({*kinds, *wiggling.kinds_in_use()}))
    except (StereoReprojectError, OSError) as error:
        print(f"Stereo Reproject cannot show frame {scene.frame_current}: {error}")


def _frames_looked_at(context: bpy.types.Context) -> list[int]:
    """Return the frames that Image Editors show, in an Image Editor that which it shows itself."""
    space = context.space_data
    of_editor = space is not None and space.type == "IMAGE_EDITOR"
    images = [space.image] if of_editor else [area.spaces.active.image for _, area in image_editors()]
    return [frame for frame in map(frame_shown, images) if frame is not None]


def draw_frame(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the button that looks at the scene's present frame, pressed where a second press shows the Render Result."""
    frame, looked_at = context.scene.frame_current, _frames_looked_at(context)
    texts = Words("Look at Frame {frame}", frame=frame), Words("Frame {frame}", frame=frame)
    text = first_that_fits(context, tuple(map(shown, texts)), 1.0, ICON_PX)
    depress = frame in looked_at or (bool(looked_at) and missing_frame(context.scene, frame) is not None)
    layout.operator(STEREO_REPROJECT_OT_look_at_frame.bl_idname, text=text, icon="CAMERA_STEREO", depress=depress)


def stays_words(context: bpy.types.Context) -> str | None:
    """Return a sentence about the frame that is looked at though the timeline is at another, whose files are not there;
    None where that is not so.
    """
    frame, looked_at = context.scene.frame_current, _frames_looked_at(context)
    if not looked_at or frame in looked_at or missing_frame(context.scene, frame) is None:
        return None
    return Words("Frame {shown} is shown: frame {frame} has no file.", shown=looked_at[0], frame=frame)


def watch() -> None:
    """Begin to follow the timeline. Called when the extension is switched on."""
    bpy.app.handlers.frame_change_post.append(_follow)


def unwatch() -> None:
    """Undo `watch`, and remove the image. Called when the extension is switched off."""
    if _follow in bpy.app.handlers.frame_change_post:
        bpy.app.handlers.frame_change_post.remove(_follow)
    image = frames_image()
    if image is not None:
        for _, area in image_editors():
            if area.spaces.active.image == image:
                area.spaces.active.image = render_result()
        bpy.data.images.remove(image)
