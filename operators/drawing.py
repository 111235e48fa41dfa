"""Parts that several panels draw: texts of many lines, the render buttons, and the verdict on the last result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import bpy

from ..stereo_reproject.blender.output.animation_output import existing_as_set
from ..stereo_reproject.blender.scene.denoiser import NO_DENOISER
from ..stereo_reproject.report.lines import wrapped
from ..stereo_reproject.report.verdict import (
    Verdict,
    animation_words,
    picture_words,
    quality_of,
    quality_of_animation,
    reuse_in_animation,
    saved_by_animation,
    saved_words,
    time_words,
)
from ..stereo_reproject.words import Words
from . import second_blender
from .fitting import ICON_PX, TEXT_MARGINS_PX, first_that_fits, fits, room_for_text, text_width
from .frames_shown import draw_frame, stays_words
from .jobs import STEREO_REPROJECT_OT_cancel, progress_shown, running
from .kept import STEREO_REPROJECT_OT_open_kept, kept_pair
from .prediction import full_gain_of
from .render import RENDER_OT_stereo_reproject_animation, RENDER_OT_stereo_reproject_image
from .results import Delivery, Result, result_of
from .run import BackgroundJob
from .run_words import cancelled_and_on
from .slots import content_now, holds
from .stereo import set_anew_words
from .text import sentence, shown
from .viewing import RENDER_OT_stereo_reproject_view_animation

NAME_SHARE = 0.6
"""Share of a row of figures that its name takes, so that figures of several rows stand below each other; less where the
figure needs more."""

BUTTON_SCALE = 1.3
"""Height of the render buttons, and of what stands in their place while a job runs, over that of a plain button."""

ICONS = {True: "CHECKMARK", False: "ERROR", None: "INFO"}
"""Icons of a verdict, by `Verdict.good`."""


def paragraph(layout: bpy.types.UILayout, context: bpy.types.Context, text: str, icon: str = "NONE") -> None:
    """Draw a text, translated, in as many lines as it needs, since Blender cuts a label off where its panel ends; an
    empty one takes a line. icon stands before the first line.
    """
    room = room_for_text(context)
    if icon != "NONE":
        room -= ICON_PX * context.preferences.system.ui_scale
    column = layout.column(align=True)
    column.scale_y = 0.8
    for k, line in enumerate(wrapped(shown(text), room, partial(text_width, context)) or [""]):
        column.label(text=line, icon=icon if k == 0 else "BLANK1" if icon != "NONE" else "NONE")


def draw_row(layout: bpy.types.UILayout, name: str, value: str) -> None:
    """Draw a name on the left and its value on the right, both translated, in two lines where one has no room for
    both.
    """
    context, name, value = bpy.context, shown(name), shown(value)
    room, margins = room_for_text(context), TEXT_MARGINS_PX * context.preferences.system.ui_scale
    left, right = (text_width(context, text) + margins for text in (name, value))
    if left + right > room:
        layout.label(text=name)
        row = layout.row()
    else:
        split = layout.split(factor=max(left / room, min(NAME_SHARE, 1.0 - right / room)))
        split.label(text=name)
        row = split.row()
    row.alignment = "RIGHT"
    row.label(text=value)


def draw_buttons(layout: bpy.types.UILayout) -> None:
    """Draw the render buttons in two rows. While a job runs, its progress and a button that cancels it stand there, in
    rows of the same height.
    """
    column = layout.column(align=True)
    column.scale_y = BUTTON_SCALE
    if draw_progress(column):
        return
    second_blender.keep_ready()
    image = RENDER_OT_stereo_reproject_image.bl_idname
    beside = fits(bpy.context, "Preview", 0.5, ICON_PX + TEXT_MARGINS_PX)
    row = column.row(align=True) if beside else column
    row.operator(image, text="Preview", icon="RENDER_STILL").preview = True
    row.operator(image, text="Render", icon="RENDER_RESULT").preview = False
    text = "Render Animation"
    icon = "RENDER_ANIMATION" if fits(bpy.context, text, 1.0, ICON_PX + TEXT_MARGINS_PX) else "NONE"
    column.operator(RENDER_OT_stereo_reproject_animation.bl_idname, text=text, icon=icon)


def draw_progress(column: bpy.types.UILayout) -> bool:
    """Draw the progress of the running job and a button that cancels it. Return False where no job is running."""
    if running() is None:
        return False
    now = progress_shown()
    column.progress(factor=now.fraction, text=shown(now.far))
    column.operator(STEREO_REPROJECT_OT_cancel.bl_idname, icon="X")
    return True


def _draw_running(layout: bpy.types.UILayout, context: bpy.types.Context, run: BackgroundJob) -> None:
    """Draw what the running job does, and of an animation what it has saved: a line of its own from the start on, so
    that the buttons below stay where they are."""
    if run.uid != context.scene.session_uid:
        paragraph(layout, context, Words("Scene {name}:", name=repr(run.scene_name)))
    paragraph(layout, context, progress_shown().stage)
    if run.animation is not None:
        paragraph(layout, context, progress_shown().saved)


def draw_outcome(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw what the running job does, or else the scene's last result: its picture's name, its verdict and warnings."""
    run = running()
    if run is not None:
        _draw_running(layout, context, run)
        return
    _draw_kept(layout, context)
    result = result_of(context.scene)
    if result.ended:
        ended = result.ended.removesuffix(".")
        if result.frames_stay:
            ended = cancelled_and_on(ended, existing_as_set(context.scene))
        text = Words("{sentence}.", sentence=ended)
        paragraph(layout, context, text, icon="ERROR" if result.failed else "INFO")
    if result.delivery is not None:
        _draw_result(layout.box(), context, result, result.delivery)
    if result.animation is not None or result.frames_stay:
        _draw_frames(layout, context)


