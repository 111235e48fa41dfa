"""Passes of a render by name, and the rules for each: its channels, how it is looked up, who gets it."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

Passes = dict[str, NDArray[np.float32]]
"""Passes of a picture by Blender's names: each (H, W, C), or (N, C) where they are traced pixels."""

# Passes of Blender that the code handles by name.

COLOUR_PASS = "Combined"
DEPTH_PASS = "Depth"
POSITION_PASS = "Position"
VECTOR_PASS = "Vector"

# Internal passes. Their names begin with a dot, which no name of Blender's does: users name their AOVs as they like.

MASKED_PASS = ".Masked"
"""Mask (H, W, 1) of a source: 1 where its pixels must not be warped, 0 elsewhere. Few sources have it."""

EFFECTS_PASS = ".Effects"
"""`effects.Effect` flags (H, W, 1) of what each pixel shows."""

MATERIAL_PASS = ".Shown Material"
"""Numbers (H, W, 1) for the sets of materials that pixels show, by `effects_pass.material_pass`."""

NOISY_PASS = ".Noisy"
"""Scene-linear colour (H, W, 4) as it was traced, of a picture that is denoised."""

ALBEDO_PASS = ".Guiding Albedo"
"""Albedo (H, W, 3) that guides the denoiser."""

NORMAL_PASS = ".Guiding Normal"
"""Normal (H, W, 3) that guides the denoiser."""

VIEW_DEPENDENT_PASS = ".View Dependent"
"""Part (H, W, 3) of the scene-linear colour that may look different from each eye, of a picture that is denoised: light
that was reflected by gloss or transmitted. It is as noisy as it was traced."""

LENGTH_PASS = ".Ray Length"
"""Length (H, W, 1) of a pixel's rays in scene units, in a source that is denoised or may show flat mirrors.

It is measured from the clip distance to the surface that guides the denoiser, as the mean over the samples. Behind a
mirror the ray goes on, and that part of its length counts times the reflectance of all mirrors before it."""

REFLECTANCE_PASS = ".Reflectance"
"""Share (H, W, 3) of the light that glossy reflection of the first surface sends on, in a source that may show flat
mirrors: see `effects.EffectsPlan.may_mirror`."""

SURFACE_NORMAL_PASS = ".Surface Normal"
"""Normal (H, W, 3) by which the first surface reflects, bumps included, in a source that has REFLECTANCE_PASS."""

ROUGHNESS_PASS = ".Roughness"
"""Roughness (H, W, 1) of the first surface's glossy part, in a source that has REFLECTANCE_PASS, from Blender 5 on."""

SOURCE_ONLY_PASSES = (LENGTH_PASS, REFLECTANCE_PASS, SURFACE_NORMAL_PASS, ROUGHNESS_PASS)
"""Passes that describe what the source sees and are never warped into the target."""

INTERNAL_PASSES = (
    EFFECTS_PASS,
    MATERIAL_PASS,
    MASKED_PASS,
    NOISY_PASS,
    ALBEDO_PASS,
    NORMAL_PASS,
    VIEW_DEPENDENT_PASS,
    *SOURCE_ONLY_PASSES,
)
"""Passes that are dropped before a picture is written: users never get them."""

_CRYPTOMATTE = re.compile(r"(Crypto(?:Object|Material|Asset))[0-9]{2}")
"""Names of the levels of Blender's cryptomattes."""

_VECTOR_PASSES = frozenset({POSITION_PASS, VECTOR_PASS, "Normal", "Denoising Normal"})
"""Passes whose channels Blender names X, Y, Z and W."""

_DISTANCE_PASSES = frozenset({DEPTH_PASS, "Mist", "Denoising Depth", "Volume Majorant"})
"""Passes whose one channel Blender names Z."""

