"""Stand-ins for parts of a scene that was changed while its pair was rendered: a camera, and its view layers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import bpy

from .rendered import camera_at


def new_names(rendered: Sequence[str], then: Sequence[str], now: Sequence[str]) -> dict[str, str]:
    """Return the present names of the rendered view layers, by their names at the start.

    then and now are the names of all view layers of the scene, at the start and at present. A layer that is gone and
    has a new one in its place was renamed; any other that is gone was deleted, and keeps its name.
    """
    names = {name: name for name in rendered}
    for name in rendered:
        place = then.index(name) if name in then else len(now)
        if name not in now and place < len(now) and now[place] not in then:
            names[name] = now[place]
    return names


def renamed_metadata(metadata: Mapping[str, str], names: Mapping[str, str]) -> dict[str, str]:
    """Return the texts that say what cryptomattes hold, with view layers called by their new names. names are the new
    names by the old ones.
    """
    result = dict(metadata)
    for key, text in metadata.items():
        layer, _, matte = text.rpartition(".")
        if key.endswith("/name") and layer in names:
            result[key] = f"{names[layer]}.{matte}"
    return result


@contextmanager
def stand_ins(scene: bpy.types.Scene, layers: Sequence[str]) -> Iterator[None]:
    """Have a camera in the scene if it has none, and view layers of these names where they are missing, for the time of
    a `with` block; what was added is removed afterwards, also after an error.
    """
    missing = [name for name in layers if name not in scene.view_layers]
    camera = _add_camera(scene) if camera_at(scene, scene.frame_current) is None else None
    try:
        for name in missing:
            scene.view_layers.new(name)
        yield
    finally:
        for name in missing:
            if name in scene.view_layers:
                scene.view_layers.remove(scene.view_layers[name])
        if camera is not None:
            _remove_camera(scene, camera)


def _add_camera(scene: bpy.types.Scene) -> tuple[str, str]:
    """Give the scene a camera that shows nothing, since Blender renders nothing without one. Return the names of its
    object and of its data.
    """
    data = bpy.data.cameras.new("Stereo Reproject Delivery")
    item = bpy.data.objects.new(data.name, data)
    scene.camera = item
    return item.name, data.name


def _remove_camera(scene: bpy.types.Scene, names: tuple[str, str]) -> None:
    """Remove the camera that `_add_camera` has added, by its names."""
    # By name: a reference does not survive everything that a render may do.
    scene.camera = None
    for blocks, name in zip((bpy.data.objects, bpy.data.cameras), names, strict=True):
        if name in blocks:
            blocks.remove(blocks[name])
