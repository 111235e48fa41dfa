"""Options of a warp, the same for NumPy and for a GPU."""

from __future__ import annotations

from dataclasses import dataclass

from ..images.passes import COLOUR_PASS, filtered, is_light

MIXED = "adaptive", "grained"
"""Interpolations of light that mix a linear and a cubic lookup."""


@dataclass(frozen=True)
class WarpOptions:
    """Options of a warp: the fineness of its grid, and the interpolation of the passes in the source.

    grid_threshold: binocular parallax in arc minutes, above which a cell of the grid is subdivided.
    interpolation: "linear", "cubic" or "nearest", as `images.lookup.lookup` knows them; for passes that may be mixed.
    colour_interpolation: the same for the colour alone; None where it is looked up as the other passes are. "adaptive"
    is a mixture of linear and cubic, pixel by pixel (`images.sharpness`), for the colour and for all other light, whose
    parts must add up. "grained" is that, but single pixels where noise rules (`images.grain`).
    """

    grid_threshold: float = 0.25
    interpolation: str = "linear"
    colour_interpolation: str | None = None

    @property
    def cubic(self) -> bool:
        """True where any pass is looked up with the cubic kernel, which reaches one pixel further."""
        return bool({"cubic", *MIXED} & {self.interpolation, self.colour_interpolation})

    def interpolation_of(self, name: str) -> str:
        """Return the interpolation by which the pass of this name is looked up; "nearest" where its values must not be
        mixed."""
        if not filtered(name):
            return "nearest"
        own = name == COLOUR_PASS or (self.colour_interpolation in MIXED and is_light(name))
        return (self.colour_interpolation if own else None) or self.interpolation