_NEAREST_PIXEL_PASSES = frozenset(
    {
        "Normal",
        "UV",
        "Denoising Normal",
        "Denoising Depth",
        # Names in 4.5, then in 5.2.
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
"""Passes that are looked up as the nearest pixel: the mean of two values would be a third one, or, of what a denoiser
takes, would smear the noise.

They are whole names, because an AOV may be called "Normal map"."""

_RECOMPUTED_PASSES = frozenset({DEPTH_PASS, POSITION_PASS, VECTOR_PASS})
"""Passes whose values depend on the camera, or on the point that is seen: they are computed anew for the target."""

_MIRRORED_PASSES = frozenset(
    {
        COLOUR_PASS,
        NOISY_PASS,
        VIEW_DEPENDENT_PASS,
        ALBEDO_PASS,
        NORMAL_PASS,
        "Noisy Image",
        "Denoising Albedo",
        "Denoising Normal",
        "Denoising Depth",
        # Names in 4.5, then in 5.2.
        "GlossDir",
        "GlossInd",
        "Glossy Direct",
        "Glossy Indirect",
    }
)
"""Passes that show, in a mirror's pixels, the reflected things; light groups do too."""

_LIGHT_GROUP_PREFIX = "Combined_"
"""Beginning of the names of light groups' passes."""

_LIGHT_PASSES = frozenset(
    {
        COLOUR_PASS,
        # Names in 4.5, then in 5.2.
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
"""Passes of light that reaches the camera, by their whole names; light groups are such passes too."""

SKY_DEPTH_IN_FILES = 1e10
"""Depth, in scene units, that Blender and files give to the sky; inside the code it is infinite."""

_MIN_SKY_DEPTH = 1e9
"""Depth, in scene units, from which a pixel of a file is taken for sky: no surface is as far away."""

_MIN_DEPTH = float(np.finfo(np.float32).tiny)
"""Least depth, in scene units, that is taken for one: smaller numbers are denormals, and 1 over them may not fit
float32."""


def deepest(passes: Passes) -> float:
    """Return the greatest finite depth of a view's passes, in scene units; 0 where there is none."""
    depth = passes[DEPTH_PASS]
    return float(np.max(depth, where=np.isfinite(depth), initial=0.0))


def known_depth(depth: NDArray) -> NDArray[np.float32]:
    """Return the depth, in scene units, with NaN in place of values that are no depth, as a broken pass may have them.

    Those are 0, negative values, and values below `_MIN_DEPTH`.
    """
    known = depth >= _MIN_DEPTH
    if depth.dtype == np.float32 and known.all():
        return depth
    with np.errstate(over="ignore"):
        return np.where(known, depth, np.nan).astype(np.float32)


def to_blender(name: str, image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a pass (H, W, C) as Blender and files have it: the sky's depth is SKY_DEPTH_IN_FILES."""
    return np.where(np.isinf(image), np.float32(SKY_DEPTH_IN_FILES), image) if name == DEPTH_PASS else image


def from_blender(name: str, image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a pass (H, W, C) of Blender or of a file in the form that the code uses: the sky's depth is infinite."""
    return np.where(image >= _MIN_SKY_DEPTH, np.float32(np.inf), image) if name == DEPTH_PASS else image


def cryptomatte_of(name: str) -> str | None:
    """Return the name of the cryptomatte that the pass of this name belongs to, as "CryptoObject" for "CryptoObject00".

    None where the pass is not part of a cryptomatte.
    """
    found = _CRYPTOMATTE.fullmatch(name)
    return found[1] if found else None


def filtered(name: str) -> bool:
    """Return whether a pass may be interpolated between pixels, because the mean of two of its values is such a value
    too.

    It is False for passes whose nearest pixel is taken, and for those that are computed anew for the target.
    """
    return name not in _NEAREST_PIXEL_PASSES and name not in _RECOMPUTED_PASSES and cryptomatte_of(name) is None


def seen_in_mirrors(name: str) -> bool:
    """Return whether the pass shows, in a mirror's pixels, the things that are reflected, and not the mirror's own
    surface."""
    return name in _MIRRORED_PASSES or name.startswith(_LIGHT_GROUP_PREFIX)


def is_light(name: str) -> bool:
    """Return whether the pass is light that reaches the camera: all of it (the colour), or a part of it.

    The parts, some of them multiplied by a colour pass of their own, add up to all of it.
    """
    return name in _LIGHT_PASSES or name.startswith(_LIGHT_GROUP_PREFIX)


def is_essential(name: str) -> bool:
    """Return whether NaN or infinities in this pass make a pixel invalid as a whole, so that it is traced.

    True for light, whose parts must add up, and for internal passes, by which pixels are denoised and judged.
    """
    return is_light(name) or name in INTERNAL_PASSES


def pass_letters(name: str, channels: int) -> str:
    """Return the letters by which Blender names a pass's channels, one for each: "RGBA" for a colour, "Z" for a
    distance."""
    if channels == 1:
        return "Z" if name in _DISTANCE_PASSES else "X"
    if name in _VECTOR_PASSES:
        return "XYZW"[:channels]
    return ("UVA" if name == "UV" else "rgba" if cryptomatte_of(name) else "RGBA")[:channels]


def without_internal_passes(passes: Passes) -> Passes:
    """Return the passes without INTERNAL_PASSES, which only this extension uses: those that users get."""
    return {name: image for name, image in passes.items() if name not in INTERNAL_PASSES}
