"""Finished eyes as Blender's Render Result, and as files in the scene's own formats, layouts and movies."""
