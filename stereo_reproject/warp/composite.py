"""The target's passes: looked up in the source by the map of a warp, and replaced where they were traced."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..images.bands import bands
from ..images.grain import choice_of, chosen_pixels, ruled_by_noise
from ..images.lookup import lookup
from ..images.passes import (
    COLOUR_PASS,
    DEPTH_PASS,
    POSITION_PASS,
    SOURCE_ONLY_PASSES,
    VECTOR_PASS,
    Passes,
    filtered,
    is_essential,
    known_depth,
)
from ..images.sharpness import Sharpness, pixel_noise, sharpness_of
from ..views.camera import Camera, goes_round, is_planar, target_from_source, target_px_from_source_px
from ..views.view import View
from .forward import Warp
from .motion import warp_motion
from .options import MIXED, WarpOptions
from .rendered_view import RenderedView
from .scanline import row_law_of

LookUp = Callable[[NDArray[np.float32], str], NDArray[np.float32]]
"""Function that returns a pass (H, W, C) of the source as the target sees it, (h, w, C), by the interpolation of this
name."""


@dataclass(frozen=True)
class PassesSeen:
    """The source's passes (H, W, C) as the target sees them.

    sharpness is that of the colour where light was looked up with the adaptive interpolation; None where nothing was.
    """

    passes: Passes
    sharpness: Sharpness | None = None


def warp_passes(source: RenderedView, target: View, warp: Warp, options: WarpOptions) -> PassesSeen:
    """Return the source's passes as the target sees them, looked up with NumPy; 0 (depth: +inf) where nothing landed.

    `warp` is the map that says which place of the source each target pixel shows. SOURCE_ONLY_PASSES are left out.
    """
    seen = target_depth(source.passes[DEPTH_PASS], warp, source.camera, target.camera)

    def look_up(image: NDArray[np.float32], how: str) -> NDArray[np.float32]:
        return lookup(image, warp.x, warp.y, interpolation=how, wraps=source.wraps)

    return passes_seen(source, target, warp, seen, look_up, options)


def passes_seen(
    source: RenderedView,
    target: View,
    warp: Warp,
    seen: NDArray[np.float32],
    look_up: LookUp,
    options: WarpOptions,
) -> PassesSeen:
    """Return the source's passes as the target sees them, as `warp_passes` does, but with a lookup of any kind.

    seen (H, W) is the depth that the target sees. look_up reads a pass of the source by the map `warp`, on a GPU, say.
    Depth, position and motion vectors are computed anew. SOURCE_ONLY_PASSES are left out.
    """
    warped: Passes = {}
    look_up_light, sharpness = _light_lookup(source, warp, look_up, options)
    if options.interpolation_of(COLOUR_PASS) == "grained" and sharpness is not None:
        linear = look_up(source.passes[COLOUR_PASS], "linear")
        look_up_light, sharpness = _with_grain(source, target.name, warp, linear, look_up_light, sharpness)
    for name, image in source.passes.items():
        if name == DEPTH_PASS:
            warped[name] = seen[..., None]
        elif name == POSITION_PASS:
            warped[name] = _target_position(image, seen, warp, target.camera)
        elif name == VECTOR_PASS:
            depth = source.passes[DEPTH_PASS]
            warped[name] = warp_motion(image, depth, warp, source.view.moving, target.moving, seen)
        elif name not in SOURCE_ONLY_PASSES:
            how = options.interpolation_of(name)
            warped[name] = look_up_light(image) if how in MIXED else look_up(image, how)
    return PassesSeen(warped, sharpness)


def _light_lookup(
    source: RenderedView, warp: Warp, look_up: LookUp, options: WarpOptions
) -> tuple[Callable[[NDArray[np.float32]], NDArray[np.float32]], Sharpness | None]:
    """Return the adaptive lookup of a light pass (H, W, C), and its sharpness for the colour.

    All light has the colour's share of the cubic lookup, so that its parts still add up. The sharpness is None where
    the options ask for no adaptive lookup of the colour.
    """
    if options.interpolation_of(COLOUR_PASS) not in MIXED:
        return lambda image: look_up(image, options.interpolation), None
    colour, wraps = source.passes[COLOUR_PASS], source.wraps
    linear, cubic = look_up(colour, "linear"), look_up(colour, "cubic")
    sharpness = sharpness_of(pixel_noise(colour, wraps=wraps), linear, cubic, warp.x, warp.y, wraps=wraps)

    def mixture(once: NDArray[np.float32], again: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return (h, w, C) the mixture of a linear and a cubic lookup, which takes the place of the first."""
        for rows in bands(once.shape):
            once[rows] += sharpness.cubic[rows][..., None] * (again[rows] - once[rows])
        return once

    mixed = mixture(linear, cubic)

    def look_up_light(image: NDArray[np.float32]) -> NDArray[np.float32]:
        return mixed if image is colour else mixture(look_up(image, "linear"), look_up(image, "cubic"))

    return look_up_light, sharpness


