"""The part of the panel "Stereo Camera" that shows the scene's depth on the screen: buttons, a bar, and warnings."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import bpy

from ..stereo_reproject.blender.scene.depth import EDGE_ROWS
from ..stereo_reproject.views.comfort import Limits, comfort_limits
from ..stereo_reproject.views.depth_range import MIN_CUT_PERCENT, cut_in_front
from ..stereo_reproject.views.parallax import ScreenParallax
from ..stereo_reproject.words import Words
from .depth import (
    STEREO_REPROJECT_OT_fit_to_comfort,
    STEREO_REPROJECT_OT_measure_depth,
    camera_state,
    distances_of,
    side_words,
)
from .drawing import paragraph
from .fitting import ICON_PX, TEXT_MARGINS_PX, first_that_fits, fits
from .results import KnownDepth, result_of
from .screen_here import STEREO_REPROJECT_OT_set_screen_here, is_out
from .stereo import depth_of_cuts, is_comfortable, parallax_now, viewing_conditions
from .text import shown

BAR_PERCENT = 3.0
"""Parallax at either end of the bar, in percent of the width: the rule of thumb of stereographers, and about one degree
on most screens."""

MAX_NAMED_CUTS = 2

TURNED_APART = "Too far behind a screen {width} m wide: wider apart than a viewer's eyes ({eyes} mm)."
TOO_FAR = "Too far behind the screen: more than {percent} %."
TOO_NEAR = "Too near in front of the screen: more than {percent} %."
"""Warnings of the panel, each with figures in braces."""

CUT = {
    ("left",): "{name} is in front of the screen and cut by its left edge.",
    ("right",): "{name} is in front of the screen and cut by its right edge.",
    ("left", "right"): "{name} is in front of the screen and cut by its left and right edges.",
}
"""Message about what the frame cuts, by the sides of its edges."""

UNNAMED_CUT = {
    ("left",): "Something is in front of the screen and cut by its left edge.",
    ("right",): "Something is in front of the screen and cut by its right edge.",
    ("left", "right"): "Something is in front of the screen and cut by its left and right edges.",
}
"""Message about what the frame cuts and has no name, as a pair shows it."""

FLAT = "The interocular distance is 0: both eyes see the same, without depth."

ALIKE = "An orthographic camera shows all depths alike: the pair has no depth."

EDGES_UNKNOWN = "Not known if the frame's edges cut what is in front of the screen: the round arrow below finds out."

LOWER = "Lower the interocular distance."
LOWER_OR_FARTHER = "Lower the interocular distance, or set the convergence farther away."
LOWER_OR_NEARER = "Lower the interocular distance, or set the convergence nearer."
LOWER_OR_MOVE = "Lower the interocular distance, or move the camera or the object."
NEARER_OR_MOVE = "Set the convergence nearer, or move the camera or the object."
"""Advice that follows a warning. Only the interocular distance helps on both sides of the screen, and in a parallel
camera."""

SCREEN_HERE, SHOW_DEPTH = ("Set Screen Here", "Set Screen"), ("Show in 3D View", "Show in 3D", "Show")
"""Texts of buttons: the usual one, and shorter ones for narrow panels."""

FIT_SHARE = 0.43
"""Share of the row that Fit to Comfort has: the other button has an icon, and both must fit into a narrow panel."""

STUB_PERCENT = 0.5
"""Length, in percent of the picture's width, of what stands at the bar's end for a scene beyond it, and of what is red
there at least: wide enough to be seen in a narrow panel."""

MIN_PIECE = 0.01
"""Share of half the bar below which a piece of it is too narrow to be drawn."""


@dataclass(frozen=True)
class Piece:
    """A piece of one half of the bar: its share of that half, and whether the scene's depth is there; alert is True
    where that is not comfortable.
    """

    share: float
    filled: bool
    alert: bool = False


def bar_pieces(near: float, far: float, limits: Limits, low: float, high: float) -> list[Piece]:
    """Return the pieces of the bar from `low` to `high`, in order, for a scene with parallax from near to far. All are
    in percent of the width. A scene that is beyond the bar shows as a stub at its end, and what is beyond a limit
    that is the bar's end, or farther, as red there.
    """
    stub = BAR_PERCENT - STUB_PERCENT
    shown_near, shown_far = min(near, stub), max(far, -stub)
    red_below = max(limits.near, -stub) if near < limits.near else limits.near
    red_above = min(limits.far, stub) if far > limits.far else limits.far
    marks = sorted({low, high, *(m for m in (shown_near, shown_far, red_below, red_above) if low < m < high)})
    pieces: list[Piece] = []
    for start, end in itertools.pairwise(marks):
        middle, share = 0.5 * (start + end), (end - start) / (high - low)
        filled = shown_near <= middle <= shown_far
        alert = filled and not red_below <= min(max(middle, near), far) <= red_above
        if pieces and (pieces[-1].filled, pieces[-1].alert) == (filled, alert):
            share += pieces.pop().share
        if share >= MIN_PIECE:
            pieces.append(Piece(share, filled, alert))
    return pieces


def draw_depth(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the buttons that place the scene's depth, what is uncomfortable in it, and that depth on the screen."""
    layout.use_property_split = False
    scene = context.scene
    known, found = result_of(scene).depth, parallax_now(scene)
    # Beside its icon, the text needs no margins of its own.
    fit_in_row = fits(context, "Set Screen Here", 1.0 - FIT_SHARE, ICON_PX)
    row = layout.split(factor=FIT_SHARE, align=True) if fit_in_row else layout.column(align=True)
    row.operator(STEREO_REPROJECT_OT_fit_to_comfort.bl_idname)
    here = first_that_fits(context, SCREEN_HERE, 1.0, ICON_PX)
    row.operator(STEREO_REPROJECT_OT_set_screen_here.bl_idname, text=here, icon="EYEDROPPER", depress=is_out())
    show = first_that_fits(context, SHOW_DEPTH, 1.0, ICON_PX)
    layout.prop(scene.stereo_reproject, "show_depth", text=show, toggle=True, icon="VIEW3D")
    if scene.camera.data.type == "ORTHO":
        paragraph(layout, context, ALIKE, icon="ERROR")
        return
    # Below the buttons, which so stay where they are.
    if scene.camera.data.stereo.interocular_distance == 0.0:
        paragraph(layout, context, FLAT, icon="ERROR")
    if known is None or not found:
        layout.operator(STEREO_REPROJECT_OT_measure_depth.bl_idname, icon="FILE_REFRESH")
        return
    result = result_of(scene)
    if result.fitted and result.fitted_to == distances_of(scene.camera.data):
        paragraph(layout, context, Words("Fitted. {line}.", line=result.fitted), icon="INFO")
    draw_warnings(layout, context)
    if known.edges is None and found[0][1].percent < -MIN_CUT_PERCENT:
        paragraph(layout, context, EDGES_UNKNOWN, icon="INFO")
    column = layout.column(align=True)
    when, measure = _when(known, scene), STEREO_REPROJECT_OT_measure_depth.bl_idname
    if fits(context, when, 1.0, ICON_PX + TEXT_MARGINS_PX):
        row = column.row()
        row.label(text=shown(when))
        row.operator(measure, text="", icon="FILE_REFRESH")
    else:
        paragraph(column, context, when)
        column.operator(measure, icon="FILE_REFRESH")
    # As the lines below have it: what is less than half a pixel from the screen is at it.
    percents = [0.0 if abs(parallax.pixels) < 0.5 else parallax.percent for _, parallax in found]
    _draw_bar(column, min(percents), max(percents), comfort_limits(viewing_conditions(scene)))
    _draw_ends(column, context)
    for name, parallax in found:
        fields = {"side": side_words(parallax.percent), "pixels": f"{abs(parallax.pixels):.0f}"}
        paragraph(layout, context, Words("{end}: {side} ({pixels} px)", end=Words(name), **fields))


