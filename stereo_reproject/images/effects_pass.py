"""Materials and effects that each pixel shows, read off the cryptomatte, which costs Cycles next to nothing.

Source: Psyop, "Cryptomatte specification" 1.2: ranks of (hash, coverage), two to a pass, the largest coverage first; a
hash is 32 bits that are stored as a float, and the file's header says which name each of them stands for.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from .bands import bands
from .effects import IN_REFLECTED_LIGHT, SEEN_DIFFERENTLY, Effect
from .passes import COLOUR_PASS, EFFECTS_PASS, MATERIAL_PASS, Passes, cryptomatte_of
from .tuning import TUNING

MATERIAL_CRYPTOMATTE = "CryptoMaterial"
"""Beginning of the names of Blender's passes of the materials' cryptomatte."""

UNKNOWN_EFFECTS = -1
"""Number in place of `Effect` flags where it is not known what a pixel shows."""

MAX_FLOAT32_NUMBERS = 1 << 24
"""Whole numbers, counted from 0, that float32 can tell apart."""


def effects_pass(
    passes: Passes, attributes: Mapping[str, str], materials: Mapping[str, Effect], *, layer: str
) -> NDArray[np.float32] | None:
    """Return EFFECTS_PASS: the `Effect` flags (H, W, 1) of all materials that each pixel shows; of pixels (N, C) one by
    one, (N, 1).

    passes hold the cryptomatte of the view layer called `layer`; attributes are the texts of the file that they were
    read from; materials has the effects of each material by its name. A material counts where it covers at least
    `min_material_coverage` of a pixel. None where the file does not say which hash stands for which material.
    """
    manifest = _manifest(attributes, f"{layer}.{MATERIAL_CRYPTOMATTE}")
    ranks = _ranks(passes)
    if manifest is None or not ranks:
        return None
    known = {_hash(manifest, name): effects for name, effects in materials.items()}
    flags = np.zeros(ranks[0][0].shape, np.int32)
    for hashes, seen in ranks:
        flags |= np.where(seen, _look_up(hashes, known), 0)
    return flags[..., None].astype(np.float32)


def material_pass(passes: Passes) -> NDArray[np.float32] | None:
    """Return MATERIAL_PASS: numbers (H, W, 1) for the sets of materials that pixels show.

    Two pixels of this picture have the same number where they show the same set. A thing seen through something
    transparent, or behind a blur, has another number there than beside it. passes hold the cryptomatte of one view
    layer. None without a cryptomatte, or where there are more sets than float32 can tell apart.
    """
    ranks = _ranks(passes)
    if not ranks:
        return None
    names = np.zeros(ranks[0][0].shape, np.uint64)
    for hashes, seen in ranks:
        names += np.where(seen, hashes, 0).astype(np.uint64)
    values, numbers = _distinct(names)
    return numbers[..., None].astype(np.float32) if values.size <= MAX_FLOAT32_NUMBERS else None


def _ranks(passes: Passes) -> list[tuple[NDArray[np.uint32], NDArray[np.bool_]]]:
    """Return the ranks of the materials' cryptomatte, each as hashes (H, W) and a mask (H, W).

    A rank holds one material for each pixel: its hash, and in the mask whether it covers at least
    `min_material_coverage` of the pixel. Empty where the passes have no such cryptomatte.
    """
    levels = [image for name, image in passes.items() if cryptomatte_of(name) == MATERIAL_CRYPTOMATTE]
    return [
        (np.ascontiguousarray(image[..., rank]).view(np.uint32), image[..., rank + 1] >= TUNING.min_material_coverage)
        for image in levels
        for rank in (0, 2)
    ]


def _manifest(attributes: Mapping[str, str], name: str) -> str | None:
    """Return the text that says which hash stands for which name in the cryptomatte called `name`; None without it.

    attributes are the texts of a file's header.
    """
    for key, value in attributes.items():
        if value == name and (found := re.fullmatch(r"(cryptomatte/[^/]+/)name", key)):
            return attributes.get(f"{found[1]}manifest")
    return None


def _hash(manifest: str, name: str) -> int | None:
    """Return the hash that stands for a material's name in a cryptomatte's manifest; None where the manifest lacks the
    name."""
    # Blender escapes no quotation mark: as JSON, the manifest may be broken by a single name.
    found = re.search(re.escape(f'"{name}":"') + '([0-9a-f]{8})"', manifest)
    return int(found[1], 16) if found else None


def _look_up(hashes: NDArray[np.uint32], known: Mapping[int | None, Effect]) -> NDArray[np.int32]:
    """Return the `Effect` flags (H, W) of the materials whose hashes (H, W) are given; 0 for a hash that is not in
    `known`."""
    values, place = _distinct(hashes)
    flags = np.array([known.get(int(value), Effect(0)) for value in values], np.int32)
    return flags[place]


def _distinct(image: NDArray) -> tuple[NDArray, NDArray[np.int32]]:
    """Return the values of an image (H, W), each once and in order, and the index (H, W) of each pixel's value."""
    flat = image.ravel()
    # Neighbours mostly have one value: only the first pixel of each run is sorted.
    starts = np.flatnonzero(np.concatenate([np.ones(min(flat.size, 1), bool), flat[1:] != flat[:-1]]))
    values, place = np.unique(flat[starts], return_inverse=True)
    return values, np.repeat(place.astype(np.int32), np.diff(starts, append=flat.size)).reshape(image.shape)


def effects_of(passes: Passes) -> NDArray[np.int32]:
    """Return the `Effect` flags (H, W) of a picture's EFFECTS_PASS; UNKNOWN_EFFECTS everywhere without that pass."""
    if EFFECTS_PASS not in passes:
        return np.full(passes[COLOUR_PASS].shape[:2], UNKNOWN_EFFECTS, np.int32)
    return passes[EFFECTS_PASS][..., 0].astype(np.int32)


def materials_of(passes: Passes) -> NDArray[np.int32] | None:
    """Return the numbers (H, W) of a picture's MATERIAL_PASS, as `material_pass` makes them; None without that pass."""
    return passes[MATERIAL_PASS][..., 0].astype(np.int32) if MATERIAL_PASS in passes else None


def shows(passes: Passes, effect: Effect) -> NDArray[np.bool_]:
    """Return (H, W) the pixels of a picture that are known to show the effect, or any of several that are given as one
    flag.

    No pixel is set where the picture has no EFFECTS_PASS.
    """
    result = np.zeros(passes[COLOUR_PASS].shape[:2], bool)
    if EFFECTS_PASS in passes:
        for rows in bands(result.shape):
            result[rows] = flagged(passes[EFFECTS_PASS][rows][..., 0].astype(np.int32), effect)
    return result


def differ_in_reflected_light(flags: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Return (...) the pixels whose `Effect` flags (...) are known and say that nothing but reflected and transmitted
    light may look different from each eye."""
    return (flags != UNKNOWN_EFFECTS) & ~flagged(flags, SEEN_DIFFERENTLY & ~IN_REFLECTED_LIGHT)


def flagged(flags: NDArray[np.int32], effect: Effect) -> NDArray[np.bool_]:
    """Return (H, W) the pixels whose `Effect` flags (H, W) are known and include the effect, or any of several in one
    flag."""
    return (flags != UNKNOWN_EFFECTS) & ((flags & effect.value) > 0)