def _with_grain(
    source: RenderedView,
    name: str,
    warp: Warp,
    linear: NDArray[np.float32],
    look_up_light: Callable[[NDArray[np.float32]], NDArray[np.float32]],
    sharpness: Sharpness,
) -> tuple[Callable[[NDArray[np.float32]], NDArray[np.float32]], Sharpness]:
    """Return the lookup of a light pass and its sharpness with single pixels of the source where noise rules.

    name is the target's; linear (h, w, C) is the linear lookup of the colour. All light has the colour's choice.
    """
    x, y = chosen_pixels(warp.x, warp.y, choice_of(name, linear.shape[:2]))

    def chosen(image: NDArray[np.float32]) -> NDArray[np.float32]:
        return lookup(image, x, y, interpolation="nearest", wraps=source.wraps)

    colour = chosen(source.passes[COLOUR_PASS])
    single = ruled_by_noise(linear, colour, warp.x, warp.y, sharpness.noise)

    def look_up_grained(image: NDArray[np.float32]) -> NDArray[np.float32]:
        seen = look_up_light(image)
        np.copyto(seen, chosen(image), where=single[..., None])
        return seen

    return look_up_grained, replace(sharpness, single=single)


def _target_position(
    position: NDArray[np.float32], depth: NDArray[np.float32], warp: Warp, target: Camera
) -> NDArray[np.float32]:
    """Return (H, W, 3) the points in the world that the target's pixel centres see at this depth (H, W).

    Where the depth is not finite, as in the sky, it is the value of the source's own Position pass (H, W, 3) that was
    looked up.
    """
    rows, columns = np.mgrid[0.5 : depth.shape[0], 0.5 : depth.shape[1]]
    origin, direction = target.ray_from_px(columns, rows)
    known = np.isfinite(depth)
    along = np.where(known, depth, 1.0).astype(np.float64)
    local = np.stack([o + along * d for o, d in zip(origin, direction, strict=True)], axis=-1)
    world = local @ target.world_from_camera[:3, :3].T + target.world_from_camera[:3, 3]
    elsewhere = lookup(position, warp.x, warp.y, interpolation="nearest")
    return np.where(known[..., None], world, elsewhere).astype(np.float32)


