"""The panel of pairs that are made for headsets, and what another panel says of such pairs."""

from __future__ import annotations

import math

import bpy

from ..stereo_reproject.blender.scene.panoramas import is_panorama
from ..stereo_reproject.views.comfort import MAX_VERGENCE_DEGREES, turned_apart_degrees
from ..stereo_reproject.words import Words
from .drawing import paragraph
from .fitting import draw_setting
from .headset import CHOICES, FLAT, STEREO_SETTINGS, asked_panorama, panorama_size, stereo_settings_that_count
from .lengths import length_words

NAMES = {name: text for name, text, _ in CHOICES}
"""Words for the choices of what is rendered."""

PANORAMA_ALREADY = "The camera is a panorama already: its own lens and the resolution in Output count."

NO_SCREEN = (
    "In a headset there is no screen. Nothing should be nearer to the camera than its interocular distance, {length}."
)
ONE_COUNTS = "For {panorama} only the interocular distance counts: the eyes are parallel, evenly beside the camera."
GREY_DOES_NOT_COUNT = "What is grey does not count for this camera."
TURNED_APART = "Eyes turn apart by {degrees}° to look at what is far away: set the mode to Parallel."


class Headset:
    """Contents of the panel for pairs that are made for headsets."""

    bl_label = "Headset"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw what is rendered and its size; grey, with the reason, where the camera is a panorama by itself."""
        layout, scene = self.layout, context.scene
        chosen, is_grey = scene.stereo_reproject, is_panorama(scene.camera)
        column = layout.column()
        column.enabled = not is_grey
        draw_setting(column, context, chosen, "headset")
        if chosen.headset != FLAT:
            draw_setting(column, context, chosen, "headset_height")
        if is_grey:
            paragraph(layout, context, PANORAMA_ALREADY, icon="INFO")
        elif chosen.headset != FLAT:
            width, height = panorama_size(scene, chosen.headset)
            paragraph(layout, context, Words("{width} x {height} pixels for each eye.", width=width, height=height))


def draw_panorama(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw which panorama is rendered in place of what the camera sees, and its size; nothing where none is."""
    scene = context.scene
    panorama = asked_panorama(scene)
    if panorama is None:
        return
    width, height = panorama_size(scene, panorama)
    text = Words("{panorama}, {width} x {height} pixels", panorama=NAMES[panorama], width=width, height=height)
    paragraph(layout, context, text, icon="INFO")


def draw_comfort(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw what a viewer with a headset needs of the camera's stereo settings, in place of what is about a screen."""
    scene = context.scene
    stereo = scene.camera.data.stereo
    paragraph(layout, context, Words(NO_SCREEN, length=length_words(scene, stereo.interocular_distance)), icon="INFO")
    panorama = asked_panorama(scene)
    if panorama is not None:
        paragraph(layout, context, Words(ONE_COUNTS, panorama=NAMES[panorama]))
    elif len(stereo_settings_that_count(scene)) < len(STEREO_SETTINGS):
        paragraph(layout, context, GREY_DOES_NOT_COUNT)
    # A perspective camera gets parallel eyes where it is set up for a headset.
    made_parallel = panorama is not None and scene.camera.data.type == "PERSP"
    parallel = made_parallel or stereo.convergence_mode == "PARALLEL"
    apart = turned_apart_degrees(stereo.interocular_distance, math.inf if parallel else stereo.convergence_distance)
    if apart > MAX_VERGENCE_DEGREES:
        paragraph(layout, context, Words(TURNED_APART, degrees=f"{apart:.1f}"), icon="ERROR")
