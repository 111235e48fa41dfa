"""The rendering of many frames, by any number of processes at once, into one folder.

It takes the frames with the files that they are to be written to, the fingerprints of settings and scene, and what
renders and writes a frame (`FrameMaker`). It gives finished frames, each rendered by one run alone and recorded in the
journal beside them, and the report of the animation. Start reading at `frames`; `journal` says what is on the drive.
"""
