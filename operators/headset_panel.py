"""The panel of pairs that are made for headsets."""

from __future__ import annotations

import bpy

from ..stereo_reproject.blender.scene.panoramas import is_panorama
from ..stereo_reproject.words import Words
from .drawing import paragraph
from .fitting import draw_setting
from .headset import FLAT, panorama_size

PANORAMA_ALREADY = "The camera is a panorama already: its own lens and the resolution in Output count."


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
