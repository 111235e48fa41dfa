"""The target eye put together: warped where the warp has the answer, traced where it has none."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .camera import Camera, target_from_source, target_px_from_source_px
from .lookup import lookup
from .passes import (
    ALBEDO_PASS,
    COLOUR_PASS,
    DEPTH_PASS,
    EFFECTS_PASS,
    MATERIAL_PASS,
    NOISY_PASS,
    NORMAL_PASS,
    Passes,
)
from .warp import Warp

UNWARPED = ("Vector",)
"""Passes that mean the source eye's own pixels: they do not carry over."""

NEAREST = (
    "Normal",
    "Position",
    "UV",
    "Denoising Normal",
    "Denoising Depth",
    "IndexOB",
    "IndexMA",
    "Object Index",
    "Material Index",
    "Crypto",
    EFFECTS_PASS,
    MATERIAL_PASS,
    NOISY_PASS,
    ALBEDO_PASS,
    NORMAL_PASS,
)
"""Passes of which a mean of two neighbours is neither of them; a denoiser wants noise that is not smeared."""


def warp_passes(
    source: Passes, warp: Warp, source_camera: Camera, target_camera: Camera, *, interpolation: str
) -> Passes:
    """The source's passes as seen by the target, 0 (depth: +inf) where nothing landed."""
    warped: Passes = {}
    for name, image in source.items():
        if name in UNWARPED:
            continue
        if name == DEPTH_PASS:
            warped[name] = _target_depth(image, warp, source_camera, target_camera)[..., None]
        else:
            how = interpolation if filtered(name) else "nearest"
            warped[name] = lookup(image, warp.x, warp.y, interpolation=how)
    return warped


def filtered(name: str) -> bool:
    """Whether a mean of two of the pass's values is a value of the pass."""
    return name != DEPTH_PASS and not name.startswith(NEAREST)


def _target_depth(depth: NDArray, warp: Warp, source: Camera, target: Camera) -> NDArray[np.float32]:
    """(H, W): the source's own depth (H, W, 1) where the warp says, as the target sees it.

    Not the warp's nearness, which a coarse cell has from its corners alone. Nearness is what may be interpolated: it is
    linear on any plane.
    """
    nearness = source.nearness_from_depth(depth.astype(np.float64)).astype(np.float32)
    looked_up = lookup(np.nan_to_num(nearness), warp.x, warp.y)[..., 0]
    seen = np.where(warp.covered, source.depth_from_nearness(looked_up), np.nan)
    transform = target_from_source(source, target)
    if not np.allclose(transform[2], (0.0, 0.0, 1.0, 0.0), rtol=0.0, atol=1e-12):
        seen = target_px_from_source_px(source, target, warp.x, warp.y, seen)[2]
    return np.where(warp.covered, seen, np.inf).astype(np.float32)


def composite(warped: Passes, traced: Passes, holes: NDArray[np.bool_]) -> Passes:
    """`warped` (H, W, C), with the pixels of `holes` (H, W) replaced by `traced` (N, C), in the mask's order."""
    result: Passes = {}
    for name, image in warped.items():
        result[name] = image.copy()
        if name in traced:
            result[name][holes] = traced[name]
    return result


def contain(passes: Passes) -> tuple[Passes, NDArray[np.bool_]]:
    """The passes with NaN and infinities set to 0, and (H, W) where one of them had any; depth keeps its infinities."""
    clean: Passes = {}
    invalid = np.zeros(passes[COLOUR_PASS].shape[:2], bool)
    for name, image in passes.items():
        if name == DEPTH_PASS:
            known = (image > 0.0) & ~np.isnan(image)
            clean[name] = np.where(known, image, np.nan).astype(np.float32)
            continue
        number = np.isfinite(image)
        clean[name] = image if number.all() else np.where(number, image, 0.0).astype(np.float32)
        invalid |= ~number.all(axis=-1)
    return clean, invalid
