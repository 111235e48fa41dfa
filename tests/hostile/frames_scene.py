"""The scene of which the rows about journals have frames: without date and time in its files, so that a frame that is
rendered again is the same in every byte."""

from tests.hostile.blends import odd


@odd("frames")
def _(scene):
    scene.frame_end = 3
    for name in ("filename", "date", "time", "render_time", "frame", "memory", "hostname"):
        setattr(scene.render, f"use_stamp_{name}", False)
    scene.objects["Cube"].keyframe_insert("location", frame=1)
