"""Light that gloss has reflected or a surface has let through, by the light passes of a render.

It is the part of a picture that looks different from each eye. A surface that a Transparent BSDF makes transparent
leaves no trace in these passes: it shows as alpha, and only where the film is transparent.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .passes import COLOUR_PASS, VIEW_DEPENDENT_PASS, Passes
from .tuning import TUNING

LIGHT_PASS_PREFIXES = {
    "glossy": ("Gloss", "Glossy "),
    "transmission": ("Trans", "Transmission "),
}
"""Beginnings of the passes' names by kind of light: up to Blender 4.5, and from 5.0 on."""

LIGHT_PASS_SUFFIXES = {"direct": ("Dir", "Direct"), "indirect": ("Ind", "Indirect"), "color": ("Col", "Color")}
"""Ends of those names by part of the light: up to Blender 4.5, and from 5.0 on."""


def light_pass_names(kind: str, part: str) -> tuple[str, ...]:
    """Return the names that a light pass has in the supported versions of Blender, the older version's first.

    kind is a key of LIGHT_PASS_PREFIXES, part one of LIGHT_PASS_SUFFIXES.
    """
    return tuple(start + end for start, end in zip(LIGHT_PASS_PREFIXES[kind], LIGHT_PASS_SUFFIXES[part], strict=True))


def reflected_light(passes: Passes) -> NDArray[np.float32]:
    """Return the light (..., 3) that gloss has reflected or a surface has let through: the sum of the direct and the
    indirect light of both kinds, times its colour, scene-linear.

    passes (..., C) are those of a render. Where they have VIEW_DEPENDENT_PASS already, that is returned. Raises
    KeyError where they lack a light pass.
    """
    if VIEW_DEPENDENT_PASS in passes:
        return passes[VIEW_DEPENDENT_PASS]
    total = np.zeros((*passes[COLOUR_PASS].shape[:-1], 3), np.float32)
    for kind in LIGHT_PASS_PREFIXES:
        direct, indirect, tint = (_light_pass(passes, kind, part)[..., :3] for part in LIGHT_PASS_SUFFIXES)
        total += tint * (direct + indirect)
    return total


def glossy_mask(source: Passes) -> NDArray[np.float32]:
    """Return a mask (H, W, 1) of pixels that show glossy or transmitted light, 1 there and 0 elsewhere: a plain guess
    at what looks different from each eye, for comparison only. `tradeoff` traces these pixels in place of those that
    probes find.

    A pixel counts where such light is more than `min_glossy_light_share` of its own, or its alpha is neither 0 nor 1.
    Raises KeyError when the source lacks a light pass.
    """
    colour = source[COLOUR_PASS]
    shiny = _brightness(reflected_light(source))
    partial = (colour[..., 3] > 0.0) & (colour[..., 3] < 1.0)
    masked = (shiny > TUNING.min_glossy_light_share * _brightness(colour)) | partial
    return masked[..., None].astype(np.float32)


def _light_pass(source: Passes, kind: str, part: str) -> NDArray[np.float32]:
    """Return a light pass (H, W, C) of the source, by whichever of its names the source has. Raises KeyError without
    it.

    kind and part are as for `light_pass_names`.
    """
    names = light_pass_names(kind, part)
    return source[next((name for name in names if name in source), names[0])]


def _brightness(light: NDArray) -> NDArray[np.float64]:
    """Return the sum (H, W) of the colour channels of light (H, W, >= 3); NaN and infinities count as 0."""
    return np.nan_to_num(light[..., :3].astype(np.float64), posinf=0.0, neginf=0.0).sum(axis=-1)
