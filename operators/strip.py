"""Text on a dark strip, drawn over an editor: it can be read on any picture."""

from __future__ import annotations

from collections.abc import Sequence

import blf
import gpu
from gpu_extras.batch import batch_for_shader

FONT, SIZE_PX, MARGIN_PX = 0, 12.0, 8.0

LINE_HEIGHT = 1.6
"""Height from one line to the next, in heights of letters."""

TEXT_COLOUR = (1.0, 1.0, 1.0, 1.0)
STRIP_COLOUR = (0.0, 0.0, 0.0, 0.8)


def text_width_px(text: str, scale: float) -> float:
    """Return the width of a text on a strip in pixels; scale is the interface's."""
    blf.size(FONT, SIZE_PX * scale)
    return blf.dimensions(FONT, text)[0]


def strip_height_px(scale: float, count: int = 1) -> float:
    """Return the height in pixels of a strip for so many lines; scale is the interface's."""
    return (count - 1) * _line_height_px(scale) + _letter_height_px(scale) + 2.0 * MARGIN_PX * scale


def _letter_height_px(scale: float) -> float:
    """Return the height of letters on a strip in pixels."""
    blf.size(FONT, SIZE_PX * scale)
    return blf.dimensions(FONT, "Xg")[1]


def _line_height_px(scale: float) -> float:
    """Return the height from one line of a strip to the next in pixels."""
    return LINE_HEIGHT * _letter_height_px(scale)


def draw_strip(corner: tuple[float, float], width: float, text_left: float, lines: Sequence[str], scale: float) -> None:
    """Draw a strip of this width and lines of text on it. corner is its lower left corner and text_left where the lines
    begin, in pixels of the region that is being drawn; scale is the interface's.
    """
    (left, bottom), height = corner, strip_height_px(scale, len(lines))
    right, top = left + width, bottom + height
    blend = gpu.state.blend_get()
    gpu.state.blend_set("ALPHA")
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    corners = [(left, bottom), (right, bottom), (right, top), (left, top)]
    strip = batch_for_shader(shader, "TRIS", {"pos": corners}, indices=[(0, 1, 2), (0, 2, 3)])
    shader.uniform_float("color", STRIP_COLOUR)
    strip.draw(shader)
    gpu.state.blend_set(blend)
    blf.size(FONT, SIZE_PX * scale)
    blf.color(FONT, *TEXT_COLOUR)
    for above, line in enumerate(reversed(lines)):
        blf.position(FONT, text_left, bottom + MARGIN_PX * scale + above * _line_height_px(scale), 0.0)
        blf.draw(FONT, line)
