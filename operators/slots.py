"""Render slots: what is rendered with F12 while a pair is made stays where it is, and a pair is known by its slot."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy

from ..stereo_reproject.errors import StereoReprojectError
from .pictures import render_result
from .results import SlotContent

NAME = "Stereo Pair"
"""Name of the slot that a pair goes to when the user's own is taken, and of those after it with a number."""

MULTIVIEW = "Multiview"
"""Name of the slot that multiview's own pair goes to after a comparison, and of further ones with a number."""

_multiview: list[SlotContent] = []
"""Multiview's pair that was handed over last, if any."""

_renders: Counter[int] = Counter()
"""Number of renders into each render slot since the extension was switched on, by the slot's place."""

_before: Counter[int] = Counter()
"""Those numbers when the running job was started."""


def watch() -> None:
    """Begin to count the renders into each slot. Called when the extension is switched on."""
    bpy.app.handlers.render_init.append(_count)


def unwatch() -> None:
    """Stop counting renders. Called when the extension is switched off."""
    if _count in bpy.app.handlers.render_init:
        bpy.app.handlers.render_init.remove(_count)


def note_start() -> None:
    """Note that a job starts: slots that are rendered into from now on are the user's, see `unused_slot`."""
    _before.clear()
    _before.update(_renders)


def note_own_render() -> None:
    """Note that the last render into the active slot is ours, which a pair may replace: it is none of the user's."""
    content = content_now()
    if content is not None:
        _before[content.place] = content.renders


@bpy.app.handlers.persistent
def _count(*_: Any) -> None:
    """Count a render into the active slot. Blender calls this in another thread when a render begins."""
    # Another thread calls this: it must not do more than look.
    image = render_result()
    _renders[0 if image is None else image.render_slots.active_index] += 1


def content_now() -> SlotContent | None:
    """Return what the active render slot holds now; None where the file has no Render Result."""
    image = render_result()
    place = None if image is None else image.render_slots.active_index
    if image is None or place is None:
        return None
    slots = image.render_slots
    # Without a name, Blender shows the slot's number.
    return SlotContent(place, slots[place].name or f"Slot {place + 1}", _renders[place])


def holds(content: SlotContent) -> bool:
    """Return whether a render slot still holds this."""
    image = render_result()
    there = image is not None and content.place < len(image.render_slots)
    return there and _renders[content.place] == content.renders


def show_slot(content: SlotContent) -> None:
    """Have the slot active that holds this."""
    image = render_result()
    assert image is not None
    image.render_slots.active_index = content.place


@contextmanager
def multiview_slot() -> Iterator[None]:
    """Have a render slot active that is multiview's, for the time of a `with` block, and then the earlier one again:
    the slot of multiview's earlier pair if that is still in it, or else a new one.
    """
    image = render_result()
    if image is None:
        raise StereoReprojectError("Blender has no Render Result yet")
    slots, before, earlier = image.render_slots, image.render_slots.active_index, multiview_now()
    place = _new_slot(slots, MULTIVIEW) if earlier is None else earlier.place
    _multiview.clear()
    try:
        slots.active_index = place
        yield
        _multiview.extend(filter(None, [content_now()]))
    finally:
        slots.active_index = before


def multiview_now() -> SlotContent | None:
    """Return multiview's pair that was handed over last, if it is still in its slot; None otherwise."""
    return next((content for content in _multiview if holds(content)), None)


def leave_multiview(pair: SlotContent | None) -> None:
    """If the active slot holds multiview's pair, have the slot of `pair` active instead, or a new one where `pair` is
    None or its slot holds another render by now: what is handed over next is no multiview's, and takes nobody's place.
    """
    image, multiview = render_result(), multiview_now()
    if image is None or multiview is None or image.render_slots.active_index != multiview.place:
        return
    slots = image.render_slots
    stays = pair is not None and pair.place != multiview.place and holds(pair)
    slots.active_index = pair.place if stays else _new_slot(slots, NAME)


def _new_slot(slots: bpy.types.RenderSlots, name: str) -> int:
    """Add a render slot of this name, with a number where there are such slots already, and return its place."""
    taken = sum(slot.name.startswith(name) for slot in slots)
    slots.new(name=f"{name} {taken + 1}" if taken else name)
    return len(slots) - 1


@contextmanager
def unused_slot() -> Iterator[str | None]:
    """Have a render slot active that nothing was rendered into since `note_start`; it yields that slot's name, or None
    where the active one is such a slot.

    The slot stays active after the `with` block. Only after an error in the block, the earlier one is active again.
    """
    image = render_result()
    rendered = {place for place, count in _renders.items() if count != _before[place]}
    if image is None or image.render_slots.active_index not in rendered:
        yield None
        return
    slots, before = image.render_slots, image.render_slots.active_index
    own = (k for k, slot in enumerate(slots) if slot.name.startswith(NAME))
    free = next((k for k in own if k not in rendered), None)
    if free is None:
        free = _new_slot(slots, NAME)
    slots.active_index = free
    try:
        yield slots[free].name
    except BaseException:
        slots.active_index = before
        raise
