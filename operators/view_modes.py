"""Ways to look at a stereo pair in an Image Editor: with red-cyan glasses, or without any."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy

from ..stereo_reproject.blender.scene.working import changed
from ..stereo_reproject.errors import BadInputError, StereoReprojectError
from . import wiggling
from .jobs import running
from .pictures import find_editor, fit_editor, image_editors, is_ours, kind_of, redraw_with_both_eyes, render_result
from .results import result_of
from .run import other_windows
from .slots import content_now
from .text import reported, sentence, shown
from .view_images import has_two_views, image_of, made_images, pair_shown_in, remove_all, remove_unused
from .zoom_and_place import drawn_at, put_at

ANAGLYPH, WIGGLE = "ANAGLYPH", "WIGGLE"

MODES = {
    ANAGLYPH: ("Anaglyph", "Both eyes in one picture, for red-cyan glasses"),
    "LEFT": ("Left", "The left eye alone"),
    "RIGHT": ("Right", "The right eye alone"),
    "SIDE_BY_SIDE": ("Side by Side", "The left eye on the left: look through the screen to see depth without glasses"),
    "CROSS_EYED": ("Cross-Eyed", "The left eye on the right: squint to see depth without glasses"),
    WIGGLE: ("Wiggle", "The eyes one after the other, so that depth is seen without glasses. Esc ends it"),
}
"""Names and tooltips of the modes."""

_SHOWN = [(mode, *texts) for mode, texts in MODES.items() if mode != WIGGLE]
"""Modes that an editor stays in, as items of an enumeration."""

NO_PAIR = "There is no stereo pair to look at: click Preview or Render first"

_last_modes: dict[int, tuple[str, str]] = {}
"""Mode in which an Image Editor was last set to show a pair, and the name of the pair's image, by the editor's space:
an undo to before that takes our images away."""


def mode_in(window: bpy.types.Window, space: bpy.types.SpaceImageEditor) -> str | None:
    """Return the mode in which an Image Editor of this window shows a pair, a key of `MODES`; None if in none."""
    if wiggling.is_wiggling(space):
        return WIGGLE
    kind = kind_of(space.image)
    if kind is not None or space.image is None:
        return kind
    in_stereo = has_two_views(space.image) and space.show_stereo_3d
    return ANAGLYPH if in_stereo and window.stereo_3d_display.display_mode == ANAGLYPH else None


def mode_of(context: bpy.types.Context) -> str | None:
    """Return the mode in which the Image Editor of the context shows a pair, a key of `MODES`; None if in none."""
    return mode_in(context.window, context.space_data)


def pair_in(context: bpy.types.Context) -> bpy.types.Image | None:
    """Return the image with the pair that an Image Editor shows or would show, that of the context or else the one in
    which pairs are shown; where there is none of these, the pair that was rendered last. None if there is none, as far
    as Blender knows without a look at the pixels.
    """
    space = context.space_data
    if space is None or space.type != "IMAGE_EDITOR":
        area = find_editor()
        space = None if area is None else area.spaces.active
    pair = render_result() if space is None else pair_shown_in(space)
    if pair is None or has_two_views(pair):
        return pair
    delivery = result_of(context.scene).delivery
    return pair if delivery is not None and delivery.content in (None, content_now()) else None


class _OfPair:
    """Mixin of operators that need an Image Editor and a pair."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the operator is called in an Image Editor and there is a pair."""
        if context.space_data is None or context.space_data.type != "IMAGE_EDITOR":
            message = shown("A pair is looked at in an Image Editor")
            cls.poll_message_set(message)  # pyright: ignore[reportAttributeAccessIssue]
            return False
        if pair_in(context) is None:
            cls.poll_message_set(shown(NO_PAIR))  # pyright: ignore[reportAttributeAccessIssue]
            return False
        return True


