"""Views that lie in files: read one by one, and as the scene's compositor has them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...images.exr import read_channels, read_eye, read_metadata
from ..scene.compositor import gives_a_picture, is_composited
from ..scene.rendered import check_layers
from .delivery import deliver_composited_view


class ViewFiles(Sequence):
    """The colour of views, (H, W, 4) each, read from their files in a folder when it is asked for."""

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        self._paths = [folder / f"{name}.exr" for name in names]

    def __len__(self) -> int:
        return len(self._paths)

    def __getitem__(self, index: int) -> NDArray[np.float32]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the colour of one view; slices are not asked for."""
        channels = read_channels(self._paths[index])
        return np.stack([channels[letter] for letter in "RGBA"], axis=-1).astype(np.float32)


def runs_compositor(scene: bpy.types.Scene) -> bool:
    """Return whether pictures of many views show them as they are after the scene's compositor: not where it gives no
    picture, or shows view layers that many views do not have."""
    return is_composited(scene) and gives_a_picture(scene) and len(check_layers(scene)) == 1


def composited_files(
    scene: bpy.types.Scene, folder: Path, names: Sequence[str], into: Path, *, frame: int | None
) -> Path:
    """Return the folder of the views' files as pictures show them: after the scene's compositor, which writes them into
    the folder `into`, or, where it is not run, the folder that was given. names are those of the files, without their
    extension; frame is as for `write_quilt`."""
    if not runs_compositor(scene):
        return folder
    into.mkdir(exist_ok=True)
    for name in names:
        path = folder / f"{name}.exr"
        deliver_composited_view(scene, read_eye(path), into / path.name, frame=frame, metadata=read_metadata(path))
    return into
