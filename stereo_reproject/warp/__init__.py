"""The warp: from rendered views, the sources, to the target.

Takes `RenderedView`s with their passes, the target's `View` and `WarpOptions`; gives a `WarpedView`: the passes as the
target sees them, and a map that names source and place of each target pixel. Start reading at `warper`.
"""
