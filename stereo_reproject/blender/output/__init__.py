"""Finished eyes handed over: into Blender, into the scene's own formats, layouts and movies."""
