"""Holes: the target pixels for which the warp does not answer, and which are traced.

Takes rendered views and a target; gives a `Reprojection`: the warped target, with `Reason` flags of its holes. One rule
per module, a function of arrays; `classifier` applies them to one source's view, `reprojection` is the whole stage.
"""