def target_depth(depth: NDArray, warp: Warp, source: Camera, target: Camera) -> NDArray[np.float32]:
    """Return (H, W) the depth that the target sees: the source's depth (H, W, 1), looked up by the map and converted;
    +inf where nothing landed.

    Nearness is what is interpolated, because it is linear on any plane. The map has a nearness of its own, but that is
    interpolated between a coarse cell's corners, and less exact.
    """
    with np.errstate(over="ignore"):
        nearness = np.nan_to_num(source.nearness_from_depth(depth))
    seen = lookup(nearness, warp.x, warp.y, wraps=goes_round(source))[..., 0]
    same_depth = np.allclose(target_from_source(source, target)[2], (0.0, 0.0, 1.0, 0.0), rtol=0.0, atol=1e-12)
    moves = not (same_depth and is_planar(source)) and row_law_of(source, target) is None
    for rows in bands(seen.shape):
        x, y, covered = warp.x[rows], warp.y[rows], warp.nearness[rows] > -np.inf
        away = source.depth_from_nearness(seen[rows])
        if moves:
            away = np.where(covered, away, np.nan)
            # An orthographic camera's sky has a place; its depth is none for all that.
            away = np.where(np.isposinf(away), away, target_px_from_source_px(source, target, x, y, away)[2])
        with np.errstate(over="ignore"):
            seen[rows] = away
        np.copyto(seen[rows], np.inf, where=~covered)
    return seen


def composite(warped: Passes, traced: Passes, holes: NDArray[np.bool_]) -> None:
    """Replace the pixels of `holes` (H, W) in the warped passes (H, W, C), in place, by those of `traced` (N, C).

    traced has a value for each set pixel of the mask, row by row. A pass that traced lacks stays as it was warped.
    """
    for name, image in warped.items():
        if name in traced:
            image[holes] = traced[name]


def not_numbers(passes: Passes) -> dict[str, NDArray[np.bool_]]:
    """Return masks (H, W), by pass, of the pixels at which the pass has NaN or infinities.

    Passes without any are left out. So is depth, whose infinities are the sky.
    """
    found: dict[str, NDArray[np.bool_]] = {}
    for name, image in passes.items():
        number = np.isfinite(image)
        if name != DEPTH_PASS and not number.all():
            found[name] = ~number.all(axis=-1)
    return found


def count_pixels(found: Mapping[str, NDArray[np.bool_]]) -> int:
    """Return the number of pixels that are set in any of the masks (H, W), as `not_numbers` returns them."""
    return int(np.any([*found.values()], axis=0).sum()) if found else 0


def replace_non_finite(passes: Passes) -> tuple[Passes, NDArray[np.bool_]]:
    """Return the passes with NaN and infinities set to 0, and a mask (H, W) of the pixels at which an essential pass
    had any.

    Depth keeps its infinities, and has NaN for values that are no depth. A pass that is not essential
    (`passes.is_essential`) marks no pixel: a whole surface may have an AOV that is no number, and another trace of it
    would be none either.
    """
    clean, invalid = dict(passes), np.zeros(passes[COLOUR_PASS].shape[:2], bool)
    if DEPTH_PASS in passes:
        clean[DEPTH_PASS] = known_depth(passes[DEPTH_PASS])
    for name, pixels in not_numbers(passes).items():
        clean[name] = np.where(np.isfinite(passes[name]), passes[name], 0.0).astype(np.float32)
        if is_essential(name):
            invalid |= pixels
    return clean, invalid


def spoilt(
    lost: Sequence[Mapping[str, NDArray[np.bool_]]], warp: Warp, *, interpolation: str, wraps: bool = False
) -> dict[str, NDArray[np.bool_]]:
    """Return masks (h, w), by pass, of target pixels whose lookup takes any share of NaN or infinity in their source.

    lost has, for each source, the masks (H, W) that `not_numbers` returned. interpolation is the one of passes that may
    be mixed; wraps is as for `lookup`. Left out are essential passes, because such pixels are traced, and the position,
    which is computed from the depth.
    """
    found: dict[str, NDArray[np.bool_]] = {}
    for number, masks in enumerate(lost):
        for name, pixels in masks.items():
            if name == POSITION_PASS or is_essential(name):
                continue
            how = interpolation if filtered(name) else "nearest"
            share = lookup(pixels[..., None].astype(np.float32), warp.x, warp.y, interpolation=how, wraps=wraps)[..., 0]
            in_target = (share != 0.0) & (warp.source == number)
            found[name] = found[name] | in_target if name in found else in_target
    return found
