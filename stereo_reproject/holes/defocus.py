"""Edges out of focus: a blurred foreground mixes with what is behind it far beyond the pixels beside the edge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..images.contrast import Contrast
from ..views.camera import Camera, PerspectiveCamera
from ..views.frustum import Lens
from ..warp.discontinuities import DepthDiscontinuities
from .tuning import TUNING


def circle_of_confusion(depth: NDArray, camera: Camera, lens: Lens) -> NDArray[np.float32]:
    """Return (H, W) the radius, in pixels, to which the lens blurs a point at this depth (H, W).

    It is 0 without an aperture and for cameras that are not perspective.
    """
    if lens.aperture <= 0.0 or not isinstance(camera, PerspectiveCamera):
        # One number, which takes no memory; it cannot be written.
        return np.broadcast_to(np.float32(0.0), depth.shape)
    plane = camera.plane
    pixels_per_slope = max(camera.width / (plane.right - plane.left), camera.height / (plane.top - plane.bottom))
    with np.errstate(divide="ignore", invalid="ignore"):
        blur = lens.aperture * np.abs(1.0 / depth - 1.0 / lens.focus) * pixels_per_slope
    return np.nan_to_num(blur, nan=0.0, posinf=TUNING.blur_reach_pixels[-1]).astype(np.float32)


def blurred_edges(
    steps: DepthDiscontinuities,
    radius: NDArray[np.float32],
    gradient: NDArray[np.float32],
    contrast: Contrast,
    *,
    threshold: float,
    tolerance: float,
) -> NDArray[np.bool_]:
    """Return (H, W) pixels that an edge's blur reaches and whose warped colour is off by more than the noise.

    An edge is a step in disparity above `threshold` pixels. radius (H, W) is that of the blur at the nearer side, in
    pixels. gradient (H, W) is the change of colour from a pixel to the next: a point seen near the edge is off by up to
    half of the step, and so the colour by that much of its gradient. contrast has the noise; tolerance is in its
    standard deviations.
    """
    edges = steps.mask(threshold) & (radius >= TUNING.least_blur_pixels)
    if not edges.any():
        return edges
    step = np.where(edges, np.minimum(_largest_step(steps), 2.0 * radius), 0.0)
    reached = np.zeros_like(step)
    below = 0.0
    for reach in TUNING.blur_reach_pixels:
        among = (radius > below) & ((radius <= reach) if reach != TUNING.blur_reach_pixels[-1] else True)
        if (edges & among).any():
            reached = np.maximum(reached, _spread(np.where(among, step, 0.0), reach))
        below = reach
    error = (TUNING.misplaced_share * reached * gradient) ** 2
    return (reached > 0.0) & (error > np.maximum(tolerance**2 * contrast.noise, TUNING.unseen_difference**2))


def _largest_step(steps: DepthDiscontinuities) -> NDArray[np.float32]:
    """Return (H, W) the largest step in disparity that a pixel, or one of the eight around it, has to any of its
    neighbours."""
    height, width = steps.right.shape[0], steps.down.shape[1]
    result = np.zeros((height, width), np.float32)
    result[:, :-1] = steps.right
    result[:, 1:] = np.maximum(result[:, 1:], steps.right)
    result[:-1] = np.maximum(result[:-1], steps.down)
    result[1:] = np.maximum(result[1:], steps.down)
    return _spread(result, 1)


def _spread(image: NDArray, reach: int) -> NDArray:
    """Return (H, W) the largest value of an image (H, W) in the square that reaches `reach` pixels each way around each
    pixel."""
    for axis in (0, 1):
        result, have = np.moveaxis(image, axis, 0), 0
        while have < reach:
            shift = min(have + 1, reach - have)
            result, have = np.maximum(result, np.maximum(_moved(result, shift), _moved(result, -shift))), have + shift
        image = np.moveaxis(result, 0, axis)
    return image


def _moved(image: NDArray, shift: int, fill: float = -np.inf) -> NDArray:
    """Return the image (H, ...) with its rows moved down by `shift` (up, if negative); the rows left over have
    `fill`."""
    result = np.full_like(image, fill)
    if abs(shift) < len(image):
        result[max(shift, 0) : len(image) + min(shift, 0)] = image[max(-shift, 0) : len(image) + min(-shift, 0)]
    return result


def nearer_side(blur: NDArray[np.float32], disparity: NDArray) -> NDArray[np.float32]:
    """Return (H, W) the blur (H, W) of the nearest of five pixels: the pixel itself and its four neighbours.

    The nearest is the one of largest disparity (H, W); one whose disparity is not finite does not count.
    """
    near = np.where(np.isfinite(disparity), disparity, -np.inf)
    nearest, result = near.copy(), blur.copy()
    for axis in (0, 1):
        for shift in (1, -1):
            beside, its_blur = (np.moveaxis(_moved(np.moveaxis(a, axis, 0), shift), 0, axis) for a in (near, blur))
            nearer = beside > nearest
            nearest, result = np.where(nearer, beside, nearest), np.where(nearer, its_blur, result)
    return result


def in_focus(steps: DepthDiscontinuities, blur: NDArray[np.float32]) -> DepthDiscontinuities:
    """Return the steps, made smaller where they lie out of focus, so that a blurred slope is not taken for an edge.

    A depth is that of one ray through the lens. It belongs to a point up to as many pixels away as the circle of
    confusion's radius, blur (H, W), so the slope of a surface makes steps of it.
    """
    if not blur.any():
        return steps
    right = 1.0 + np.maximum(blur[:, 1:], blur[:, :-1])
    down = 1.0 + np.maximum(blur[1:], blur[:-1])
    return DepthDiscontinuities((steps.right / right).astype(np.float32), (steps.down / down).astype(np.float32))
