"""Warped views of several sources made into one: for each target pixel, the source that answers for it best.

1. The nearest surface wins: a source that sees something clearly nearer knows of an occluder that the others miss. A
   source shows the same point as that surface if it has it where the point must be in its own picture.
2. Of sources that show the same point, one without a flag goes before one with a flag.
3. Of those, the one with the smallest expected error of the lookup wins: the angle between the two rays that see the
   point, by which whatever depends on the view may differ, times the stretch, which blurs.

A pixel on which one source alone lands is that one's, so one source covers the holes of another. Where none lands, the
pixel is disoccluded if any source says so, else outside. A surface that a source sees too obliquely to draw it is a
hole of that source, which hides nothing in the others.

NumPy's and a GPU's views are merged by the same code.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..images.bands import bands
from ..images.passes import Passes
from ..images.reasons import Reason
from ..views.camera import Camera, target_px_from_source_px
from ..views.parallax import ARC_MINUTE
from ..views.view import View
from .forward import Warp
from .rendered_view import RenderedView
from .tuning import TUNING
from .warped_view import WarpedView


def merge_views(
    views: Sequence[WarpedView], flags: Sequence[NDArray[np.uint16]], sources: Sequence[RenderedView], target: View
) -> WarpedView:
    """Return one view of the target made of the warped views of several sources; a single view is returned as it is.

    Each pixel is taken whole from one source: the one that shows the nearest surface; of several that show it, one
    without a flag; of those, the one with the smallest expected error. Where errors are nearly equal, the earlier
    source wins. views, flags and sources have one entry for each source, in the same order; the result's map names
    sources by that number. flags (H, W) are the `Reason` flags of pixels for which a view does not answer, at least
    `WarpedView.empty`. The result has the passes that all views have, the grid of the first one, and neither steps nor
    sharpness.
    """
    if len(views) == 1:
        return views[0]
    warps = [view.warp for view in views]
    index = best_source(warps, flags, [source.camera for source in sources], target.camera)
    x, y, nearness = (of_chosen(index, [getattr(warp, name) for warp in warps]) for name in ("x", "y", "nearness"))
    warp = Warp(x, y, nearness, index)
    shared = [name for name in views[0].passes if all(name in view.passes for view in views)]
    passes: Passes = {name: of_chosen(index, [view.passes[name] for view in views]) for name in shared}
    by = "gpu" if all(view.by == "gpu" for view in views) else "numpy"
    empty = merged_flags([view.empty for view in views], warp)
    return replace(views[0], passes=passes, warp=warp, empty=empty, steps=None, sharpness=None, by=by)


def of_chosen(index: NDArray[np.uint8], images: Sequence[NDArray]) -> NDArray:
    """Return (H, W, ...) each pixel from one of several images (H, W, ...): the one whose number index (H, W) has
    there."""
    result = images[0].copy()
    for number, image in enumerate(images[1:], start=1):
        chosen = index == number
        result[chosen] = image[chosen]
    return result


def merged_flags(flags: Sequence[NDArray[np.uint16]], warp: Warp) -> NDArray[np.uint16]:
    """Return (H, W) the `Reason` flags that each pixel has in its own source, by the merged map `warp`.

    flags (H, W) are those of each source. Where no source lands it is DISOCCLUDED if any of them says so, else OUTSIDE.
    """
    result = of_chosen(warp.source, flags)
    unseen = ~warp.covered
    disoccluded = np.any([each[unseen] & Reason.DISOCCLUDED.bit for each in flags], axis=0)
    result[unseen] = np.where(disoccluded, Reason.DISOCCLUDED.bit, Reason.OUTSIDE.bit)
    return result


def best_source(
    warps: Sequence[Warp], flags: Sequence[NDArray[np.uint16]], cameras: Sequence[Camera], target: Camera
) -> NDArray[np.uint8]:
    """Return (H, W) the number of the source that answers best for each target pixel, by this module's rules; 0 where
    none lands.

    warps, flags (`Reason` flags (H, W)) and cameras have one entry for each source.
    """
    nearest = np.maximum.reduce([warp.nearness for warp in warps])
    shown = [_shows(warp, nearest, camera, target) for warp, camera in zip(warps, cameras, strict=True)]
    clean = [mask & (flag == 0) for mask, flag in zip(shown, flags, strict=True)]
    any_clean = np.logical_or.reduce(clean)
    best = np.full(nearest.shape, np.inf, np.float32)
    index = np.zeros(nearest.shape, np.uint8)
    for number, (warp, camera) in enumerate(zip(warps, cameras, strict=True)):
        answers = np.where(any_clean, clean[number], shown[number])
        error = np.where(answers, expected_error(warp, camera, target), np.inf)
        better = error < (1.0 - TUNING.least_gain_share) * best
        np.copyto(best, error, where=better)
        index[better] = number
    return index


def _shows(warp: Warp, nearest: NDArray[np.float32], source: Camera, target: Camera) -> NDArray[np.bool_]:
    """Return (H, W) whether a source shows the nearest point that any source shows in each target pixel, to a
    tolerance.

    warp is this source's map; nearest (H, W) is the nearness of that point to the target's camera.
    """
    result = warp.covered & (warp.nearness == nearest)
    for rows in bands(result.shape):
        place_rows, columns = np.mgrid[rows.start + 0.5 : rows.stop, 0.5 : result.shape[1]]
        covered = warp.covered[rows]
        depth = target.depth_from_nearness(np.where(covered, nearest[rows], 1.0).astype(np.float64))
        x, y, _ = target_px_from_source_px(target, source, columns, place_rows, depth)
        with np.errstate(invalid="ignore"):
            apart = np.hypot(x - warp.x[rows], y - warp.y[rows])
        # NaN, of a point behind the source, is no such place.
        result[rows] |= covered & (apart <= TUNING.same_point_pixels)
    return result


def expected_error(warp: Warp, source: Camera, target: Camera) -> NDArray[np.float32]:
    """Return (H, W) the error to be expected where the target is looked up in a source, in no unit: only to compare
    sources.

    It is the angle, in radians, between the rays of both that see the point, times the stretch. An angle below an arc
    minute counts as one, because nobody sees the difference.
    """
    angle = np.empty(warp.x.shape, np.float32)
    for rows in bands(angle.shape):
        angle[rows] = _angle_between_rays(warp.x[rows], warp.y[rows], rows.start, source, target)
    return np.maximum(angle, np.float32(ARC_MINUTE)) * _stretch(warp.x, warp.y)


def _angle_between_rays(x: NDArray, y: NDArray, first_row: int, source: Camera, target: Camera) -> NDArray:
    """Return (h, W) the angle, in radians, between the ray of each target pixel and that of its place in the source.

    x, y (h, W) are the places in the source, for rows of the target from first_row on. It is computed as the chord,
    which for small angles is as long as the angle.
    """
    rows, columns = np.mgrid[first_row + 0.5 : first_row + x.shape[0], 0.5 : x.shape[1]]
    one, other = _unit_rays(target, columns, rows), _unit_rays(source, x.astype(np.float64), y.astype(np.float64))
    return np.sqrt(sum(np.square(a - b) for a, b in zip(one, other, strict=True)))


def _unit_rays(camera: Camera, x: NDArray, y: NDArray) -> list[NDArray]:
    """Return x, y and z (h, W), in the world, of the unit directions of the rays through pixel positions x, y (h,
    W)."""
    _, direction = camera.ray_from_px(x, y)
    length = np.sqrt(sum(np.square(part) for part in direction))
    turn = camera.world_from_camera[:3, :3]
    return [sum(turn[k, i] * direction[i] for i in range(3)) / length for k in range(3)]


def _stretch(x: NDArray[np.float32], y: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (H, W) the number of target pixels, by area, that one source pixel is stretched to: from 1 to max_stretch.

    x, y (H, W) are the places in the source. The area follows from the distance between those of a target pixel and of
    its neighbours in row and column. Of the two neighbours in each the nearer place counts, since a step in depth lies
    before the other.
    """
    across_x, across_y = _step_across(x, y)
    down_x, down_y = (part.T for part in _step_across(x.T, y.T))
    area = np.abs(across_x * down_y - across_y * down_x)
    # A pixel without a neighbour tells nothing of its stretch.
    return (1.0 / np.clip(np.nan_to_num(area, nan=1.0), 1.0 / TUNING.max_stretch, 1.0)).astype(np.float32)


def _step_across(x: NDArray[np.float32], y: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return (H, W) the changes of x and of y between a pixel and one of its two neighbours in the row.

    x, y (H, W) are places in the source. The neighbour whose place is nearer is taken; the change is to the next pixel,
    or from the last one. NaN where neither neighbour has a place.
    """
    edge = np.full((x.shape[0], 1), np.nan, np.float32)
    change_x, change_y = np.diff(x, axis=1), np.diff(y, axis=1)
    far = np.hypot(change_x, change_y)
    to_next, from_last = np.hstack([far, edge]), np.hstack([edge, far])
    take_next = np.isnan(from_last) | (to_next < from_last)
    step_x, step_y = (
        np.where(take_next, np.hstack([change, edge]), np.hstack([edge, change])) for change in (change_x, change_y)
    )
    return step_x, step_y
