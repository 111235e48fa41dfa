"""Values of a datablock that follow from curves and drivers: they differ from frame to frame, and the curves hold them
all."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping

import bpy

Place = tuple[int, str]
"""A struct, by its address while this lasts, and the name of a property of it."""

LAST = re.compile(r'(?:^|\.|(?=\["))(\w+|\["(?:[^"\\]|\\.)*"\])$')


def animated_values(block: bpy.types.ID) -> dict[Place, set[int]]:
    """Return the properties of a datablock that curves and drivers write to, each with the indices of the array's items
    that they write; {0} where it is no array.
    """
    found: dict[Place, set[int]] = {}
    animation = getattr(block, "animation_data", None)
    for curve in curves_of(block):
        place = _place(block, curve.data_path)
        if place is not None:
            found.setdefault(place, set()).add(curve.array_index)
    for strip in _strips(animation.nla_tracks) if animation is not None else ():
        for name, on in (("influence", strip.use_animated_influence), ("strip_time", strip.use_animated_time)):
            if on:
                found[strip.as_pointer(), name] = {0}
    return found


def hold(data: bpy.types.Camera, within: str, values: Mapping[str, float]) -> None:
    """Set properties of a camera's data, or with `within` of the struct of this path in it, to these values, and keep
    them so where they are animated."""
    owner = data.path_resolve(within.removesuffix(".")) if within else data
    for name, value in values.items():
        setattr(owner, name, value)
        if (owner.as_pointer(), name) in animated_values(data):
            data.driver_remove(within + name)
            # Drivers come after curves.
            data.driver_add(within + name).driver.expression = repr(float(value))


def _place(block: bpy.types.ID, path: str) -> Place | None:
    """Return the struct and the property that a curve's path means in a datablock; None where there is no such thing,
    and the curve changes nothing.
    """
    last = LAST.search(path)
    try:
        owner = block.path_resolve(path, False).data
    except (ValueError, AttributeError):
        return None
    return None if last is None or owner is None else (owner.as_pointer(), last[1])


def curves_of(block: bpy.types.ID) -> Iterator[bpy.types.FCurve]:
    """Yield the curves and drivers of a datablock that are in use. Muted ones are left out: they leave a value as the
    user has set it.
    """
    animation = getattr(block, "animation_data", None)
    if animation is None:
        return
    curves = [*animation.drivers, *_of_slot(animation.action, animation.action_slot_handle)]
    if animation.use_nla:
        for strip in _strips(animation.nla_tracks):
            curves.extend(_of_slot(strip.action, strip.action_slot_handle))
    for curve in curves:
        group = curve.group
        if not curve.mute and not (group is not None and group.mute):
            yield curve


def _of_slot(action: bpy.types.Action | None, handle: int) -> Iterator[bpy.types.FCurve]:
    """Yield the curves of an action that belong to the slot of this handle; none without an action."""
    for layer in action.layers if action is not None else ():
        for strip in layer.strips:
            for bag in strip.channelbags:
                if bag.slot_handle == handle:
                    yield from bag.fcurves


def _strips(holders: Iterable[bpy.types.NlaTrack | bpy.types.NlaStrip]) -> Iterator[bpy.types.NlaStrip]:
    """Yield the strips of these tracks, and those within other strips; muted tracks and strips are passed over."""
    for holder in holders:
        if not holder.mute:
            yield from holder.strips
            yield from _strips(holder.strips)
