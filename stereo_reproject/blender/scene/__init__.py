"""The user's scene: read, and copied to work in; the user's own is never changed.

It takes Blender's datablocks and gives working scenes, the cameras of both eyes as numbers, the effects that a frame
calls for, fingerprints, and warnings about what a pair lacks. Start reading at `working`.
"""
