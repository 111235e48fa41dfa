"""What is thinner than a pixel: a cord, a wire, a blade of grass.

A pixel's depth is its first sample's, its colour is all samples'. Where the first one misses what is thin and near, its
colour is carried with the depth of what is behind it, to the wrong place, with a contrast that shows. What Cycles gives
a denoiser for depth is the mean of all samples: there it is nearer, and in a few pixels side by side. A surface that
mirrors is farther away in that, and one that mirrors little light may be nearer as a whole: that is not thin.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .camera import Camera, PerspectiveCamera, disparity_per_nearness, target_from_source
from .masks import dilate

THRESHOLD = 0.1
"""Pixels in the other eye by which the mean of the samples puts a pixel nearer than the first one does."""

THIN = 1
"""Pixels: what holds a square of this reach is a surface."""


def thin_things(
    length: NDArray[np.float32],
    depth: NDArray[np.float32],
    camera: PerspectiveCamera,
    other: Camera,
    *,
    clip_start: float,
) -> NDArray[np.bool_]:
    """(H, W): pixels of `camera` in which something thin is nearer than their depth (H, W) says.

    And the pixel beside each to which that moves in the other eye, away from what is behind it. length (H, W) is the
    mean length of the rays' way from where they are clipped (passes.LENGTH_PASS).
    """
    mean = np.maximum(length / _slant(camera) + clip_start, clip_start)
    nearer = camera.nearness_from_depth(mean) - camera.nearness_from_depth(depth.astype(np.float64))
    found = np.isfinite(depth) & (nearer * disparity_per_nearness(camera, other) > THRESHOLD)
    surfaces = ~dilate(~found, THIN)
    found &= ~dilate(surfaces, THIN + 1)
    moved = np.zeros_like(found)
    if target_from_source(camera, other)[0, 3] < 0.0:
        moved[:, :-1] = found[:, 1:]
    else:
        moved[:, 1:] = found[:, :-1]
    return found | moved


def _slant(camera: PerspectiveCamera) -> NDArray[np.float64]:
    """(H, W): length of each pixel's ray for one unit of depth."""
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    _, ray = camera.ray_from_px(x, y)
    return np.sqrt(sum(np.square(part) for part in ray))
