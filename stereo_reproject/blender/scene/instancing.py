"""Objects that a scene shows though they are in none of its own collections: what instancing and particles bring."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator

import bpy


def brought_along(items: Iterable[bpy.types.Object], *, parents: bool = False) -> Iterator[bpy.types.Object]:
    """Yield these objects and those that their instancing and particles show, however nested, each once.

    With parents, objects that any of them hangs on are yielded too, since those move it. Objects that only geometry
    nodes instance are left out.
    """
    waiting = deque(items)
    met: set[int] = set()
    while waiting:
        item = waiting.popleft()
        if item.session_uid in met:
            continue
        met.add(item.session_uid)
        yield item
        if parents and item.parent is not None:
            waiting.append(item.parent)
        waiting.extend(_shown_by(item))


def _shown_by(item: bpy.types.Object) -> Iterator[bpy.types.Object]:
    """Yield the objects that an object's instancing and particles show directly."""
    collections = [item.instance_collection] if item.instance_type == "COLLECTION" else []
    for system in item.particle_systems:
        if system.settings is not None:
            collections.append(system.settings.instance_collection)
            if system.settings.instance_object is not None:
                yield system.settings.instance_object
    for collection in filter(None, collections):
        yield from collection.all_objects
