"""Light-field displays that are known by name, each with the quilt that it takes and the cone in which it is seen.

Sources. Grid, size of the quilt, aspect and cone: Looking Glass Factory's LKG-Toolkit (its templates of devices, state
of April 2025). Grids and sizes also: Looking Glass Factory's documentation ("Quilts"), the Alice/LG add-on and the
Looking Glass module of VTK, which agree with it for these displays but for pixels at the edge. One 16" landscape
display was reported to ask for 8 x 6 views in 7680 x 4320 pixels; a display shows any grid that the quilt's name tells.

Left out: the 27" displays, for whose cone no source was found, and the kiosk, whose quilt has another aspect than its
screen.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import BadInputError
from ..words import Words

WIDE = 16.0 / 9.0
TALL = 9.0 / 16.0
"""Aspects, width over height, of screens that lie and that stand."""


@dataclass(frozen=True)
class Display:
    """A light-field display: its name on a command line, the title by which people know it, and the quilt that suits
    it.

    columns and rows are the quilt's grid, quilt_size its width and height in pixels. aspect is the width of the screen
    over its height: that of a view's pixels may be another, and they are then not square. cone_degrees is the angle
    between the outermost views, as seen from the middle of the screen.
    """

    name: str
    title: str
    columns: int
    rows: int
    quilt_size: tuple[int, int]
    aspect: float
    cone_degrees: float

    @property
    def count(self) -> int:
        """The number of views that fill its quilt."""
        return self.columns * self.rows

    def view_size(self, columns: int | None = None, rows: int | None = None) -> tuple[int, int]:
        """Return the width and height of a view in pixels: those of the quilt over its grid, or over another grid,
        rounded down. So a quilt of such views may be smaller than `quilt_size`, by less than a pixel for each view."""
        width, height = self.quilt_size
        return width // (columns or self.columns), height // (rows or self.rows)


DISPLAYS: dict[str, Display] = {
    display.name: display
    for display in (
        Display("portrait", "Looking Glass Portrait", 8, 6, (3360, 3360), 0.75, 40.0),
        Display("go", "Looking Glass Go", 11, 6, (4092, 4092), TALL, 54.0),
        Display("16-landscape", 'Looking Glass 16", landscape', 7, 7, (5999, 5999), WIDE, 50.0),
        Display("16-portrait", 'Looking Glass 16", portrait', 11, 6, (5995, 6000), TALL, 50.0),
        Display("32-landscape", 'Looking Glass 32", landscape', 7, 7, (8190, 8190), WIDE, 50.0),
        Display("32-portrait", 'Looking Glass 32", portrait', 11, 6, (8184, 8184), TALL, 54.0),
        Display("65", 'Looking Glass 65"', 8, 9, (8192, 8192), WIDE, 40.0),
        Display("16-gen2", 'Looking Glass 16", second generation', 5, 9, (4096, 4096), WIDE, 40.0),
        Display("32-gen2", 'Looking Glass 32", second generation', 5, 9, (8192, 8192), WIDE, 40.0),
        Display("8.9", 'Looking Glass 8.9", first generation', 5, 9, (4096, 4096), 1.6, 40.0),
        Display("15.6", 'Looking Glass 15.6", first generation', 5, 9, (4096, 4096), WIDE, 40.0),
        Display("8k", "Looking Glass 8K, first generation", 5, 9, (8192, 8192), WIDE, 40.0),
    )
}


def display_of(name: str) -> Display:
    """Return the display of that name. Raises BadInputError where none is known by it."""
    if not isinstance(name, str) or name not in DISPLAYS:
        raise BadInputError(
            Words("the display must be one of {choices}, not {name}", choices=", ".join(DISPLAYS), name=repr(name))
        )
    return DISPLAYS[name]
