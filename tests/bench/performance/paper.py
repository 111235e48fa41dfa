"""What the paper says of itself: S. Wissmann, F. Misiak, A. Fuhrmann, M. E. Latoschik, "Accelerated Stereo Rendering
with Hybrid Reprojection-Based Rasterization and Adaptive Ray-Tracing", IEEE VR 2020.

Only figures that were read there are here. Its speed-up is over two full renders of its own renderer on its own
machine; ours is over Blender's multiview, which shares the sync between the eyes, in the same run.
"""

TITLE = "Wissmann et al., IEEE VR 2020"
SPEEDUP = (1.28, 1.55)
TRACED = 0.06

FACTS = {"source": TITLE, "speedup_over_two_renders": list(SPEEDUP), "traced_on_average": TRACED}

COUNTERPARTS = {
    "multiview": "two renders",
    "card": "Repro ReRaster",
    "packed": "Repro RT",
}
"""The paper's own method that each of ours answers to."""
