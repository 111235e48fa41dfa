"""Settings for headsets: the whole sphere around the camera, 8192 x 4096 pixels for each eye."""

import bpy

settings = bpy.context.scene.stereo_reproject

settings.headset = "vr360"
settings.headset_height = 4096
