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
    the timer that wakes it, and when the next turn begins.
    """

    space: int
    pair: str
    content: SlotContent | None
    timer: bpy.types.Timer
    next_turn: float


_wiggles: dict[int, _Wiggle] = {}
"""Editors that alternate, by the number of their operator."""

_numbers = itertools.count(1)


def begin(context: bpy.types.Context, pair: bpy.types.Image) -> int:
    """Note that the Image Editor of the context begins to alternate, and return a number by which it is known."""
    number = next(_numbers)
    timer = context.window_manager.event_timer_add(TIMER_SECONDS, window=context.window)
    next_turn = time.monotonic() + WIGGLE_SECONDS
    _wiggles[number] = _Wiggle(context.space_data.as_pointer(), pair.name, content_now(), timer, next_turn)
    return number


def is_wiggling(space: bpy.types.SpaceImageEditor) -> bool:
    """Return whether an Image Editor alternates."""
    return any(wiggle.space == space.as_pointer() for wiggle in _wiggles.values())


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


def finish(number: int) -> bool:
    """End a wiggle and show the pair itself. Return False if it had ended before."""
    wiggle = _wiggles.get(number)
    if wiggle is None:
        return False
    area = _area_of(wiggle)
    forget(number)
    if area is not None and kind_of(area.spaces.active.image) is not None:
        area.spaces.active.image = pair_shown_in(area.spaces.active)
        area.tag_redraw()
    return True


def step(number: int) -> bool:
    """Show the other eye if it is its turn. Return False if the wiggle has ended: by another button, because its editor
    is gone or shows something else, or because another picture was rendered, in place of which the pair is shown.
    """
    wiggle = _wiggles.get(number)
    if wiggle is None:
        return False
    area = _area_of(wiggle)
    kind = None if area is None else kind_of(area.spaces.active.image)
    pair = bpy.data.images.get(wiggle.pair)
    if area is None or kind not in KINDS or pair is None:
        forget(number)
        return False
    if wiggle.content != content_now():
        finish(number)
        return False
    if time.monotonic() >= wiggle.next_turn:
        wiggle.next_turn = time.monotonic() + WIGGLE_SECONDS
        other = image_of(pair, KINDS[1 - KINDS.index(kind)])
        if other is None:
            finish(number)
            return False
        area.spaces.active.image = other
        area.tag_redraw()
    return True


def _area_of(wiggle: _Wiggle) -> bpy.types.Area | None:
    """Return the area in which a wiggle's Image Editor is shown now; None if it is gone or hidden."""
    return next((area for _, area in image_editors() if area.spaces.active.as_pointer() == wiggle.space), None)
