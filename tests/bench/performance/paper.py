"""What the paper says of itself: S. Wissmann, F. Misiak, A. Fuhrmann, M. E. Latoschik, "Accelerated Stereo Rendering
with Hybrid Reprojection-Based Rasterization and Adaptive Ray-Tracing", IEEE VR 2020.

Only figures that were read there are here. Its speed-up is over two full renders of its own renderer on its own
machine; ours is over Blender's multiview, which shares the sync between the eyes.
"""

TITLE = "Wissmann et al., IEEE VR 2020"
SPEEDUP = (1.28, 1.55)
TRACED = 0.06
WARP_SECONDS = {"1920x1080": 0.25e-3, "3840x2160": 0.82e-3}
GPU = "RTX 2080 Ti"

FACTS = {
    "source": TITLE,
    "speedup_over_two_renders": list(SPEEDUP),
    "traced_on_average": TRACED,
    "warp_seconds": WARP_SECONDS,
    "warp_gpu": GPU,
}

COUNTERPARTS = {
    "multiview": "two renders",
    "card": "Repro ReRaster",
    "packed": "Repro RT",
}
"""The paper's own method that each of ours answers to."""
