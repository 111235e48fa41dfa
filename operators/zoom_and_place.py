"""Zoom and place of the picture in an Image Editor, for pictures that are to be seen exactly where another one was.

In Blender 5 an image that is shown for the first time is seen at 100 %; before, an editor kept both whatever it showed.
The place is not in Blender's Python: it follows from what was drawn last.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import bpy

from .run import job_has_thread

LEAST_VERSION = (5, 0, 0)
"""Version of Blender from which on zoom and place may be others when another image is shown."""

SAME_PX = 1.5
"""Pixels of the screen by which a picture's corner is moved, at most, that is where it was: Blender draws on whole
ones."""


class ZoomAndPlace(NamedTuple):
    """Zoom of a picture, in pixels of the screen for each of the picture's, and what of it is in the middle of the
    editor, from 0 to 1, from the left and from below.
    """

    zoom: float
    x: float
    y: float

    def is_near(self, other: ZoomAndPlace, size: tuple[int, int]) -> bool:
        """Return whether a picture of this size in pixels is seen alike with both."""
        moved = [abs(mine - its) * side for mine, its, side in zip(self[1:], other[1:], size, strict=True)]
        wider = abs(self.zoom - other.zoom) * max(size)
        return max(self.zoom * max(moved), wider) < SAME_PX


def drawn_at(area: bpy.types.Area) -> ZoomAndPlace | None:
    """Return zoom and place of the picture in an Image Editor as it was drawn last; None where it never was."""
    region = _region_of(area)
    # Blender counts from the middle of the first pixel to that of the last one.
    middle = 0.5 * (region.width - 1), 0.5 * (region.height - 1)
    x, y = region.view2d.region_to_view(*middle)  # pyright: ignore[reportGeneralTypeIssues] - the stubs' arrays are none
    return None if math.isnan(x + y) else ZoomAndPlace(area.spaces.active.zoom_percentage / 100.0, x, y)


def picture_size(area: bpy.types.Area) -> tuple[int, int] | None:
    """Return width and height in pixels of the picture in an Image Editor, also of a Render Result, whose size Blender
    does not tell: they follow from the zoom and from how much of a picture the editor has drawn last, whichever that
    was, because Blender works out that zoom for the picture of now. None where nothing is shown.
    """
    region, space = _region_of(area), area.spaces.active
    if space.image is None or min(region.width, region.height) <= 1:
        return None
    # As in `drawn_at`.
    left, low = region.view2d.region_to_view(0, 0)  # pyright: ignore[reportGeneralTypeIssues] - as above
    right, high = region.view2d.region_to_view(region.width - 1, region.height - 1)  # pyright: ignore[reportGeneralTypeIssues] - as above
    shown = right - left, high - low
    # Of an editor that was never drawn they are no numbers.
    if not all(length > 0.0 for length in (*shown, *space.zoom)):  # pyright: ignore[reportGeneralTypeIssues] - as above
        return None
    width, height = region.width / (shown[0] * space.zoom[0]), region.height / (shown[1] * space.zoom[1])
    return round(width), round(height)


def put_at(window: bpy.types.Window, area: bpy.types.Area, at: ZoomAndPlace) -> None:
    """Have the picture of an Image Editor, which may not have been drawn yet, seen at this zoom and place; while a job
    runs, only at this zoom, see `zoom_to_fit` in `pictures`. Do nothing where Blender does so by itself.
    """
    if bpy.app.version < LEAST_VERSION:
        return
    space = area.spaces.active
    if not job_has_thread():
        width, height = space.image.size
        with bpy.context.temp_override(window=window, area=area, region=_region_of(area)):  # pyright: ignore[reportGeneralTypeIssues] - not in the stubs
            # It puts the picture's middle into that of the editor, wherever it was.
            bpy.ops.image.view_all(fit_view=True)
            bpy.ops.image.view_pan(offset=((at.x - 0.5) * width, (at.y - 0.5) * height))
    space.zoom_percentage = 100.0 * at.zoom


def _region_of(area: bpy.types.Area) -> bpy.types.Region:
    """Return the region of an Image Editor in which the picture is."""
    return next(region for region in area.regions if region.type == "WINDOW")