class STEREO_REPROJECT_OT_show_view(_OfPair, bpy.types.Operator):
    """Look at the stereo pair in this Image Editor"""

    bl_idname = "stereo_reproject.show_view"
    bl_label = "Look at Stereo Pair"

    mode: bpy.props.EnumProperty(name="Mode", items=_SHOWN)

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        """Return the button's tooltip, which is its mode's."""
        return MODES[properties.mode][1]

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Show the pair in this mode; report an error where the image holds no pair."""
        space = context.space_data
        pair = pair_in(context)
        assert pair is not None
        wiggling.end(space)
        try:
            show(context, pair, self.mode)
        except (StereoReprojectError, OSError) as error:
            self.report({"ERROR"}, sentence(reported(error)))
            return {"CANCELLED"}
        return {"FINISHED"}


class STEREO_REPROJECT_OT_wiggle(_OfPair, bpy.types.Operator):
    """Show the eyes one after the other, so that depth is seen without glasses"""

    bl_idname = "stereo_reproject.wiggle"
    bl_label = "Wiggle"

    @classmethod
    def description(cls, _context: bpy.types.Context, _properties: bpy.types.OperatorProperties) -> str:
        """Return the button's tooltip."""
        return MODES[WIGGLE][1]

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Begin to alternate; where this editor alternates already, end that and show the pair."""
        space = context.space_data
        pair = pair_in(context)
        assert pair is not None
        if wiggling.is_wiggling(space):
            _end_wiggle(context.window, context.area)
            return {"FINISHED"}
        before = mode_of(context)
        try:
            show(context, pair, WIGGLE)
        except (StereoReprojectError, OSError) as error:
            self.report({"ERROR"}, sentence(reported(error)))
            return {"CANCELLED"}
        self._number = wiggling.begin(context, pair, before)
        for window in other_windows(context):
            with context.temp_override(window=window):  # pyright: ignore[reportGeneralTypeIssues] - not in the stubs
                bpy.ops.stereo_reproject.hear_escape("INVOKE_DEFAULT", number=self._number)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, _context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Handle an event of the window: Esc ends it, in its time the other eye is shown, and all else goes on."""
        if _ends_wiggle(event, self._number):
            return {"FINISHED"}
        if wiggling.step(self._number):
            return {"PASS_THROUGH"}
        remove_unused(keep=wiggling.kinds_in_use())
        return {"FINISHED", "PASS_THROUGH"}

    def cancel(self, _context: bpy.types.Context) -> None:
        """End it. Blender calls this when the window is closed, or another file is opened."""
        wiggling.forget(self._number)


class STEREO_REPROJECT_OT_hear_escape(bpy.types.Operator):
    """Have Esc end a wiggle in another window too: the picture may have a window of its own"""

    bl_idname = "stereo_reproject.hear_escape"
    bl_label = "Listen for Esc of a Wiggle"
    bl_options = {"INTERNAL"}

    number: bpy.props.IntProperty(name="Number", description="Number by which the wiggle is known")

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """Begin to receive the events of this window."""
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, _context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """End the wiggle on Esc, and pass other events on; end when it is over."""
        if _ends_wiggle(event, self.number):
            return {"FINISHED"}
        window, _ = wiggling.editor_of(self.number)
        return {"FINISHED", "PASS_THROUGH"} if window is None else {"PASS_THROUGH"}


def _ends_wiggle(event: bpy.types.Event, number: int) -> bool:
    """End the wiggle of this number if an event is Esc, and return whether it did."""
    window, area = wiggling.editor_of(number)
    if event.type != "ESC" or event.value != "PRESS" or window is None or area is None:
        return False
    _end_wiggle(window, area)
    return True


def _end_wiggle(window: bpy.types.Window, area: bpy.types.Area) -> None:
    """End the wiggle of an Image Editor, and show the pair there as it was shown before, a single eye at the zoom and
    place of the wiggle; while a job runs, both beside each other as the Render Result, see `_show_again`.
    """
    space = area.spaces.active
    pair, before = pair_shown_in(space), wiggling.mode_before(space)
    wiggling.end(space)
    eye = image_of(pair, before) if pair is not None and before in wiggling.KINDS else None
    _last_modes.pop(space.as_pointer(), None)
    if pair is not None and before is not None and eye is not None:
        # It has alternated with the other, and is seen where both were.
        at = drawn_at(area)
        space.image = eye
        if at is not None:
            put_at(window, area, at)
        _last_modes[space.as_pointer()] = (before, pair.name)
    else:
        space.image = pair
        if pair is not None and before is not None and running() is None:
            _show_there(window, area, pair, before)
    area.tag_redraw()
    remove_unused(keep=wiggling.kinds_in_use())


def _show_there(window: bpy.types.Window, area: bpy.types.Area, pair: bpy.types.Image, mode: str) -> None:
    """Show the pair in this image in an Image Editor, in one of `MODES`; where that fails, the console says why."""
    with bpy.context.temp_override(window=window, area=area):  # pyright: ignore[reportGeneralTypeIssues] - not in the stubs
        try:
            show(bpy.context, pair, mode)
        except (StereoReprojectError, OSError) as error:
            print(f"Stereo Reproject cannot show the pair again: {error}")


