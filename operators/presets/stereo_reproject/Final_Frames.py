"""Settings for final frames: as good as can be told from a full render."""

import bpy

settings = bpy.context.scene.stereo_reproject

settings.accuracy = "high"
settings.source_engine = "scene"
settings.fill = "auto"
settings.packed_by = "auto"
