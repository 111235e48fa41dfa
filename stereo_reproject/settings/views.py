"""Settings of many views of one frame, as light-field displays and lenticular prints take them: checked once, and
frozen."""

from __future__ import annotations

import re
from dataclasses import dataclass

from ..delivery.displays import DISPLAYS, display_of
from ..delivery.quilts import grid_for
from ..errors import BadInputError
from ..words import Words
from .checks import check_choice, check_float, check_int

MIN_COUNT, MAX_COUNT = 2, 256
DEFAULT_COUNT = 48
DEFAULT_CONE_DEGREES = 40.0
"""Number of views and their cone, where neither a display nor anything else says them."""

MAX_CONE_DEGREES = 180.0
"""The angle that a cone of cameras on a straight line stays below."""

VIEWS_LAYOUTS = "individual", "multi-view"
"""Ways to store views: in a file for each, or in one."""

ASPECTS = 0.01, 100.0
"""Least and greatest width of a display over its height. Blender's pixels can be 200 times as wide as high."""


@dataclass(frozen=True)
class ViewsSettings:
    """The settings of many views; those of each picture are a `StereoSettings`. Raises BadInputError.

    count is the number of views, whose cameras stand on a line across the viewing direction and look at one window, at
    focus_distance, in scene units; None stands for the camera's convergence distance. The distance between the
    outermost cameras is given by exactly one of two: by the angle between them, cone_degrees, seen from the middle of
    that window, or by baseline, in scene units.

    columns and rows are the quilt's grid, with at least as many places as views; None makes no quilt. aspect is the
    width of the display over its height, None that of a view. Where a view's pixels are of another shape, they are not
    square. display is a name in `delivery.displays.DISPLAYS` that the others were taken from, None without one.

    fresh is the share, 0 to 1, of the pixels of each made view that is traced anew though the warp has an answer.

    With from_scene the views are the scene's own, by cameras of their own: count is 0, and nothing else says how many
    they are and where they stand.

    layout is one of `VIEWS_LAYOUTS`: a file for each view, or one multi-view EXR of all.
    """

    count: int
    cone_degrees: float | None = None
    baseline: float | None = None
    focus_distance: float | None = None
    columns: int | None = None
    rows: int | None = None
    aspect: float | None = None
    display: str | None = None
    fresh: float = 0.0
    from_scene: bool = False
    layout: str = VIEWS_LAYOUTS[0]

    def __post_init__(self) -> None:
        check_choice("the layout", self.layout, VIEWS_LAYOUTS)
        if self.from_scene:
            self._check_from_scene()
            return
        if self.count is None:
            raise BadInputError("the number of views must be given")
        check_int("the number of views", self.count, MIN_COUNT, MAX_COUNT)
        if (self.cone_degrees is None) == (self.baseline is None):
            raise BadInputError("either the cone or the baseline must be given, and not both")
        if self.cone_degrees is not None:
            check_float("the cone", self.cone_degrees, 0.0, above=True)
            if self.cone_degrees >= MAX_CONE_DEGREES:
                raise BadInputError(
                    Words("the cone must be below {most} degrees, not {cone}", most=180, cone=f"{self.cone_degrees:g}")
                )
        for name, value in (("the baseline", self.baseline), ("the focus distance", self.focus_distance)):
            if value is not None:
                check_float(name, value, 0.0, above=True)
        self._check_quilt()
        self._check_fresh()
        self._check_aspect()
        if self.display is not None:
            display_of(self.display)

    def _check_fresh(self) -> None:
        """Raise BadInputError unless the share to be traced anew is one."""
        check_float("the fresh share", self.fresh, 0.0)
        if self.fresh > 1.0:
            message = "the fresh share must be at most {most}, not {fresh}"
            raise BadInputError(Words(message, most=1, fresh=f"{self.fresh:g}"))

    def _check_from_scene(self) -> None:
        """Check the settings of the scene's own views. Raises BadInputError."""
        said = (self.cone_degrees, self.baseline, self.focus_distance, self.display)
        if self.count or any(value is not None for value in said):
            raise BadInputError(
                "the scene's own views are as many as it has, where its cameras stand: leave --views, --cone,"
                " --baseline, --focus and --display out"
            )
        self._check_quilt()
        self._check_fresh()
        self._check_aspect()

    def _check_aspect(self) -> None:
        if self.aspect is None:
            return
        check_float("the aspect", self.aspect, ASPECTS[0])
        if self.aspect > ASPECTS[1]:
            raise BadInputError(
                Words("the aspect must be at most {most}, not {aspect}", most=100, aspect=f"{self.aspect:g}")
            )

    def _check_quilt(self) -> None:
        """Raise BadInputError unless there is no quilt, or one with a place for each view."""
        if (self.columns is None) != (self.rows is None):
            raise BadInputError("the quilt must have both columns and rows, or neither")
        if self.columns is None or self.rows is None:
            return
        check_int("the quilt's columns", self.columns, 1, MAX_COUNT)
        check_int("the quilt's rows", self.rows, 1, MAX_COUNT)
        self.check_places(self.count)

    def check_places(self, count: int) -> None:
        """Raise BadInputError where the quilt, if there is one, has fewer places than there are views."""
        if self.columns is None or self.rows is None or self.columns * self.rows >= count:
            return
        raise BadInputError(
            Words(
                "a quilt of {columns} x {rows} must have a place for each of the {count} views",
                columns=self.columns,
                rows=self.rows,
                count=count,
            )
        )

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the views, as `view_names` has them; none of the scene's own, which it alone tells."""
        return () if self.from_scene else view_names(self.count)

    @property
    def view_size(self) -> tuple[int, int] | None:
        """The width and height of a view in pixels that suit the display; None without a display."""
        return None if self.display is None else DISPLAYS[self.display].view_size(self.columns, self.rows)