def _draw_result(box: bpy.types.UILayout, context: bpy.types.Context, result: Result, delivery: Delivery) -> None:
    """Draw the name of the picture that was handed over, the verdict on the scene's last result, and its warnings."""
    slot = None if delivery.content is None else delivery.content.name
    if result.animation is None:
        name = picture_words(slot, delivery.frame, delivery.clock, preview=delivery.preview)
    else:
        name = animation_words(slot, delivery.frame, delivery.clock)
    paragraph(box, context, Words("{picture}:", picture=name))
    elsewhere = slot_words(context, delivery)
    if elsewhere is not None:
        paragraph(box, context, elsewhere, icon="INFO")
    report = result.report
    if report is not None and report["frame"] == context.scene.frame_current:
        anew = set_anew_words(context.scene, report)
        if anew is not None:
            paragraph(box, context, anew, icon="INFO")
    for verdict in verdicts_on(context.scene, result):
        paragraph(box, context, Words("{sentence}.", sentence=verdict.words), icon=ICONS[verdict.good])
    draw_noted(box, context, result.warnings)


def draw_noted(layout: bpy.types.UILayout, context: bpy.types.Context, warnings: Sequence[str]) -> None:
    """Draw the warnings of a run; that a denoiser is missing is none, as nothing can be done about it in this
    Blender.
    """
    for warning in warnings:
        icon = "INFO" if warning == NO_DENOISER else "ERROR"
        paragraph(layout, context, Words("{sentence}.", sentence=sentence(shown(warning))), icon=icon)


def _draw_frames(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the buttons that play an animation and look at its frames, and which frame is shown where the present one
    has no file.
    """
    play = RENDER_OT_stereo_reproject_view_animation
    text = first_that_fits(context, (play.bl_label, "View Animation", "View"), 1.0, ICON_PX)
    column = layout.column(align=True)
    column.operator(play.bl_idname, text=text, icon="PLAY")
    draw_frame(column, context)
    stays = stays_words(context)
    if stays is not None:
        paragraph(layout, context, stays, icon="INFO")


def verdicts_on(scene: bpy.types.Scene, result: Result) -> list[Verdict]:
    """Return the sentences about quality and time of a scene's last result, an animation or a pair."""
    if result.animation is not None:
        rows = result.animation["frames"]
        told = quality_of_animation(rows), reuse_in_animation(rows)
        return [*filter(None, told), *_saved_by_frames(result)]
    if result.report is None:
        return []
    gain = full_gain_of(scene)
    words = time_words(result.report, full_gain=gain)
    pays = gain is None and not words.startswith("No time")
    return [quality_of(result.report, preview=gain is not None), Verdict(words, good=True if pays else None)]


def _saved_by_frames(result: Result) -> list[Verdict]:
    """Return sentences about the time that the frames of the last animation have saved: those of its last run, and
    where more of them are recorded, all of these too.
    """
    assert result.animation is not None
    everything, new = result.animation["totals"], result.new_totals
    if new is None or new["frames"] == everything["frames"]:
        return [_saved_by(everything, "1 frame, {saved}", "{count} frames, {saved}")]
    of_run = _saved_by(new, "1 frame rendered now, {saved}", "{count} frames rendered now, {saved}")
    return [of_run, _saved_by(everything, "1 frame in all, {saved}", "{count} frames in all, {saved}")]


def _saved_by(totals: Mapping[str, Any], one: str, more: str) -> Verdict:
    """Return a sentence about the time that frames with these totals have saved; one and more are its messages for one
    frame and for several.
    """
    saved, count = saved_by_animation(totals), totals["frames"]
    words = Words(one if count == 1 else more, count=count, saved=saved_words(saved, totals["multiview_seconds"]))
    return Verdict(words, good=None if saved <= 0.0 else True)


def slot_words(context: bpy.types.Context, delivery: Delivery) -> str | None:
    """Return words for where a picture that was handed over is not seen; None where it is."""
    if _is_shown(context, delivery):
        return None
    gone = delivery.content is not None and not holds(delivery.content)
    return "Another render has taken its slot." if gone else "Another picture is shown now."


def _is_shown(context: bpy.types.Context, delivery: Delivery) -> bool:
    """Return whether a picture that was handed over is still what its render slot holds, and that slot is the active
    one. In an Image Editor that shows the Render Result or nothing of ours, that is what is seen there.
    """
    space = context.space_data
    if delivery.content is None:
        return True
    if space is not None and space.type == "IMAGE_EDITOR" and space.image is not None:
        ours = space.image.name.startswith("Stereo ") or space.image.type == "RENDER_RESULT"
        if not ours:
            return False
    return content_now() == delivery.content


def _draw_kept(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the folder of a pair that could not be handed over, and a button that opens it; nothing if there is none."""
    folder = kept_pair()
    if folder is not None:
        text = Words("A pair could not be handed over and is kept in {folder}.", folder=folder)
        paragraph(layout, context, text, icon="ERROR")
        layout.operator(STEREO_REPROJECT_OT_open_kept.bl_idname, icon="CAMERA_STEREO")
