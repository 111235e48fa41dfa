"""The mask that others guess with: every pixel on which light was reflected or let through. For comparison only.

Made from the source's light passes. A surface that a Transparent BSDF makes transparent leaves no trace in them: it
shows as alpha, and only where the film is transparent.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .passes import COLOUR_PASS, Passes

SHARE = 0.1
"""Of a pixel's light, from which it is masked."""

LIGHT_PASSES = {
    "glossy": ("Gloss", "Glossy "),
    "transmission": ("Trans", "Transmission "),
}
"""What the passes' names begin with, up to Blender 4.5 and from 5.0 on."""

PARTS = {"direct": ("Dir", "Direct"), "indirect": ("Ind", "Indirect"), "color": ("Col", "Color")}
"""How they go on."""


def light_pass_names(kind: str, part: str) -> tuple[str, ...]:
    """The names that one of the passes may have: a key of LIGHT_PASSES, and one of PARTS."""
    return tuple(start + end for start, end in zip(LIGHT_PASSES[kind], PARTS[part], strict=True))


def heuristic_mask(source: Passes) -> NDArray[np.float32]:
    """(H, W, 1): 1 where glossy and transmission light are more than SHARE of the pixel's, or alpha is partial.

    Raises KeyError when the source lacks a light pass.
    """
    colour = source[COLOUR_PASS]
    shiny = np.zeros(colour.shape[:2], np.float64)
    for kind in LIGHT_PASSES:
        direct, indirect, tint = (_light_pass(source, kind, part) for part in PARTS)
        shiny += _brightness(tint * (direct + indirect))
    partial = (colour[..., 3] > 0.0) & (colour[..., 3] < 1.0)
    return ((shiny > SHARE * _brightness(colour)) | partial)[..., None].astype(np.float32)


def _light_pass(source: Passes, kind: str, part: str) -> NDArray[np.float32]:
    names = light_pass_names(kind, part)
    return source[next((name for name in names if name in source), names[0])]


def _brightness(light: NDArray) -> NDArray[np.float64]:
    """(H, W); what is no number counts as dark."""
    return np.nan_to_num(light[..., :3].astype(np.float64), posinf=0.0, neginf=0.0).sum(axis=-1)
