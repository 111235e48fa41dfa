"""Flat mirrors: what one shows is carried with the depth of its image, and not of its surface.

The image that a flat mirror shows stands still: as far behind it as what it is of stands before it, for either eye. So
a second warp, which has the depth of that image in place of the mirror's, carries what the mirror shows as exactly as
the first one carries a wall, with holes of its own where the one eye looks farther around what is reflected. What is no
colour (the mirror's own depth, normal, index) stays with the first.

How far the image stands Cycles tells by what it gives a denoiser for depth: the mean length of the rays on their way
over all mirrors, each part of it times what the mirrors before it reflect. What is curved has its image elsewhere, and
what is rough has none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .camera import PerspectiveCamera, ray_length_per_depth
from .effects_pass import materials_of
from .masks import dilate
from .passes import DEPTH_PASS, LENGTH_PASS, REFLECTANCE_PASS, Passes

BEHIND = 0.1
"""How much farther than its surface, as a share of that depth, the image in a mirror stands at least."""

MOSTLY = 0.5
"""Share of the pixels of a material whose rays go on, from which it is a mirror: where they meet nothing, they do not
get longer."""

LEAST = 5e-4
"""Share of the picture that a material's flat mirrors have at least, to be worth the holes around what they show."""

DARKEST = 0.2
"""What a mirror reflects at least: with less, the length of its rays says too little."""

FLAT_STEP, FLAT = 0.005, 0.02
"""How far to either side, as a share of the width, it is looked whether a surface is flat, and how bent it may be: the
distance of what is reflected over the mirror's radius, at most."""

WITHIN = 0.98
"""Share of a looked-up colour that must come from the mirror."""


@dataclass(frozen=True)
class Images:
    """What mirrors show: (H, W) the source's pixels that do, and the depth at which its image stands, +inf for sky."""

    mirrors: NDArray[np.bool_]
    depth: NDArray[np.float32]


def images_in_mirrors(source: Passes, camera: PerspectiveCamera, *, clip_start: float) -> Images | None:
    """What mirrors show, None where none is seen or where the passes do not tell.

    source holds depth, passes.LENGTH_PASS, passes.REFLECTANCE_PASS and the materials.
    """
    shown, length = materials_of(source), source.get(LENGTH_PASS)
    if shown is None or length is None or REFLECTANCE_PASS not in source:
        return None
    depth = source[DEPTH_PASS][..., 0].astype(np.float64)
    surface = np.isfinite(depth) & (depth > 0.0)
    columns, rows = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    straight = length[..., 0] / ray_length_per_depth(camera, columns, rows) + clip_start
    reflectance = source[REFLECTANCE_PASS].mean(axis=-1)
    bright = surface & (reflectance >= DARKEST)
    behind = np.zeros_like(depth)
    behind[bright] = np.maximum(straight[bright] - depth[bright], 0.0) / reflectance[bright]
    goes_on = bright & (behind > BEHIND * np.where(bright, depth, 0.0))
    pixels = np.bincount(shown.ravel())
    mostly = np.bincount(shown.ravel(), weights=goes_on.ravel()) >= MOSTLY * pixels
    mirrors = _flat(depth, mostly[shown] & bright, behind, camera)
    mirrors &= (np.bincount(shown.ravel(), weights=mirrors.ravel()) >= LEAST * depth.size)[shown]
    if not mirrors.any():
        return None
    image = np.where(goes_on, depth + behind, np.inf)
    return Images(mirrors, np.where(mirrors, image, depth).astype(np.float32))


def _flat(depth: NDArray, mirrors: NDArray[np.bool_], behind: NDArray, camera: PerspectiveCamera) -> NDArray[np.bool_]:
    """(H, W): pixels of flat parts of the mirrors (H, W): flat enough for an image so far `behind` (H, W).

    1 / depth is linear over the picture on any plane. On a ball of the radius r it bends by t^2 / r over a step of the
    tangent t to either side. A part is as long as two steps along both axes: so a mirror's bevelled edge is none.
    """
    height, width = depth.shape
    step = max(round(FLAT_STEP * width), 2)
    plane = camera.plane
    nearness = np.divide(1.0, depth, out=np.full_like(depth, np.nan), where=mirrors)
    result = mirrors
    for axis, tangent in ((1, (plane.right - plane.left) / width), (0, (plane.top - plane.bottom) / height)):
        straight = np.zeros_like(mirrors)
        line, middle = np.moveaxis(nearness, axis, 0), np.moveaxis(straight, axis, 0)
        if line.shape[0] > 2 * step:
            bend = np.abs(line[2 * step :] - 2.0 * line[step:-step] + line[: -2 * step])
            middle[step:-step] = bend * np.moveaxis(behind, axis, 0)[step:-step] <= FLAT * (step * tangent) ** 2
        result = result & dilate(straight, step, axes=(axis,))
    return result
