"""Flat mirrors: what one shows is warped with the depth of its image, and not of its surface.

The image that a flat mirror shows stands still: as far behind it as what it is of stands before it, for either eye. So
a second warp, which has the depth of that image in place of the mirror's, warps what the mirror shows as exactly as
the first one warps a wall, with holes of its own where the one eye looks farther around what is reflected. What is no
colour (the mirror's own depth, normal, index) stays with the first; dust on the glass goes with the image.

How far the image stands Cycles tells by what it gives a denoiser for depth: the mean length of the rays on their way
over all mirrors, each part of it times what the mirrors before it reflect. What is curved or bumpy has its image
elsewhere, and from what is rough rays go on by a part that is not known: those stay with their surface, as what is seen
through glass does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..images.effects import Effect
from ..images.effects_pass import materials_of, shows
from ..images.lookup import lookup
from ..images.masks import dilate
from ..images.passes import (
    DEPTH_PASS,
    LENGTH_PASS,
    MATERIAL_PASS,
    REFLECTANCE_PASS,
    ROUGHNESS_PASS,
    SURFACE_NORMAL_PASS,
    Passes,
)
from ..views.camera import PerspectiveCamera, depth_from_ray_length
from .forward import Warp
from .tuning import TUNING


@dataclass(frozen=True)
class Images:
    """The images that a source's flat mirrors show.

    mirrors (H, W) are the pixels of flat mirrors. depth (H, W) is there the depth of the image behind the mirror, +inf
    where it shows the sky; in all other pixels it is the source's own depth.
    """

    mirrors: NDArray[np.bool_]
    depth: NDArray[np.float32]


def images_in_mirrors(source: Passes, camera: PerspectiveCamera, *, clip_start: float) -> Images | None:
    """Return the images in a source's flat mirrors; None where no such mirror is seen or the passes do not tell.

    source holds depth, MATERIAL_PASS and SOURCE_ONLY_PASSES, of which the roughness may be missing. clip_start is the
    depth at which the camera clips its rays, in scene units.
    """
    shown = materials_of(source)
    if shown is None or not {LENGTH_PASS, REFLECTANCE_PASS, SURFACE_NORMAL_PASS} <= set(source):
        return None
    depth = source[DEPTH_PASS][..., 0].astype(np.float64)
    reflectance = source[REFLECTANCE_PASS].mean(axis=-1)
    may_be = (
        np.isfinite(depth)
        & (depth > 0.0)
        & (reflectance >= TUNING.least_reflectance)
        & ~shows(source, Effect.TRANSMISSION)
    )
    if ROUGHNESS_PASS in source:
        may_be &= source[ROUGHNESS_PASS][..., 0] <= TUNING.max_roughness
    depth = np.where(may_be, depth, 1.0)
    straight = depth_from_ray_length(camera, source[LENGTH_PASS][..., 0], clip_start)
    behind = np.where(may_be, np.maximum(straight - depth, 0.0) / np.where(may_be, reflectance, 1.0), 0.0)
    goes_on = behind > TUNING.image_distance_share * depth
    pixels = np.bincount(shown.ravel())
    mostly = np.bincount(shown.ravel(), weights=goes_on.ravel()) >= TUNING.mirror_pixels_share * pixels
    nothing = behind <= TUNING.nothing_behind_share * depth
    mirrors = _flat(source[SURFACE_NORMAL_PASS], mostly[shown] & may_be, np.where(nothing, 1.0, behind / depth), camera)
    large = np.bincount(shown.ravel(), weights=mirrors.ravel()) >= TUNING.least_mirror_share * depth.size
    mirrors &= large[shown]
    if not mirrors.any():
        return None
    image = np.where(nothing, np.inf, depth + behind)
    return Images(mirrors, np.where(mirrors, image, source[DEPTH_PASS][..., 0]).astype(np.float32))


def _flat(
    normal: NDArray[np.float32], mirrors: NDArray[np.bool_], behind: NDArray, camera: PerspectiveCamera
) -> NDArray[np.bool_]:
    """Return (H, W) those pixels of `mirrors` (H, W) in which the mirror is flat enough for the image that it shows.

    normal (H, W, 3) is the surface's. behind (H, W) is how far behind the mirror the image stands, as a multiple of the
    mirror's depth: the farther, the flatter must the mirror be. On a ball of radius r at the distance d, the normal
    turns by 2 t d / r over a step of the tangent t to either side; that is compared. A flat part must be two steps long
    both ways, so that a mirror's bevelled edge is none.
    """
    height, width = mirrors.shape
    step = max(round(TUNING.flatness_step_share * width), 2)
    plane = camera.plane
    result = mirrors
    for axis, tangent in ((1, (plane.right - plane.left) / width), (0, (plane.top - plane.bottom) / height)):
        straight = np.zeros_like(mirrors)
        line, middle, far = (np.moveaxis(image, axis, 0) for image in (normal, straight, behind))
        whole = np.moveaxis(mirrors, axis, 0)
        if line.shape[0] > 2 * step:
            turn = np.linalg.norm(line[2 * step :] - line[: -2 * step], axis=-1)
            within = whole[2 * step :] & whole[step:-step] & whole[: -2 * step]
            bent = (turn - TUNING.normal_rounding) * far[step:-step]
            middle[step:-step] = within & (bent <= 2.0 * TUNING.max_curvature * step * tangent)
        result = result & dilate(straight, step, axes=(axis,))
    return result


def seen_in_both(source: Passes, images: Images, once: Warp, again: Warp) -> tuple[NDArray[np.bool_], ...]:
    """Return (H, W) the target pixels in which the map `once` shows a mirror, and those in which `again` shows the same
    one too.

    once is the map by which surfaces are warped, again the one by which the images in mirrors are. Materials and
    normals tell whether it is the same mirror: where two mirrors meet, the image in the one would be seen in the other.
    """
    mask = images.mirrors[..., None].astype(np.float32)
    within = lookup(mask, again.x, again.y)[..., 0] >= TUNING.least_mirror_weight
    what = np.concatenate([source[SURFACE_NORMAL_PASS], source[MATERIAL_PASS], mask], axis=-1)
    one, other = (lookup(what, warp.x, warp.y, interpolation="nearest") for warp in (once, again))
    parallel = np.linalg.norm(one[..., :3] - other[..., :3], axis=-1) <= TUNING.max_normal_difference
    shown = one[..., 4] > 0.0
    return shown, shown & within & parallel & (one[..., 3] == other[..., 3])
