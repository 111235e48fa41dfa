"""Pictures that a worker leaves under way, for the window that asked for them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInputError
from ..files import beside_name, put_in_place
from ..images.exr import write_picture

NAME = "under-way-{}.exr"
"""Name of the file of an eye as it is so far, by its view."""


class PictureFiles:
    """Files of the eyes as they are so far, one for each view, in a run's private folder. Each is whole whenever it is
    there, and `emit` announces it as an event "picture"."""

    def __init__(self, folder: Path, emit: Callable[..., None]) -> None:
        self._folder, self._emit = folder, emit

    def show(self, view: str, colour: NDArray[np.float32]) -> None:
        """Write the colour (H, W, 4) of a view, scene-linear, in place of its earlier picture, and announce it.

        Where it cannot be written, nothing is announced: a full disk ends the run when the result is written.
        """
        path = self._folder / NAME.format(view)
        beside = path.with_name(beside_name(path.name))
        try:
            write_picture(beside, colour)
            # Nobody needs it after a power cut: it is not flushed.
            put_in_place(beside, path)
        except (OSError, BadInputError):
            beside.unlink(missing_ok=True)
            return
        self._emit("picture", view=view, file=str(path))