def view_names(count: int) -> tuple[str, ...]:
    """Return the names of so many views, from the leftmost camera to the rightmost: "view_00", "view_01" and so on."""
    digits = max(2, len(str(count - 1)))
    return tuple(f"view_{k:0{digits}d}" for k in range(count))


def views_settings(
    *,
    display: str | None = None,
    count: int | None = None,
    cone_degrees: float | None = None,
    baseline: float | None = None,
    focus_distance: float | None = None,
    quilt: tuple[int, int] | None = None,
    aspect: float | None = None,
) -> ViewsSettings:
    """Return the settings of many views, with what is None taken from the display of that name, or else from the usual
    ones: 48 views, a cone of 40 degrees, and a quilt that suits their number. quilt is (columns, rows). Raises
    BadInputError."""
    known = None if display is None else display_of(display)
    if count is None:
        count = quilt[0] * quilt[1] if quilt is not None else DEFAULT_COUNT if known is None else known.count
    if cone_degrees is None and baseline is None:
        cone_degrees = DEFAULT_CONE_DEGREES if known is None else known.cone_degrees
    if quilt is None and known is not None and count == known.count:
        quilt = known.columns, known.rows
    if quilt is None and isinstance(count, int) and MIN_COUNT <= count <= MAX_COUNT:
        quilt = grid_for(count)
    columns, rows = quilt or (None, None)
    aspect = known.aspect if aspect is None and known is not None else aspect
    return ViewsSettings(count, cone_degrees, baseline, focus_distance, columns, rows, aspect, display)


def read_quilt(text: str) -> tuple[int, int]:
    """Return (columns, rows) from a text such as 8x6. Raises BadInputError."""
    match = re.fullmatch(r"([1-9]\d{0,8})[xX]([1-9]\d{0,8})", text)
    if match is None:
        raise BadInputError(
            Words("the quilt must be of the form COLUMNSxROWS, such as 8x6, not {text}", text=repr(text))
        )
    return int(match[1]), int(match[2])
