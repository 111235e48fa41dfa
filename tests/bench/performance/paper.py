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

REPORTED = {
    "name": "the paper",
    "speedup": list(SPEEDUP),
    "traced": TRACED,
    "told": f"{TITLE}, over two full renders",
}
"""As the charts have it."""

KNOWN = (
    f"Of the paper's own figures these stand here: a speed-up of {SPEEDUP[0]} to {SPEEDUP[1]} over two full renders, "
    f"{TRACED:.0%} of the pixels traced on average, and its warp's "
    f"{' and '.join(f'{1000.0 * seconds:g} ms at {size}' for size, seconds in WARP_SECONDS.items())} on an {GPU}; the "
    "single rows of its table 2 could not be had and are not among them."
)

METHOD = "its reprojection"
"""What its range of speed-ups is of: which of its methods has which end was not read."""

COUNTERPARTS = {
    "multiview": "two renders",
    "card": "Repro ReRaster",
    "packed": "Repro RT",
}
"""The paper's own method that each of ours answers to."""
