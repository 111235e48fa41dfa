"""Explanations of figures and settings, as tooltips. Blender gives labels none, so that a heading has a question mark
that bears them.
"""

from __future__ import annotations

import bpy

from ..stereo_reproject.images.reasons import Reason
from ..stereo_reproject.words import Words
from .fitting import fits
from .text import reported, shown

MARK_PX = 48.0
"""Pixels that a question mark takes beside a text, with the margins of both, at a scale of 1."""

ESTIMATED, MEASURED, TIME, TRACED = "Quality (Estimated)", "Quality (Measured)", "Time", "Rendered Again"
EYES = "Eyes and Screen"
"""Headings."""

_OF_ERROR = (
    "Error: how far the second eye is from a rendered one, over how far two renders are apart by their noise alone. At"
    " 1 it is as good as rendered"
)
_OF_NOISE = (
    "Error and noise: the same, less the noise that moving pixels has smoothed away. Below 1, the second eye has less"
    " noise than a rendered one"
)
_OF_SPEED = (
    "Speed: how many times as fast as rendering both eyes whole, as Blender's multiview does. It is measured with"
    " Compare alone; else the time of both eyes is estimated from that of the rendered eye: twice as long, less the"
    " time in which Blender prepares the scene, which it does once for both"
)
_OF_REASONS = {
    Reason.DISOCCLUDED: "something nearer stands before them there",
    Reason.OUTSIDE: "the first eye's picture ends before them",
    Reason.SILHOUETTE: "of things nearer than what is behind them, and things as thin as a pixel",
    Reason.TRANSPARENT: "what is seen through glass is elsewhere than the glass",
    Reason.VIEW_DEPENDENT: "what looks different from each eye",
    Reason.VOLUME: "smoke or mist before the sky",
    Reason.DEFOCUS: "edges that are out of focus",
    Reason.DETAIL: "so fine that moving its pixels would blur it",
    Reason.REFINED: (
        "found by spot checks to be off by more than the accuracy allows. The picture of that name shows what is left"
        " after they were rendered again"
    ),
    Reason.PROBE: "pixels that were rendered to find out how good the others are",
    Reason.INVALID: "the first eye has no valid colour there",
    Reason.MOVED: "what has moved since the first eye was rendered, in an animation",
}
"""Meanings of the reasons for which pixels are rendered again."""

EXPLANATIONS = {
    EYES: (
        "The screen is where the picture will be seen: a monitor, a television, a cinema",
        "Interocular: distance between both eyes' cameras. The larger, the more depth there is",
        (
            "Convergence: distance from the camera at which things are seen exactly at the screen. What is nearer"
            " stands out in front of it, what is farther lies behind it"
        ),
        "Pivot: the eye that stands where the camera is, or both beside it",
        (
            "Mode: with Off-Axis, the usual one, both cameras look straight ahead; Toe-in turns them towards each"
            " other; Parallel has its screen at infinity"
        ),
        "Percent: how far the two pictures of a point are apart on the screen, of the picture's width",
    ),
    ESTIMATED: (
        "Found by spot checks: pixels that were both moved and rendered",
        _OF_ERROR,
        "Likely range: the true error is in it in 95 of 100 pictures",
        "Promise: the error that the chosen accuracy allows at most",
        _OF_NOISE,
    ),
    MEASURED: (
        "Found by rendering both eyes with Blender's multiview",
        _OF_ERROR,
        _OF_NOISE,
        "Worst spots: error and noise of the worst hundredth of the picture, in squares of 16 pixels",
        "Mean difference: how far the pixels are from multiview's, noise included (root mean square)",
    ),
    TIME: (
        "Seconds that each step took",
        _OF_SPEED,
        "Hole rendering, packed: all missing pixels of the picture are rendered together, as one small picture",
        (
            "Hole rendering, card: the whole picture is rendered behind a card that is open where pixels are missing,"
            " so that the rest takes next to no time"
        ),
        "Hole rendering, full: the other eye is rendered whole",
        "Saved in all: against rendering both eyes, with loading a copy of the file, measuring and writing counted",
    ),
    TRACED: (
        "Share of the second eye's pixels that were rendered, by reason; a pixel may have several",
        *(Words("{reason}: {meaning}", reason=Words(each.words), meaning=Words(_OF_REASONS[each])) for each in Reason),
    ),
}
"""Lines of the tooltips, by heading."""


class STEREO_REPROJECT_OT_explain(bpy.types.Operator):
    """Say what is meant below this heading"""

    bl_idname = "stereo_reproject.explain"
    bl_label = "Explain Figures"
    bl_options = {"INTERNAL"}

    heading: bpy.props.EnumProperty(name="Heading", items=[(name, name, "") for name in EXPLANATIONS])

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        """Return the tooltip, which says what the figures mean."""
        return "\n".join(map(shown, EXPLANATIONS[properties.heading]))

    def execute(self, _context: bpy.types.Context) -> set[str]:
        """Report what the tooltip says."""
        self.report({"INFO"}, "\n".join(map(reported, EXPLANATIONS[self.heading])))
        return {"FINISHED"}


def draw_heading(layout: bpy.types.UILayout, heading: str) -> None:
    """Draw a heading, and a question mark whose tooltip explains the figures below: at its right, or in a line of its
    own where there is no room.
    """
    place = layout.row() if fits(bpy.context, heading, 1.0, MARK_PX) else layout
    place.label(text=heading)
    mark = place.row()
    mark.alignment = "RIGHT"
    mark.operator(STEREO_REPROJECT_OT_explain.bl_idname, text="", icon="QUESTION", emboss=False).heading = heading
