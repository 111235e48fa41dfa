"""Things about as thin as a pixel, or thinner: a cord, a wire, a blade of grass.

One that is a pixel wide, and whose pixels have its depth, has no area in the grid; but where it lands is known.

Thinner ones: a pixel's depth is that of its first sample, its colour is that of all samples. Where the first sample
misses the thin thing, its colour is warped with the depth of the surface behind, to the wrong place, with a contrast
that shows. The depth that Cycles gives a denoiser is the mean of all samples: there such pixels are nearer than by
their first sample, a few of them side by side. A surface that mirrors is farther away in that mean, and one that
mirrors little light may be nearer as a whole: that is not thin.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..images.masks import count_within, dilate
from ..views.camera import (
    Camera,
    PerspectiveCamera,
    depth_from_ray_length,
    disparity_per_nearness,
    target_from_source,
    target_px_from_source_px,
)
from ..warp.forward import Warp
from .tuning import TUNING


def isolated(pixels: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return (H, W) those of the set pixels (H, W) that have few other set ones around them, as the pixels of a wire
    have.

    Few is at most a third (isolated_share) of the square that reaches 3 pixels (isolated_reach_pixels) each way. Where
    there are more, depth is noise, as with motion blur, or a thicket: there probes find the errors.
    """
    if not pixels.any():
        return pixels
    reach = TUNING.isolated_reach_pixels
    return pixels & (count_within(pixels, reach) <= TUNING.isolated_share * (2 * reach + 1) ** 2)


def target_pixels(
    pixels: NDArray[np.bool_], depth: NDArray[np.float32], source: Camera, target: Camera, warp: Warp
) -> NDArray[np.bool_]:
    """Return (H, W) target pixels in which the centres of the set source `pixels` (H, W) land and nothing hides them.

    depth (H, W) is the source's; `warp` is the map of what was drawn, which hides a centre where it is nearer.
    """
    result = np.zeros(warp.nearness.shape, bool)
    rows, columns = np.nonzero(pixels)
    x, y, away = target_px_from_source_px(source, target, columns + 0.5, rows + 0.5, depth[rows, columns])
    with np.errstate(invalid="ignore"):
        within = np.nonzero((x >= 0.0) & (x < target.width) & (y >= 0.0) & (y < target.height))[0]
    j, i = x[within].astype(np.intp), y[within].astype(np.intp)
    seen = target.nearness_from_depth(away[within]) >= warp.nearness[i, j]
    result[i[seen], j[seen]] = True
    return result


def thin_things(
    length: NDArray[np.float32],
    depth: NDArray[np.float32],
    camera: PerspectiveCamera,
    other: Camera,
    *,
    edges: NDArray[np.bool_],
    clip_start: float,
) -> NDArray[np.bool_]:
    """Return (H, W) pixels of `camera` in which something thin is nearer than their depth (H, W) says.

    With them come the pixels over which it moves in the view of `other`, away from the surface behind it. length (H, W)
    is LENGTH_PASS: the mean length of a pixel's rays, counted from the depth clip_start. edges (H, W) are pixels at a
    step in depth: they are flagged for that, and left out here.
    """
    behind = depth.astype(np.float64)
    surface = np.isfinite(behind)
    before = np.where(surface, behind - depth_from_ray_length(camera, length, clip_start), 0.0)

    def moves(covered: float) -> NDArray[np.float64]:
        """Return (H, W) pixels by which a thing that covers this share of a pixel moves from the surface behind it."""
        nearness = camera.nearness_from_depth(np.maximum(behind - before / covered, clip_start + 1e-6))
        return (nearness - camera.nearness_from_depth(behind)) * disparity_per_nearness(camera, other)

    found = moves(1.0) > TUNING.thin_step_pixels
    # Nothing is known beyond the frame, and to 4.5 a sample of the sky is one right before the camera.
    thick = TUNING.surface_reach_pixels
    surfaces = ~dilate(~np.pad(found, thick), thick)[thick:-thick, thick:-thick]
    found &= ~dilate(surfaces, thick + 1) & ~edges & ~dilate(~surface, 1)
    reach = np.where(found, np.minimum(np.ceil(moves(TUNING.least_covered_share)), TUNING.max_search_pixels), 0.0)
    result = found.copy()
    to_the_left = target_from_source(camera, other)[0, 3] < 0.0
    for aside in range(1, TUNING.max_search_pixels + 1):
        moved = reach >= aside
        if to_the_left:
            result[:, :-aside] |= moved[:, aside:]
        else:
            result[:, aside:] |= moved[:, :-aside]
    return result
