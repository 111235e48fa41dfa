"""What a render consists of: passes by name."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

Passes = dict[str, NDArray[np.float32]]
"""Passes by Blender's names, each (H, W, C), or (N, C) for traced pixels."""

COLOUR_PASS = "Combined"
DEPTH_PASS = "Depth"
POSITION_PASS = "Position"
VECTOR_PASS = "Vector"

MASKED_PASS = ".Masked"
"""Names of ours begin with a dot, which no pass of Blender's has: an AOV is called what its maker likes.

(H, W, 1) of a source: 1 where its pixels must not be warped, 0 elsewhere. Few sources have it."""

EFFECTS_PASS = ".Effects"
"""(H, W, 1) `effects.Effect` flags of what each pixel shows. Ours alone: it is dropped before anything is written."""

MATERIAL_PASS = ".Shown Material"
"""(H, W, 1) number of the materials that each pixel shows. Ours alone, as the flags are."""

NOISY_PASS = ".Noisy"
"""(H, W, 4) colour as it was traced, where the picture is denoised. Ours alone, as are what the denoiser looks at:"""

ALBEDO_PASS = ".Guiding Albedo"
NORMAL_PASS = ".Guiding Normal"

LENGTH_PASS = ".Ray Length"
"""(H, W, 1) of a source that is denoised: the way of a pixel's rays from where they are clipped to what guides the
denoiser, the mean of its samples: on over mirrors, each part times what the mirrors before it reflect."""

REFLECTANCE_PASS = ".Reflectance"
"""(H, W, 3) of such a source, where anything is glossy: the share of the light that its gloss reflects."""

SURFACE_NORMAL_PASS = ".Surface Normal"
"""(H, W, 3) of the same: the normal by which what is seen first reflects, bumps and all."""

ROUGHNESS_PASS = ".Roughness"
"""(H, W, 1) of the same, from Blender 5 on: of what is glossy of what is seen first."""

OF_SOURCE = (LENGTH_PASS, REFLECTANCE_PASS, SURFACE_NORMAL_PASS, ROUGHNESS_PASS)
"""Passes that are asked for what the source sees, and never warped into the target."""

OURS = (EFFECTS_PASS, MATERIAL_PASS, MASKED_PASS, NOISY_PASS, ALBEDO_PASS, NORMAL_PASS, *OF_SOURCE)

_CRYPTOMATTE = re.compile(r"(Crypto(?:Object|Material|Asset))[0-9]{2}")

_VECTORS = frozenset({POSITION_PASS, VECTOR_PASS, "Normal", "Denoising Normal"})
_DISTANCES = frozenset({DEPTH_PASS, "Mist", "Denoising Depth", "Volume Majorant"})

_UNMIXED = frozenset(
    {
        "Normal",
        "UV",
        "Denoising Normal",
        "Denoising Depth",
        # The same passes, by their names in 4.5 and in 5.2.
        "IndexOB",
        "IndexMA",
        "Object Index",
        "Material Index",
        "Debug Sample Count",
        "Render Time",
        EFFECTS_PASS,
        MATERIAL_PASS,
        NOISY_PASS,
        ALBEDO_PASS,
        NORMAL_PASS,
    }
)
"""Passes of which a mean of two neighbours is neither of them; and a denoiser wants noise that is not smeared.

Whole names: an AOV may be called "Normal map"."""

_CONVERTED = frozenset({DEPTH_PASS, POSITION_PASS, VECTOR_PASS})
"""Passes that are another eye's only after a conversion."""


_SEEN_IN_MIRRORS = frozenset(
    {
        COLOUR_PASS,
        NOISY_PASS,
        ALBEDO_PASS,
        NORMAL_PASS,
        "Noisy Image",
        "Denoising Albedo",
        "Denoising Normal",
        "Denoising Depth",
        # By their names in 4.5 and in 5.2.
        "GlossDir",
        "GlossInd",
        "Glossy Direct",
        "Glossy Indirect",
    }
)
_LIGHT_GROUP = "Combined_"

_LIGHT = frozenset(
    {
        COLOUR_PASS,
        # By their names in 4.5 and in 5.2.
        *(kind + way for kind in ("Diff", "Gloss", "Trans", "Volume") for way in ("Dir", "Ind")),
        *(
            f"{kind} {way}"
            for kind in ("Diffuse", "Glossy", "Transmission", "Volume")
            for way in ("Direct", "Indirect")
        ),
        "Emit",
        "Emission",
        "Env",
        "Environment",
    }
)

NO_SURFACE = 1e10
"""The depth that Blender gives to what has no surface, and that files have; inside the code it is infinite."""

_FARTHEST = 1e9
"""No surface is as deep as this."""


_NEAREST = float(np.finfo(np.float32).tiny)
"""What is nearer is a denormal, and one over it no float32."""


def known_depth(depth: NDArray) -> NDArray[np.float32]:
    """The depth with NaN for what is none: 0, below it, or next to nothing, as a broken pass may have it."""
    known = depth >= _NEAREST
    if depth.dtype == np.float32 and known.all():
        return depth
    with np.errstate(over="ignore"):
        return np.where(known, depth, np.nan).astype(np.float32)


def as_blender_has_it(name: str, image: NDArray[np.float32]) -> NDArray[np.float32]:
    """A pass as it leaves the code."""
    return np.where(np.isinf(image), np.float32(NO_SURFACE), image) if name == DEPTH_PASS else image


def from_blender(name: str, image: NDArray[np.float32]) -> NDArray[np.float32]:
    """A pass as it comes from Blender, or from a file of ours."""
    return np.where(image >= _FARTHEST, np.float32(np.inf), image) if name == DEPTH_PASS else image


def cryptomatte_of(name: str) -> str | None:
    """What cryptomatte a pass is a level of, by Blender's name ("CryptoObject"), or None."""
    found = _CRYPTOMATTE.fullmatch(name)
    return found[1] if found else None


def filtered(name: str) -> bool:
    """Whether a mean of two of the pass's values is a value of the pass."""
    return name not in _UNMIXED and name not in _CONVERTED and cryptomatte_of(name) is None


def seen_in_mirrors(name: str) -> bool:
    """Whether a pass has, where there is a mirror, what that shows."""
    return name in _SEEN_IN_MIRRORS or name.startswith(_LIGHT_GROUP)


def is_light(name: str) -> bool:
    """Whether a pass is light that reaches the camera: all of it, or a part. Parts, times the colour that some have a
    pass for, add up to all of it."""
    return name in _LIGHT or name.startswith(_LIGHT_GROUP)


def decides(name: str) -> bool:
    """Whether the pass decides what a pixel looks like: its light, all parts of which must add up, and what is asked
    for to denoise it or to tell what it shows."""
    return is_light(name) or name in OURS


def pass_letters(name: str, channels: int) -> str:
    """A letter for each channel of a pass, as Blender names them."""
    if channels == 1:
        return "Z" if name in _DISTANCES else "X"
    if name in _VECTORS:
        return "XYZW"[:channels]
    return ("UVA" if name == "UV" else "rgba" if cryptomatte_of(name) else "RGBA")[:channels]


def without_ours(passes: Passes) -> Passes:
    """What of the passes is the user's."""
    return {name: image for name, image in passes.items() if name not in OURS}
