"""A source of a warp: a view that was rendered, whole or in part."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..images.passes import DEPTH_PASS, Passes
from ..trace.fill import SourceCost
from ..views.camera import Camera, goes_round
from ..views.view import View


@dataclass(frozen=True)
class RenderedView:
    """A source of a warp: a rendered view and its passes, colour (H, W, 4), depth (H, W, 1), and any other.

    invalid (H, W): pixels of which an essential pass had NaN or infinities; None without any. cost: seconds that
    rendering took, where that was measured. traced (H, W): pixels that were really traced in this view, and that show
    what is still there; the others are not looked up, as they were themselves looked up in another view, or show what
    has moved since. None where all may be looked up, as in a view that was rendered whole.
    """

    view: View
    passes: Passes
    invalid: NDArray[np.bool_] | None = None
    cost: SourceCost | None = None
    traced: NDArray[np.bool_] | None = None

    @property
    def camera(self) -> Camera:
        """The view's camera."""
        return self.view.camera

    @property
    def wraps(self) -> bool:
        """True where the picture's right side goes on at its left, so that a lookup does."""
        return goes_round(self.camera)

    @property
    def depth(self) -> NDArray[np.float32]:
        """The depth (H, W) in scene units, +inf for the sky, NaN where it is unknown."""
        return self.passes[DEPTH_PASS][..., 0]

    def of_columns(self, columns: NDArray[np.intp]) -> RenderedView:
        """Return the passes and masks of some columns, whose indices are given; the camera stays that of the whole
        picture."""
        invalid, traced = (None if mask is None else mask[:, columns] for mask in (self.invalid, self.traced))
        passes = {name: image[:, columns] for name, image in self.passes.items()}
        return replace(self, passes=passes, invalid=invalid, traced=traced)
