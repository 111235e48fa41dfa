"""The devices that Cycles computes on: their names, and how they are handed from one Blender to another that has not
read its preferences."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from typing import Any

import bpy


def devices_in_use() -> dict[str, Any] | None:
    """Return the devices that Cycles computes on, by the preferences: type, ids, and what is switched on for them.
    `use_devices` takes it in another process. None in a Blender without Cycles.
    """
    preferences = _preferences()
    if preferences is None:
        return None
    ids = [device.id for device in preferences.devices if device.use]
    options = {name: getattr(preferences, name) for name in _switches(preferences)}
    return {"type": preferences.compute_device_type, "ids": ids, "options": options}


def use_devices(devices: Mapping[str, Any]) -> None:
    """Set this process's preferences to what `devices_in_use` has returned in another; devices that are not here are
    passed over.
    """
    preferences = _preferences()
    if preferences is None:
        return
    known = {identifier for identifier, *_ in preferences.get_device_types(bpy.context)}
    if devices["type"] not in known:
        return
    preferences.compute_device_type = devices["type"]
    preferences.refresh_devices()
    for device in preferences.devices:
        device.use = device.id in devices["ids"]
    for name in _switches(preferences):
        setattr(preferences, name, devices["options"].get(name, getattr(preferences, name)))


def _switches(preferences: Any) -> list[str]:
    """Return the names of Cycles' preferences that are switches, such as hardware ray tracing."""
    return [prop.identifier for prop in preferences.bl_rna.properties if prop.type == "BOOLEAN"]


def _preferences() -> Any:
    """Return Cycles' preferences; None in a Blender without Cycles."""
    addon = bpy.context.preferences.addons.get("cycles")
    return None if addon is None else addon.preferences


def device_name(scene: bpy.types.Scene) -> str:
    """Return the name of the device, or devices, on which Cycles renders the scene: for instance "CPU: AMD EPYC" or
    "OPTIX: NVIDIA H200".
    """
    preferences = _preferences()
    if preferences is not None and scene.cycles.device == "GPU":
        kind = preferences.compute_device_type
        used = [device for device in preferences.devices if device.use and device.type in (kind, "CPU")]
        if any(device.type != "CPU" for device in used):
            return f"{kind}: {' + '.join(sorted(device.name for device in used))}"
    return f"CPU: {_cpu_name()}"


def _cpu_name() -> str:
    """Return the processor's name as Cycles tells it; the kind of machine where it does not."""
    try:
        import _cycles  # pyright: ignore[reportMissingImports]
    except ImportError:
        return platform.machine()
    found = [name for name, kind, *_ in _cycles.available_devices("CPU") if kind == "CPU"]
    return found[0] if found else platform.machine()
