"""The layouts of a stereo pair in one picture or movie, without Blender.

It takes pictures and movie files and gives file names with the layout's tag, anaglyphs, and movies with the marks
by which players know the layout and the part of the sphere that is shown. Start reading at `layouts`.
"""
