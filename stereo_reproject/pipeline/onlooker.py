"""Pictures of a frame while it is made, for somebody who watches: first the source, then the target as it fills."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..images.seen_light import scaled_colour

CHECKER_SIDE_PX = 8
"""Side of a square of the checkerboard that stands for pixels without a colour: as coarse as Blender's own."""

CHECKER_GREYS = (0.01, 0.03)
"""Greys of its squares, scene-linear, in a picture whose middle stands at 0.18: they are dark beside most surfaces, and
differ enough to be seen as a pattern."""


@dataclass(frozen=True)
class Onlooker:
    """Somebody who watches a frame being made.

    on_stage is called with the name of each stage as it begins, and with a detail of it where there is one. show gets
    a view's name and its colour (H, W, 4) so far, scene-linear, of which it must keep no reference; None where no
    pictures are wanted. first_look: True where the source is wanted with a single sample too, before it is rendered
    whole.
    """

    on_stage: Callable[..., None] = lambda *_: None
    show: Callable[[str, NDArray[np.float32]], None] | None = None
    first_look: bool = False


NOBODY = Onlooker()
"""An onlooker that looks away."""


def shown_target(
    colour: NDArray[np.float32], light_scale: float, holes: NDArray[np.bool_] | None = None
) -> NDArray[np.float32]:
    """Return the picture (H, W, 4) that shows a target as it is so far, with light as bright as the scene has it.

    colour (H, W, 4) has its light multiplied by light_scale; `holes` (H, W) are the pixels that still lack a colour,
    None where none does.
    """
    return scaled_colour(colour if holes is None else with_checkerboard(colour, holes), 1.0 / light_scale)


def with_checkerboard(colour: NDArray[np.float32], holes: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return a copy of a picture (H, W, 4) with a dark, opaque checkerboard in its `holes` (H, W)."""
    rows, columns = np.nonzero(holes)
    squares = (rows // CHECKER_SIDE_PX + columns // CHECKER_SIDE_PX) % 2
    shown = colour.copy()
    shown[rows, columns, :3] = np.array(CHECKER_GREYS, np.float32)[squares][:, None]
    shown[rows, columns, 3] = 1.0
    return shown
