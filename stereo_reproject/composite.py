"""The target eye put together: warped where the warp has the answer, traced where it has none."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .camera import Camera
from .lookup import lookup
from .passes import COLOUR_PASS, DEPTH_PASS, Passes
from .warp import Warp

UNWARPED = ("Vector",)
"""Passes that mean the source eye's own pixels: they do not carry over."""

NEAREST = ("Normal", "Position", "UV", "Denoising Normal", "Denoising Depth", "IndexOB", "IndexMA", "Object Index")
"""Passes of which a mean of two neighbours is neither of them."""


def warp_passes(source: Passes, warp: Warp, target: Camera, *, interpolation: str) -> Passes:
    """The source's passes as seen by the target, 0 (depth: +inf) where nothing landed."""
    warped: Passes = {}
    for name, image in source.items():
        if name in UNWARPED:
            continue
        if name == DEPTH_PASS:
            warped[name] = _target_depth(warp, target)[..., None]
        else:
            how = "nearest" if name.startswith((*NEAREST, "Crypto", "Material Index")) else interpolation
            warped[name] = lookup(image, warp.x, warp.y, interpolation=how)
    return warped


def _target_depth(warp: Warp, target: Camera) -> NDArray[np.float32]:
    depth = target.depth_from_nearness(warp.nearness.astype(np.float64))
    return np.where(warp.covered, depth, np.inf).astype(np.float32)


def composite(warped: Passes, traced: Passes, holes: NDArray[np.bool_]) -> Passes:
    """`warped` (H, W, C), with the pixels of `holes` (H, W) replaced by `traced` (N, C), in the mask's order."""
    result: Passes = {}
    for name, image in warped.items():
        result[name] = image.copy()
        if name in traced:
            result[name][holes] = traced[name]
    return result


def contain(passes: Passes) -> tuple[Passes, NDArray[np.bool_]]:
    """The passes with NaN and infinities set to 0, and (H, W) where the colour had one; depth keeps its infinities."""
    clean: Passes = {}
    colour = passes[COLOUR_PASS]
    for name, image in passes.items():
        if name == DEPTH_PASS:
            known = (image > 0.0) & ~np.isnan(image)
            clean[name] = np.where(known, image, np.nan).astype(np.float32)
        else:
            clean[name] = image if np.all(np.isfinite(image)) else np.nan_to_num(image, nan=0.0, posinf=0.0, neginf=0.0)
    return clean, ~np.all(np.isfinite(colour), axis=-1)
