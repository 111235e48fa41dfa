"""Requests to trace pixels: of any number of views, answered together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..images.passes import Passes


@dataclass(frozen=True)
class TraceRequest:
    """Pixels of one view that are to be traced.

    view is its name. pixels (H, W) are set where a pixel is wanted. twice (H, W), if given, is set where a pixel is
    wanted once more, with noise of its own.
    """

    view: str
    pixels: NDArray[np.bool_]
    twice: NDArray[np.bool_] | None = None

    @property
    def masks(self) -> list[NDArray[np.bool_]]:
        """Masks (H, W) whose set pixels the answer holds, one mask after the other: `pixels`, and `twice` if it is
        given."""
        return [self.pixels] if self.twice is None else [self.pixels, self.twice]


class Tracer(Protocol):
    """Tracer of single pixels of views: a renderer that answers trace requests."""

    def trace(self, method: str, requests: Sequence[TraceRequest]) -> list[Passes]:
        """Trace all requests by one fill method ('packed', 'card' or 'full'), and return the passes (N, C) of each, in
        order.

        Those are first the pixels that are set in a request's `pixels`, row by row, and then those set in its `twice`.
        """
        ...
