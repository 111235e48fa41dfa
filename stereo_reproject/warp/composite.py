"""The target eye put together: warped where the warp has the answer, traced where it has none."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from ..images.bands import bands
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
from ..views.camera import Camera, target_from_source, target_px_from_source_px
from .forward import Warp
from .motion import Moving, standing_still, warp_motion
from .scanline import row_disparity_of

LookUp = Callable[[NDArray[np.float32], str], NDArray[np.float32]]
"""A pass (H, W, C) as the target sees it, (h, w, C), found by `lookup.lookup`."""


def warp_passes(
    source: Passes,
    warp: Warp,
    source_camera: Camera,
    target_camera: Camera,
    *,
    interpolation: str,
    colour_interpolation: str | None = None,
    motion: tuple[Moving, Moving] | None = None,
) -> Passes:
    """The source's passes as seen by the target, 0 (depth: +inf) where nothing landed.

    interpolation is how `lookup` finds what may be mixed, colour_interpolation how it finds COLOUR_PASS, if otherwise.
    motion is that of the two eyes, of whom none moves without it; the Vector pass alone asks for it.
    """
    return passes_seen(
        source,
        warp,
        _target_depth(source[DEPTH_PASS], warp, source_camera, target_camera),
        (source_camera, target_camera),
        lambda image, how: lookup(image, warp.x, warp.y, interpolation=how),
        interpolation=interpolation,
        colour_interpolation=colour_interpolation,
        motion=motion,
    )


def passes_seen(
    source: Passes,
    warp: Warp,
    seen: NDArray[np.float32],
    cameras: tuple[Camera, Camera],
    look_up: LookUp,
    *,
    interpolation: str,
    colour_interpolation: str | None,
    motion: tuple[Moving, Moving] | None,
) -> Passes:
    """`warp_passes` by any means: seen (H, W) is the depth that the target, the second of the cameras, sees.

    Passes that say nothing of the target (`passes.SOURCE_ONLY_PASSES`) are left out.
    """
    warped: Passes = {}
    for name, image in source.items():
        if name == DEPTH_PASS:
            warped[name] = seen[..., None]
        elif name == POSITION_PASS:
            warped[name] = _target_position(image, seen, warp, cameras[1])
        elif name == VECTOR_PASS:
            eyes = motion or (standing_still(cameras[0]), standing_still(cameras[1]))
            warped[name] = warp_motion(image, source[DEPTH_PASS], warp, *eyes, seen)
        elif name not in SOURCE_ONLY_PASSES:
            how = colour_interpolation if name == COLOUR_PASS and colour_interpolation else interpolation
            warped[name] = look_up(image, how if filtered(name) else "nearest")
    return warped


def _target_position(
    position: NDArray[np.float32], depth: NDArray[np.float32], warp: Warp, target: Camera
) -> NDArray[np.float32]:
    """(H, W, 3): the points in the world that the target's pixel centres see at this depth (H, W).

    Where there is none, what Blender has there: the source's own (H, W, 3).
    """
    rows, columns = np.mgrid[0.5 : depth.shape[0], 0.5 : depth.shape[1]]
    origin, direction = target.ray_from_px(columns, rows)
    known = np.isfinite(depth)
    along = np.where(known, depth, 1.0).astype(np.float64)
    local = np.stack([o + along * d for o, d in zip(origin, direction, strict=True)], axis=-1)
    world = local @ target.world_from_camera[:3, :3].T + target.world_from_camera[:3, 3]
    elsewhere = lookup(position, warp.x, warp.y, interpolation="nearest")
    return np.where(known[..., None], world, elsewhere).astype(np.float32)


def _target_depth(depth: NDArray, warp: Warp, source: Camera, target: Camera) -> NDArray[np.float32]:
    """(H, W): the source's own depth (H, W, 1) where the warp says, as the target sees it.

    Not the warp's nearness, which a coarse cell has from its corners alone. Nearness is what may be interpolated: it is
    linear on any plane.
    """
    with np.errstate(over="ignore"):
        nearness = np.nan_to_num(source.nearness_from_depth(depth))
    seen = lookup(nearness, warp.x, warp.y)[..., 0]
    same_depth = np.allclose(target_from_source(source, target)[2], (0.0, 0.0, 1.0, 0.0), rtol=0.0, atol=1e-12)
    moves = not same_depth and row_disparity_of(source, target) is None
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


def composite(warped: Passes, traced: Passes, holes: NDArray[np.bool_]) -> Passes:
    """`warped` (H, W, C), with the pixels of `holes` (H, W) replaced by `traced` (N, C), in the mask's order."""
    result: Passes = {}
    for name, image in warped.items():
        result[name] = image.copy()
        if name in traced:
            result[name][holes] = traced[name]
    return result


def not_numbers(passes: Passes) -> dict[str, NDArray[np.bool_]]:
    """Return (H, W) where a pass has NaN or infinities, by pass; those without are left out, and so is depth."""
    found: dict[str, NDArray[np.bool_]] = {}
    for name, image in passes.items():
        number = np.isfinite(image)
        if name != DEPTH_PASS and not number.all():
            found[name] = ~number.all(axis=-1)
    return found


def count_pixels(found: Mapping[str, NDArray[np.bool_]]) -> int:
    """Pixels in any of the masks."""
    return int(np.any([*found.values()], axis=0).sum()) if found else 0


def replace_non_finite(passes: Passes) -> tuple[Passes, NDArray[np.bool_]]:
    """The passes with NaN and infinities set to 0, and (H, W) where one that decides had any; depth keeps its
    infinities.

    Nothing else follows from a pass that does not decide (`passes.is_essential`): a whole surface may have an AOV that
    is no number, and another trace of it would be none either.
    """
    clean, invalid = dict(passes), np.zeros(passes[COLOUR_PASS].shape[:2], bool)
    if DEPTH_PASS in passes:
        clean[DEPTH_PASS] = known_depth(passes[DEPTH_PASS])
    for name, pixels in not_numbers(passes).items():
        clean[name] = np.where(np.isfinite(passes[name]), passes[name], 0.0).astype(np.float32)
        if is_essential(name):
            invalid |= pixels
    return clean, invalid


def spoilt(lost: Mapping[str, NDArray[np.bool_]], warp: Warp, *, interpolation: str) -> dict[str, NDArray[np.bool_]]:
    """Return (h, w) target pixels whose lookup takes any share of what is no number in the source, by pass.

    lost (H, W) are as `not_numbers` has them. Passes that decide are left out, because such pixels are traced, and so
    is the position, which is computed from the depth.
    """
    found: dict[str, NDArray[np.bool_]] = {}
    for name, pixels in lost.items():
        if name != POSITION_PASS and not is_essential(name):
            how = interpolation if filtered(name) else "nearest"
            found[name] = lookup(pixels[..., None].astype(np.float32), warp.x, warp.y, interpolation=how)[..., 0] != 0.0
    return found
