"""A .blend opened in a process of its own, as the session that asks for it has it open."""

from __future__ import annotations

from pathlib import Path

import bpy

from ...errors import BadInputError
from ...jobs.supervisor import Session
from ...words import Words
from ..scene.devices import use_devices
from ..scene.working import open_blend
from .output_paths import write_beside


def open_session(blend: Path, session: Session) -> bpy.types.Scene:
    """Open a .blend as the session has it open: with its devices, view layers and output folders. Return the session's
    scene. Raises BadInputError.
    """
    _check_regular(blend)
    scene = open_blend(blend, session.scene, scripts=session.scripts)
    if session.devices is not None:
        use_devices(session.devices)
    if session.layers is not None:
        for layer in scene.view_layers:
            layer.use = layer.name in session.layers
    if session.original:
        write_beside(scene, Path(session.original))
    return scene


def _check_regular(blend: Path) -> None:
    """Raise BadInputError when the file is gone, or is no regular file any more: Blender might wait for another kind of
    file for ever.
    """
    try:
        regular = blend.is_file()
    except OSError as error:
        raise BadInputError(
            Words("{blend} cannot be read ({reason}); check its permissions", blend=blend, reason=error.strerror)
        ) from error
    if not regular:
        raise BadInputError(
            Words("{blend} was removed or replaced under way, and is no regular file; start anew with one", blend=blend)
        )
