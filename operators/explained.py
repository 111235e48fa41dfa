"""Explanations of figures and settings, as tooltips. Blender gives labels none, so that a heading has a question mark
that bears them.
"""

from __future__ import annotations

import bpy

from .fitting import fits
from .text import reported, shown

MARK_PX = 48.0
"""Pixels that a question mark takes beside a text, with the margins of both, at a scale of 1."""

ESTIMATED, MEASURED, TIME, TRACED = "Quality (Estimated)", "Quality (Measured)", "Time", "Rendered Again"
EYES = "Eyes and Screen"
"""Headings."""

_OF_ERROR = (
    "Error: how far the second eye is from a rendered one, over how far two renders are apart by their noise alone. At"
    " 1 it is as good as rendered (honest ratio)"
)
_OF_NOISE = (
    "Error and noise: the same, less the noise that moving pixels has smoothed away. Below 1, the second eye has less"
    " noise than a rendered one (noise ratio)"
)
_OF_SPEED = "Speed: how many times as fast as rendering both eyes whole, as Blender's multiview does"

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
        "Saved in all: against rendering both eyes, with loading a copy of the file, measuring and writing counted",
    ),
    TRACED: (
        "Share of the second eye's pixels that were rendered, by reason; a pixel may have several",
        "Hidden from the first eye: something nearer stands before them there",
        "Edges: of things nearer than what is behind them",
        "Spot checks: pixels that were rendered to find out how good the others are",
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
