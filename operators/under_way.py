"""The eyes in the Image Editor while they are made: an image of its own, in the editor that will show the result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import bpy

from ..stereo_reproject.images.exr import VIEWS
from ..stereo_reproject.jobs.supervisor import Event
from .pictures import (
    NAME,
    PAIR,
    bring_forward,
    find_editor,
    image_editors,
    is_ours,
    kind_of,
    render_result,
    zoom_to_fit,
)
from .progress_line import remove_line, show_line
from .run import Pictures
from .view_images import turned_to

UNDER_WAY = NAME.format("Render ({})")
"""Name of the image that shows an eye, or one of many views, as it is so far."""


@dataclass
class _Editor:
    """The Image Editor that was chosen for a job, and how it is given back.

    area is the address of its area, before the name of the image that it showed; pair is the name of the image that
    holds the pair, where `before` shows it without glasses, and else "". opened: True where it was opened for the job;
    window is then the address of the window that was opened with it, None if there was none. fit: True where pictures
    are fitted to it. image is the name of the image that shows an eye, "" as long as there is none; shown is the event
    of its picture.
    """

    area: int
    before: str
    pair: str
    opened: bool
    window: int | None
    fit: bool
    image: str = ""
    shown: Event = field(default_factory=dict)


_editors: list[_Editor] = []
"""The editor of the job that is under way, if any. It holds names and addresses, as Blender may free what they name."""


def open_editor(*, fit: bool) -> None:
    """Choose the Image Editor that shows the eyes of the job that begins: the one that shows a result, or else the one
    in which the job is started. Where there is none, one opens as the user's preferences say, as with F12. With fit,
    pictures are fitted to it.

    It must be called before the job has its thread: 4.5 ends where an operator runs while another thread does.
    """
    _editors.clear()
    area = find_editor() or _editor_of_context()
    opened = area is None
    windows = {window.as_pointer() for window in bpy.context.window_manager.windows}
    if opened:
        with bpy.context.temp_override(window=bpy.context.window):  # pyright: ignore[reportGeneralTypeIssues] - not in the stubs
            bpy.ops.render.view_show("INVOKE_DEFAULT")
        area = find_editor()
    elif area is not None:
        bring_forward(_window_of(area))
    if area is not None:
        window = _window_of(area).as_pointer()
        new = None if window in windows else window
        before = area.spaces.active.image
        name = "" if before is None else before.name
        _editors.append(_Editor(area.as_pointer(), name, _pair_of(before), opened, new, fit or opened))


def _editor_of_context() -> bpy.types.Area | None:
    """Return the Image Editor in which an operator was called; None where it was called elsewhere."""
    area = bpy.context.area
    return area if area is not None and area.type == "IMAGE_EDITOR" else None


def say(ways: Sequence[Sequence[str]]) -> None:
    """Draw a text about the job over the editor that was chosen for it, if there is one, in the first of these ways,
    each in lines of its own, for which there is room.
    """
    area = _area_of(_editors[0]) if _editors else None
    if area is not None:
        show_line(area, ways)


def wanted_pictures(*, first_look: bool) -> Pictures:
    """Return which pictures are wanted of the job that begins: none where no editor was chosen to show them. With
    first_look, they begin with one of a single sample.
    """
    if not _editors:
        return Pictures.NONE
    return Pictures.FROM_THE_FIRST_SAMPLE if first_look else Pictures.AS_THEY_ARE_MADE


def update(picture: Event | None) -> None:
    """Show the picture of this event, an eye as it is so far. Do nothing if it is None or is shown already; where the
    user has turned the editor to something else, that stays.
    """
    if picture is None or not _editors:
        return
    editor = _editors[0]
    image = bpy.data.images.get(editor.image) if editor.image else None
    if image is not None and picture is editor.shown:
        return
    editor.shown, new = picture, image is None
    try:
        if image is None:
            # It is the first one, or an undo has gone back to a time without it.
            image = _new_image(editor, picture["file"])
            _put_into(editor, image)
        else:
            image.filepath = picture["file"]
            image.reload()
            _read(image)
    except RuntimeError:
        # It was replaced as it was read, or the job has just ended: the next one comes, or the result.
        if new:
            _replace(editor, None)
            editor.image = ""
        return
    view = picture["view"]
    name = UNDER_WAY.format(f"{view} eye" if view in VIEWS else view)
    if not image.name.startswith(name):
        image.name = name
    editor.image = image.name
    for _, area in image_editors():
        if area.spaces.active.image == image:
            area.tag_redraw()


def _new_image(editor: _Editor, path: str) -> bpy.types.Image:
    """Load a picture of an eye as the job's image, which is not saved with the file and is shown as the scene shows
    renders. Raises RuntimeError where it cannot be read.
    """
    image = bpy.data.images.load(path)
    editor.image = image.name
    image.is_runtime_data = True
    image.use_view_as_render = True
    working = getattr(bpy.data, "colorspace", None)
    if working is not None:
        image.colorspace_settings.name = working.working_space
    _read(image)
    return image


def _read(image: bpy.types.Image) -> None:
    """Have an image's file read now, since it may be gone by the time that Blender draws it. Raises RuntimeError where
    it cannot be read.
    """
    if not any(image.size):  # pyright: ignore[reportArgumentType, reportGeneralTypeIssues] - the stubs' arrays are none
        raise RuntimeError(f"{image.filepath} cannot be read")


def _put_into(editor: _Editor, image: bpy.types.Image) -> None:
    """Have the editor show an image, unless the user has turned it to something else since it was chosen."""
    area = _area_of(editor)
    if area is None:
        return
    space = area.spaces.active
    if space.image is not None and space.image.name != editor.before and not is_ours(space.image):
        return
    if space.image is not None:
        editor.before, editor.pair = space.image.name, _pair_of(space.image)
    space.image = image
    if editor.fit:
        zoom_to_fit(area)


def _pair_of(image: bpy.types.Image | None) -> str:
    """Return the name of the image that holds the pair, for an image that shows it without glasses; "" for others."""
    return image[PAIR] if image is not None and kind_of(image) is not None else ""


def is_fitted() -> bool:
    """Return whether the pictures of the job that is under way are fitted to the editor that was chosen for it."""
    return bool(_editors) and _editors[0].fit


def hand_over() -> bool:
    """Have the Render Result, or an image of ours where a pair was seen without glasses, take the place of the job's
    image wherever that is shown, and end with it. Return False where no picture of the job was ever shown, so that an
    editor is still to be chosen.
    """
    remove_line()
    if not _editors or not _editors[0].image:
        _editors.clear()
        return False
    editor = _editors.pop()
    before, result = bpy.data.images.get(editor.before), render_result()
    without_glasses = result is not None and kind_of(before) is not None
    _replace(editor, turned_to(before, result) if without_glasses else result)
    return True


def hand_over_to(image: bpy.types.Image) -> bool:
    """Have an image take the place of the job's image wherever that is shown, or of what the chosen editor shows where
    no picture of the job ever was, and end with it; an editor that the user has turned to something else stays so.
    Return False where no editor was chosen, or it is gone.
    """
    remove_line()
    editor = _editors.pop() if _editors else None
    area = None if editor is None else _area_of(editor)
    if editor is None or area is None:
        return False
    _replace(editor, image)
    space = area.spaces.active
    if space.image is None or space.image.name == editor.before:
        space.image = image
    return True


def give_back(*, close: bool = True) -> None:
    """Have editors that show the job's image show what they did before, or the pair where that is gone, and soon close
    the one that was opened for it. Do nothing after `hand_over`, or where no editor was chosen. Without close nothing
    is closed: while Blender opens another file, say.
    """
    remove_line()
    if not _editors:
        return
    editor = _editors.pop()
    area = _area_of(editor)
    shown = None if area is None else area.spaces.active.image
    untouched = shown is not None and shown.name in (editor.image, editor.before)
    images = bpy.data.images
    # A wiggle ends where the job's image takes its place, and its images with it.
    _replace(editor, images.get(editor.before) or images.get(editor.pair) or render_result())
    if close and editor.opened and untouched:
        # An operator that closes a window before it returns has its report lost.
        bpy.app.timers.register(partial(_close, editor))


def _close(editor: _Editor) -> None:
    """Close the editor that was opened for a job that is over, unless the next job has chosen it meanwhile."""
    area = _area_of(editor)
    if area is None or _editors:
        return
    with bpy.context.temp_override(window=_window_of(area), area=area):  # pyright: ignore[reportGeneralTypeIssues] - as above
        if editor.window is None:
            bpy.ops.render.view_cancel()
        else:
            bpy.ops.wm.window_close()


def _replace(editor: _Editor, instead: bpy.types.Image | None) -> None:
    """Remove the image of a job, and have editors that show it show another one."""
    image = bpy.data.images.get(editor.image) if editor.image else None
    if image is None:
        return
    for _, area in image_editors():
        if area.spaces.active.image == image:
            area.spaces.active.image = instead
    bpy.data.images.remove(image)


def _area_of(editor: _Editor) -> bpy.types.Area | None:
    """Return the area that was chosen; None where it is gone or is no Image Editor any more."""
    return next((area for _, area in image_editors() if area.as_pointer() == editor.area), None)


def _window_of(area: bpy.types.Area) -> bpy.types.Window:
    """Return the window in which an Image Editor is."""
    return next(window for window, other in image_editors() if other == area)
