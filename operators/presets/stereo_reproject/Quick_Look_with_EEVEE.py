"""Settings for a quick look at the stereo: EEVEE renders, and nothing is promised of the second eye."""

import bpy

settings = bpy.context.scene.stereo_reproject

settings.accuracy = "draft"
settings.source_engine = "eevee"
settings.fill = "auto"
settings.packed_by = "auto"
