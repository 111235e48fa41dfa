"""Made-up scenes for the warp stage: what a renderer would hand over of them, and the two eyes that see them.

They are pictures with a depth, not geometry: any size costs no render, and the same size is the same scene each time.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS, Passes
from stereo_reproject.views.camera import PerspectiveCamera, ViewPlane
from stereo_reproject.views.panorama import PanoramicCamera
from stereo_reproject.views.projections import Equirectangular, FisheyeEquidistant, Projection
from stereo_reproject.views.spherical import SphericalStereo

INTEROCULAR, CONVERGENCE = 0.065, 3.0
VIEW_ANGLE = np.radians(60.0)
"""Of the picture's width."""

_HALF, _WHOLE = (-np.pi / 2, np.pi / 2), (-np.pi, np.pi)
PANORAMAS: dict[str, tuple[Projection, bool]] = {
    "vr180": (Equirectangular(_HALF, _HALF), True),
    "vr180, two lenses": (Equirectangular(_HALF, _HALF), False),
    "vr360": (Equirectangular(_WHOLE, _HALF), True),
    "vr360, two lenses": (Equirectangular(_WHOLE, _HALF), False),
    "fisheye": (FisheyeEquidistant(np.pi), True),
    "fisheye, two lenses": (FisheyeEquidistant(np.pi), False),
}
"""By name, a projection, and whether its eyes are those of spherical stereo. Equirectangular ones that are have rows
that match; all others are drawn quad by quad."""

POSTS = 24
SEED = 5


def eyes(width: int, height: int, mode: str = "off-axis") -> tuple[PerspectiveCamera, PerspectiveCamera]:
    """The source's and the target's camera: off-axis, whose rows correspond, or toe-in, where the target is turned."""
    half_x = np.tan(0.5 * VIEW_ANGLE)
    half_y = half_x * height / width
    plane = ViewPlane(-half_x, half_x, -half_y, half_y)
    shift = INTEROCULAR / CONVERGENCE
    world_from_target = np.eye(4)
    world_from_target[0, 3] = INTEROCULAR
    seen = ViewPlane(-half_x - shift, half_x - shift, -half_y, half_y)
    if mode == "toe-in":
        cosine, sine = 1.0 / np.hypot(1.0, shift), shift / np.hypot(1.0, shift)
        world_from_target[:3, :3] = ((cosine, 0.0, sine), (0.0, 1.0, 0.0), (-sine, 0.0, cosine))
        seen = plane
    return (
        PerspectiveCamera(width, height, np.eye(4), plane),
        PerspectiveCamera(width, height, world_from_target, seen),
    )


def panoramic_eyes(width: int, height: int, kind: str) -> tuple[PanoramicCamera, PanoramicCamera]:
    """The source's and the target's camera, one of PANORAMAS: two eyes of spherical stereo, or two plain lenses."""
    projection, spherical = PANORAMAS[kind]
    eyes = []
    for offset in (-0.5 * INTEROCULAR, 0.5 * INTEROCULAR):
        place, stereo = np.eye(4), SphericalStereo(offset, CONVERGENCE)
        if not spherical:
            place[0, 3], stereo = offset, None
        eyes.append(PanoramicCamera(width, height, place, ViewPlane(0.0, 1.0, 0.0, 1.0), projection, stereo))
    return eyes[0], eyes[1]


def room(width: int, height: int) -> Passes:
    """The passes of a wavy back wall, a floor and two dozen posts of different depth, all in colours of pure noise.

    What is hard for a warp is all there: silhouettes as long as those of a furnished room, and steps in most cells.
    """
    rng = np.random.default_rng(SEED)
    u, v = _places(width, height)
    depth = 5.0 + 0.3 * np.sin(9.0 * u) + 0.3 * np.cos(7.0 * v)
    depth = np.where(v > 0.55, np.minimum(depth, 0.45 / np.maximum(v - 0.5, 1e-3)), depth)
    for _ in range(POSTS):
        left, wide, high, near = rng.uniform(0, 1), rng.uniform(0.004, 0.05), rng.uniform(0.2, 0.8), rng.uniform(1.5, 4)
        depth = np.where((u > left) & (u < left + wide) & (v > high), np.minimum(depth, near), depth)
    return _passes(rng.random((height, width, 4), np.float32), depth)


def smooth(width: int, height: int) -> Passes:
    """The passes of one gently curved surface with a fine texture: what the adaptive grid is for.

    From a few hundred pixels of width on, the depths in most cells differ by less than an arc minute of parallax.
    """
    u, v = _places(width, height)
    depth = 4.0 + 0.3 * np.sin(3.0 * u) + 0.2 * np.cos(2.5 * v)
    colour = np.ones((height, width, 4), np.float32)
    for channel, (across, down) in enumerate(((90.0, 40.0), (55.0, 75.0), (130.0, 20.0))):
        colour[..., channel] = 0.5 + 0.3 * np.sin(across * u) * np.cos(down * v)
    colour[..., :3] += np.random.default_rng(SEED).random((height, width, 3), np.float32) * np.float32(0.1)
    return _passes(colour, depth)


def _places(width: int, height: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(H, W) each: how far along the picture's width and height a pixel is, from 0 to 1."""
    y, x = np.mgrid[0:height, 0:width]
    return x / width, y / height


def _passes(colour: NDArray[np.float32], depth: NDArray[np.float64]) -> Passes:
    return {COLOUR_PASS: colour, DEPTH_PASS: depth.astype(np.float32)[..., None]}


SCENES: dict[str, Callable[[int, int], Passes]] = {"room": room, "smooth": smooth}
"""By name, what makes the passes of width and height."""
