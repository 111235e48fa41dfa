"""Image Editors that show the eyes of a pair one after the other: which they are, and whose turn it is."""

from __future__ import annotations

import itertools
import time
from dataclasses import dataclass

import bpy

from .pictures import image_editors, kind_of
from .results import SlotContent
from .slots import content_now
from .view_images import image_of, pair_shown_in
from .zoom_and_place import ZoomAndPlace, drawn_at, put_at

WIGGLE_SECONDS = 0.2
"""Time for which each eye is shown: at 0.1 to 0.3 s the eyes are seen as one thing that turns, neither as two pictures
nor as a flicker."""

TIMER_SECONDS = 0.05
"""Time between two looks at the clock: an eye's turn is that much too long at most."""

KINDS = ("LEFT", "RIGHT")
"""Kinds of the images that alternate."""


@dataclass
class _Wiggle:
    """One Image Editor that alternates: its space, the pair's image by name, the Render Result's content at the start,
    in which way it showed the pair before (None for no pair), the timer that wakes it, when the next turn begins, and
    at which zoom and place both images are seen, None before the second one is.
    """

    space: int
    pair: str
    content: SlotContent | None
    before: str | None
    timer: bpy.types.Timer
    next_turn: float
    seen_at: ZoomAndPlace | None = None


_wiggles: dict[int, _Wiggle] = {}
"""Editors that alternate, by the number of their operator."""

_numbers = itertools.count(1)


def begin(context: bpy.types.Context, pair: bpy.types.Image, before: str | None) -> int:
    """Note that the Image Editor of the context begins to alternate, and return a number by which it is known. before
    is the way in which it showed the pair until now, None where it showed none.
    """
    number = next(_numbers)
    timer = context.window_manager.event_timer_add(TIMER_SECONDS, window=context.window)
    next_turn = time.monotonic() + WIGGLE_SECONDS
    space = context.space_data.as_pointer()
    _wiggles[number] = _Wiggle(space, pair.name, content_now(), before, timer, next_turn)
    return number


def is_wiggling(space: bpy.types.SpaceImageEditor) -> bool:
    """Return whether an Image Editor alternates."""
    return any(wiggle.space == space.as_pointer() for wiggle in _wiggles.values())


def mode_before(space: bpy.types.SpaceImageEditor) -> str | None:
    """Return the way in which an Image Editor that alternates showed the pair before; None where it showed none."""
    return next((wiggle.before for wiggle in _wiggles.values() if wiggle.space == space.as_pointer()), None)


def editor_of(number: int) -> tuple[bpy.types.Window | None, bpy.types.Area | None]:
    """Return the window and the area of the Image Editor that alternates by this number; None for both if it has ended,
    or is gone or hidden.
    """
    wiggle = _wiggles.get(number)
    return (None, None) if wiggle is None else _editor_of(wiggle)


def kinds_in_use() -> tuple[str, ...]:
    """Return the kinds of images that alternate somewhere."""
    return KINDS if _wiggles else ()


def end(space: bpy.types.SpaceImageEditor) -> None:
    """Have an Image Editor alternate no longer; its operator ends when it is woken next."""
    for number in [number for number, wiggle in _wiggles.items() if wiggle.space == space.as_pointer()]:
        forget(number)


def forget(number: int) -> None:
    """End a wiggle, and stop its timer; nothing if it has ended."""
    wiggle = _wiggles.pop(number, None)
    if wiggle is not None:
        bpy.context.window_manager.event_timer_remove(wiggle.timer)


def forget_all() -> None:
    """End all wiggles, and stop their timers."""
    for number in list(_wiggles):
        forget(number)


def _finish(number: int, area: bpy.types.Area) -> None:
    """End a wiggle in this Image Editor, and show the pair itself."""
    forget(number)
    area.spaces.active.image = pair_shown_in(area.spaces.active)
    area.tag_redraw()


def step(number: int) -> bool:
    """Show the other eye if it is its turn, at the same zoom and place. Return False if the wiggle has ended: by
    another button, because its editor is gone or shows something else, or because another picture was rendered, in
    place of which the pair is shown.
    """
    wiggle = _wiggles.get(number)
    if wiggle is None:
        return False
    window, area = _editor_of(wiggle)
    kind = None if area is None else kind_of(area.spaces.active.image)
    pair = bpy.data.images.get(wiggle.pair)
    if window is None or area is None or kind not in KINDS or pair is None:
        forget(number)
        return False
    if wiggle.content != content_now():
        _finish(number, area)
        return False
    if time.monotonic() >= wiggle.next_turn:
        wiggle.next_turn = time.monotonic() + WIGGLE_SECONDS
        other = image_of(pair, KINDS[1 - KINDS.index(kind)])
        if other is None:
            _finish(number, area)
            return False
        _show_instead(wiggle, window, area, other)
    return True


def _show_instead(wiggle: _Wiggle, window: bpy.types.Window, area: bpy.types.Area, other: bpy.types.Image) -> None:
    """Show the other eye in a wiggle's editor, at the zoom and place of the one that is shown now: the user may have
    zoomed and panned since the turn before.
    """
    now = drawn_at(area)
    if now is not None and (wiggle.seen_at is None or not now.is_near(wiggle.seen_at, tuple(other.size))):
        wiggle.seen_at = now
    area.spaces.active.image = other
    if wiggle.seen_at is not None:
        put_at(window, area, wiggle.seen_at)
    area.tag_redraw()


def _editor_of(wiggle: _Wiggle) -> tuple[bpy.types.Window | None, bpy.types.Area | None]:
    """Return the window and the area in which a wiggle's Image Editor is shown now; None for both if it is gone or
    hidden.
    """
    found = ((window, area) for window, area in image_editors() if area.spaces.active.as_pointer() == wiggle.space)
    return next(found, (None, None))
