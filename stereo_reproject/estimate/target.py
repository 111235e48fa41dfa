"""The target view while it is completed: plain data, replaced by a new one at each step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from ..images.passes import COLOUR_PASS, Passes
from ..warp.composite import composite


class Provenance(IntFlag):
    """Origin of a target pixel, and the reason for it; without any flag, it comes from the warp alone."""

    HOLE = 1
    """Traced because the warp has no answer: set from the start, when it is still to be traced."""
    PROBE = 2
    """Traced twice, to measure how good the warp is there; the pixel is the mean of both."""
    REFINED = 4
    """Pixel of a tile that probes asked to be traced, the tile's own probe included."""
    REFERENCE = 8
    """Traced only to be compared with the warped colour, which the pixel keeps."""
    NOTHING = 16
    """Shows nothing: it lies beyond the edge of a lens, where no ray is shot. It is not traced for that, nor does it
    count as warped."""
    FRESH = 32
    """Traced though the warp has an answer, so that its noise is its view's own. It counts as a hole too."""


@dataclass(frozen=True)
class Target:
    """A view that is partly warped and partly traced.

    view is its name; passes (H, W, C) are by pass name, in scene-linear colour; provenance (H, W) holds `Provenance`
    flags. The passes belong to the target alone: pixels are traced into them in place, since a copy for each step
    would double the memory that a large picture takes.
    """

    view: str
    passes: Passes
    provenance: NDArray[np.uint8]

    @classmethod
    def of_warp(
        cls, view: str, passes: Passes, reasons: NDArray[np.uint16], shown: NDArray[np.bool_] | None = None
    ) -> Target:
        """Return a target of warped passes (H, W, C), which it takes over; each pixel that has any `Reason` flag (H, W)
        is a hole. Others that are not set in `shown` (H, W) show nothing; None where all show something."""
        others = np.uint8(0) if shown is None else np.where(shown, np.uint8(0), np.uint8(Provenance.NOTHING))
        return cls(view, passes, np.where(reasons > 0, np.uint8(Provenance.HOLE), others))

    @property
    def colour(self) -> NDArray[np.float32]:
        """Scene-linear colour (H, W, 4), the colour pass."""
        return self.passes[COLOUR_PASS]

    @property
    def warped(self) -> NDArray[np.bool_]:
        """Pixels (H, W) that come from the warp alone and show something: they were not traced and are no holes."""
        return self.provenance == 0

    @property
    def traced(self) -> NDArray[np.bool_]:
        """Pixels (H, W) that were traced, or are holes and still to be traced."""
        return (self.provenance & ~np.uint8(Provenance.NOTHING)) > 0

    @property
    def keeps_warped_colour(self) -> NDArray[np.bool_]:
        """Pixels (H, W) whose colour, in a denoised picture, is the warped one in the end.

        Probes in tiles that stay warped are among them: alone, a traced pixel would stand out.
        """
        return ~self.any_of(Provenance.HOLE | Provenance.REFINED)

    def variance_share(self, warped: NDArray[np.float32], *, averages_probes: bool) -> NDArray[np.float32]:
        """Return (H, W) the variance of each pixel, as a share of that of a plain render's pixel.

        A pixel that comes from the warp has the share that is given for it, `warped` (H, W), and a traced one has 1. A
        probe has 0.5 where its pixel is the mean of its two traces in the end (averages_probes), and else 1.
        """
        share = np.where(self.traced, np.float32(1.0), warped)
        if averages_probes:
            share[self.any_of(Provenance.PROBE)] = 0.5
        return share

    def any_of(self, flags: Provenance) -> NDArray[np.bool_]:
        """Return (H, W) the pixels that have any of these flags."""
        return (self.provenance & np.uint8(flags)) > 0

    def flagged(self, pixels: NDArray[np.bool_], flags: Provenance) -> Target:
        """Return a target whose pixels (H, W) have these flags too."""
        return replace(self, provenance=np.where(pixels, self.provenance | np.uint8(flags), self.provenance))

    def put(self, pixels: NDArray[np.bool_], passes: Mapping[str, NDArray]) -> None:
        """Put the passes (N, C), given row by row, into the set pixels (H, W), in place; flags stay as they are."""
        composite(self.passes, dict(passes), pixels)