def draw_warnings(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw what is uncomfortable in the scene's depth on the screen, as far as that is known; a headset has no
    screen.
    """
    for warning in depth_warnings(context.scene):
        paragraph(layout, context, warning, icon="ERROR")


def depth_warnings(scene: bpy.types.Scene) -> list[str]:
    """Return sentences that say what of the scene's depth is uncomfortable; none where that is not known, or where an
    orthographic camera shows none.
    """
    known, found = result_of(scene).depth, parallax_now(scene)
    if known is None or not found or scene.camera.data.type == "ORTHO":
        return []
    return warnings_on(scene, known, found, comfort_limits(viewing_conditions(scene)))


def _when(known: KnownDepth, scene: bpy.types.Scene) -> str:
    """Return for which frame the depth was found, as words, and whether the camera sees something else by now."""
    if known.frame != scene.frame_current:
        return Words("Depth at frame {frame} (now {now})", frame=known.frame, now=scene.frame_current)
    moved = bool(known.seen_from) and known.seen_from != camera_state(scene)
    return Words("Depth at frame {frame}, camera moved" if moved else "Depth at frame {frame}", frame=known.frame)


def _draw_bar(layout: bpy.types.UILayout, near: float, far: float, limits: Limits) -> None:
    """Draw the bar from BAR_PERCENT in front of the screen to as much behind it, with a gap at the screen. Its pieces
    are buttons that measure: panels have no other coloured areas, and red ones least of all.
    """
    name = STEREO_REPROJECT_OT_measure_depth.bl_idname
    halves = layout.split(factor=0.5)
    for low, high in ((-BAR_PERCENT, 0.0), (0.0, BAR_PERCENT)):
        row, left = halves.row(align=True), 1.0
        for piece in bar_pieces(near, far, limits, low, high):
            part = row.split(factor=min(piece.share / left, 1.0), align=True) if piece.share < left else row
            cell = part.row(align=True)
            cell.alert = piece.alert
            cell.operator(name, text="", depress=piece.filled and not piece.alert)
            row, left = part, left - piece.share


def _draw_ends(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw what the bar's two ends stand for, without their figures where the panel is too narrow for them."""
    percent = f"{BAR_PERCENT:g}"
    words = (Words("{percent} % in front", percent=percent), Words("behind {percent} %", percent=percent))
    if not all(fits(context, text, 0.5) for text in words):
        words = ("in front", "behind")
    ends = layout.split(factor=0.5)
    ends.label(text=shown(words[0]))
    row = ends.row()
    row.alignment = "RIGHT"
    row.label(text=shown(words[1]))


def warnings_on(
    scene: bpy.types.Scene, known: KnownDepth, found: Sequence[tuple[str, ScreenParallax]], limits: Limits
) -> list[str]:
    """Return sentences that say what of the scene's depth is uncomfortable, and what helps. found is what
    `parallax_now` returns where the depth is known, limits are those of the viewing conditions.
    """
    (_, near), (_, far) = found
    cuts = _cuts(scene, known)
    apart, too_near = not is_comfortable(scene, far), near.percent < limits.near
    too_far = apart or far.percent > limits.far
    only_lower = (too_far and (too_near or bool(cuts))) or scene.camera.data.stereo.convergence_mode == "PARALLEL"
    warnings = []
    if apart:
        viewing = viewing_conditions(scene)
        sizes = {"width": f"{viewing.screen_width:g}", "eyes": f"{1000.0 * viewing.eye_distance:.0f}"}
        warnings.append((Words(TURNED_APART, **sizes), LOWER_OR_FARTHER))
    elif too_far:
        warnings.append((Words(TOO_FAR, percent=f"{limits.far:.1f}"), LOWER_OR_FARTHER))
    if too_near:
        warnings.append((Words(TOO_NEAR, percent=f"{-limits.near:.1f}"), LOWER_OR_NEARER))
    said = [(warning, LOWER if only_lower else advice) for warning, advice in warnings]
    said += [(cut, LOWER_OR_MOVE if only_lower else NEARER_OR_MOVE) for cut in cuts]
    return [Words("{warning} {advice}", warning=warning, advice=Words(advice)) for warning, advice in said]


def _cuts(scene: bpy.types.Scene, known: KnownDepth) -> list[Words]:
    """Return sentences that name what stands in front of the screen and is cut by the frame's left or right edge."""
    depth = depth_of_cuts(scene)
    if depth is None or not known.edges:
        return []
    sides: dict[str, list[str]] = {}
    for name, side in cut_in_front(known.edges, depth, EDGE_ROWS):
        sides.setdefault(name, []).append(side)
    named = list(sides.items())[:MAX_NAMED_CUTS]
    return [
        Words(CUT[tuple(sorted(found))], name=repr(name)) if name else Words(UNNAMED_CUT[tuple(sorted(found))])
        for name, found in named
    ]