def show(context: bpy.types.Context, pair: bpy.types.Image, mode: str) -> None:
    """Show the pair in this image in the Image Editor of the context, in one of `MODES`; Wiggle's first eye stays until
    its operator shows the other. Raises BadInputError where the image holds no pair, OSError, and StereoReprojectError.
    """
    if mode != ANAGLYPH:
        _show_made(context, pair, mode)
        return
    space = context.space_data
    is_shown = space.image == pair
    _in_anaglyph(context.window)
    space.image, space.show_stereo_3d = pair, True
    redraw_with_both_eyes(fit=not is_shown)
    if not is_shown and pair.type != "RENDER_RESULT" and not bpy.app.background:
        fit_editor(context.window, context.area)
    remove_unused(keep=wiggling.kinds_in_use())
    _last_modes[space.as_pointer()] = (mode, pair.name)


def _show_made(context: bpy.types.Context, pair: bpy.types.Image, mode: str) -> None:
    """Show images of ours, made anew from the pair, in the Image Editor of the context; of a wiggle the left eye."""
    space = context.space_data
    kinds = wiggling.KINDS if mode == WIGGLE else (mode,)
    is_shown = space.image is not None and space.image == image_of(pair, kinds[0])
    made = made_images(context.scene, pair, kinds)
    space.image = made[kinds[0]]
    # Blender 5 draws an image for the first time at 100 %, whatever the zoom was.
    if not is_shown and not bpy.app.background:
        fit_editor(context.window, context.area)
    remove_unused(keep=(*kinds, *wiggling.kinds_in_use()))
    _last_modes[space.as_pointer()] = (mode, pair.name)


def _in_anaglyph(window: bpy.types.Window) -> None:
    """Have a window draw stereo as an anaglyph. Raises BadInputError where Blender refuses."""
    display = window.stereo_3d_display
    if display.display_mode == ANAGLYPH:
        return
    try:
        # It also leaves the full screen that other modes need.
        bpy.ops.wm.set_stereo_3d(display_mode=ANAGLYPH, anaglyph_type=display.anaglyph_type)
    except RuntimeError as error:
        raise BadInputError(" ".join(str(error).removeprefix("Error: ").split())) from error


@bpy.app.handlers.persistent
def _note_turned(*_arguments: Any) -> None:
    """Forget how pairs were shown in Image Editors that show something else by now. Blender calls this before an undo
    or redo.
    """
    if running() is not None:
        # Its pictures are shown in the pair's place.
        return
    for _, area in image_editors():
        space = area.spaces.active
        _, name = _last_modes.get(space.as_pointer(), ("", ""))
        if space.image is None or not (space.image.name == name or is_ours(space.image)):
            _last_modes.pop(space.as_pointer(), None)


@bpy.app.handlers.persistent
def _show_again(*_: Any) -> None:
    """Show pairs as before in Image Editors from which an undo has taken our images away; not while a job runs, whose
    thread bears no operator beside it, see `zoom_to_fit` in `pictures`. Blender calls this after an undo or redo.
    """
    if running() is not None:
        return
    for window, area in image_editors():
        space = area.spaces.active
        mode, name = _last_modes.get(space.as_pointer(), ("", ""))
        if not mode or space.image is not None:
            continue
        pair = bpy.data.images.get(name) or render_result() or _render_result_again(window, area)
        if pair is not None:
            _show_there(window, area, pair, mode)


def _render_result_again(window: bpy.types.Window, area: bpy.types.Area) -> bpy.types.Image | None:
    """Have Blender make its Render Result again, which an undo to before the first render takes away although the
    render itself stays. It is shown in this Image Editor, which is empty.
    """
    with (
        bpy.context.temp_override(window=window, area=area),  # pyright: ignore[reportGeneralTypeIssues] - not in the stubs
        changed(bpy.context.preferences.view, render_display_type="AREA"),
    ):
        bpy.ops.render.view_show("INVOKE_DEFAULT")
    return render_result()


@bpy.app.handlers.persistent
def _forget_modes(*_: Any) -> None:
    """Forget how the editors of an earlier file showed pairs. Blender calls this after a file was loaded."""
    _last_modes.clear()


def watch() -> None:
    """Begin to look after editors that show pairs. Called when the extension is switched on."""
    for handlers, function in _watched():
        handlers.append(function)


def unwatch() -> None:
    """End all that alternates, and remove our images. Called when the extension is switched off."""
    wiggling.forget_all()
    _last_modes.clear()
    remove_all()
    for handlers, function in _watched():
        if function in handlers:
            handlers.remove(function)


def _watched() -> tuple[tuple[list[Callable[..., None]], Callable[..., None]], ...]:
    """Return Blender's lists of handlers into which functions of ours go, each with its function."""
    handlers = bpy.app.handlers
    return (
        (handlers.undo_pre, _note_turned),
        (handlers.redo_pre, _note_turned),
        (handlers.undo_post, _show_again),
        (handlers.redo_post, _show_again),
        (handlers.load_post, _forget_modes),
    )
