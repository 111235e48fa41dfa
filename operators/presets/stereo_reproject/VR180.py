"""Settings for headsets: the half of the sphere in front of the camera, 4096 pixels high and wide for each eye."""

import bpy

settings = bpy.context.scene.stereo_reproject

settings.headset = "vr180"
settings.headset_height = 4096
