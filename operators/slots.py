"""Render slots: what is rendered with F12 while a pair is made stays where it is."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy

from .pictures import render_result

NAME = "Stereo Pair"
"""Name of the slot that a pair goes to when the user's own is taken, and of those after it with a number."""

_rendered: set[int] = set()
"""The slots into which anything was rendered since `watch`, by their places."""


def watch() -> None:
    """Begin to note which render slots Blender renders into; earlier notes are forgotten."""
    unwatch()
    _rendered.clear()
    bpy.app.handlers.render_init.append(_note)


def unwatch() -> None:
    """Stop noting renders. The slots noted so far stay known to `unused_slot`."""
    if _note in bpy.app.handlers.render_init:
        bpy.app.handlers.render_init.remove(_note)


def _note(*_: Any) -> None:
    """Note the active render slot. Blender calls this in another thread when a render begins."""
    # Another thread calls this: it must not do more than look.
    image = render_result()
    _rendered.add(0 if image is None else image.render_slots.active_index)


@contextmanager
def unused_slot() -> Iterator[str | None]:
    """Have a render slot active that nothing was rendered into since `watch`; it yields that slot's name, or None where
    the active one is such a slot.

    The slot stays active after the `with` block. Only after an error in the block, the earlier one is active again.
    """
    image = render_result()
    if image is None or image.render_slots.active_index not in _rendered:
        yield None
        return
    slots, before = image.render_slots, image.render_slots.active_index
    own = [k for k, slot in enumerate(slots) if slot.name.startswith(NAME)]
    free = next((k for k in own if k not in _rendered), None)
    if free is None:
        slots.new(name=f"{NAME} {len(own) + 1}" if own else NAME)
        free = len(slots) - 1
    slots.active_index = free
    try:
        yield slots[free].name
    except BaseException:
        slots.active_index = before
        raise
