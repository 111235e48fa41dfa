"""What each pixel's materials are and call for, read off the cryptomatte that Cycles renders for free.

Source: Psyop, "Cryptomatte specification" 1.2: ranks of (hash, coverage), two to a pass, the largest coverage first; a
hash is 32 bits that are stored as a float, and the file's header says which name each of them stands for.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from .effects import Effect
from .passes import COLOUR_PASS, EFFECTS_PASS, MATERIAL_PASS, Passes, cryptomatte_of

CRYPTOMATTE = "CryptoMaterial"
"""How the names of Blender's passes of materials begin."""

UNKNOWN = -1
"""In place of flags, where it is not known what a pixel shows."""

LEAST_COVERAGE = 0.1
"""Share of a pixel from which a material counts as seen there."""


def effects_pass(
    passes: Passes, attributes: Mapping[str, str], materials: Mapping[str, Effect], *, layer: str
) -> NDArray[np.float32] | None:
    """(H, W, 1) `Effect` flags: the union over the materials that cover at least a tenth of the pixel.

    passes hold the cryptomatte of the view layer called `layer`, attributes are the file's; materials tell what each
    calls for, by name. None where the file does not say which hash is whose.
    """
    manifest = _manifest(attributes, f"{layer}.{CRYPTOMATTE}")
    ranks = _ranks(passes)
    if manifest is None or not ranks:
        return None
    known = {_hash(manifest, name): effects for name, effects in materials.items()}
    flags = np.zeros(ranks[0][0].shape, np.int32)
    for hashes, seen in ranks:
        flags |= np.where(seen, _look_up(hashes, known), 0)
    return flags[..., None].astype(np.float32)


def material_pass(passes: Passes) -> NDArray[np.float32] | None:
    """(H, W, 1): a number, within this picture, of the materials that cover at least a tenth of each pixel.

    Pixels have the same where these are the same: what is seen through something transparent, or behind a blur, is
    another thing than beside it. passes hold the cryptomatte of one view layer; None where they do not, or where there
    are more than float32 can tell apart.
    """
    ranks = _ranks(passes)
    if not ranks:
        return None
    names = np.zeros(ranks[0][0].shape, np.uint64)
    for hashes, seen in ranks:
        names += np.where(seen, hashes, 0).astype(np.uint64)
    values, numbers = _distinct(names)
    # As many as float32 tells apart.
    return numbers[..., None].astype(np.float32) if values.size <= 1 << 24 else None


def _ranks(passes: Passes) -> list[tuple[NDArray[np.uint32], NDArray[np.bool_]]]:
    """Hashes (H, W) of each rank, and where what they stand for covers enough of the pixel to count as seen."""
    levels = [image for name, image in passes.items() if cryptomatte_of(name) == CRYPTOMATTE]
    return [
        (np.ascontiguousarray(image[..., rank]).view(np.uint32), image[..., rank + 1] >= LEAST_COVERAGE)
        for image in levels
        for rank in (0, 2)
    ]


def _manifest(attributes: Mapping[str, str], name: str) -> str | None:
    for key, value in attributes.items():
        if value == name and (found := re.fullmatch(r"(cryptomatte/[^/]+/)name", key)):
            return attributes.get(f"{found[1]}manifest")
    return None


def _hash(manifest: str, name: str) -> int | None:
    # Blender escapes no quotation mark: as JSON, the manifest may be broken by a single name.
    found = re.search(re.escape(f'"{name}":"') + '([0-9a-f]{8})"', manifest)
    return int(found[1], 16) if found else None


def _look_up(hashes: NDArray[np.uint32], known: Mapping[int | None, Effect]) -> NDArray[np.int32]:
    values, place = _distinct(hashes)
    flags = np.array([known.get(int(value), Effect(0)) for value in values], np.int32)
    return flags[place]


def _distinct(image: NDArray) -> tuple[NDArray, NDArray[np.int32]]:
    """The values in an image (H, W), each once, and (H, W) the place of each pixel's among them."""
    flat = image.ravel()
    # What is seen lies together: there are few runs to be sorted.
    starts = np.flatnonzero(np.concatenate([np.ones(min(flat.size, 1), bool), flat[1:] != flat[:-1]]))
    values, place = np.unique(flat[starts], return_inverse=True)
    return values, np.repeat(place.astype(np.int32), np.diff(starts, append=flat.size)).reshape(image.shape)


def effects_of(passes: Passes) -> NDArray[np.int32]:
    """(H, W) flags of what the pixels show, all of them UNKNOWN without the pass."""
    if EFFECTS_PASS not in passes:
        return np.full(passes[COLOUR_PASS].shape[:2], UNKNOWN, np.int32)
    return passes[EFFECTS_PASS][..., 0].astype(np.int32)


def materials_of(passes: Passes) -> NDArray[np.int32] | None:
    """(H, W) numbers of the materials that the pixels show, None without the pass."""
    return passes[MATERIAL_PASS][..., 0].astype(np.int32) if MATERIAL_PASS in passes else None


def shows(passes: Passes, effect: Effect) -> NDArray[np.bool_]:
    """(H, W): the pixels that are known to show the effect."""
    if EFFECTS_PASS not in passes:
        return np.zeros(passes[COLOUR_PASS].shape[:2], bool)
    return flagged(effects_of(passes), effect)


def flagged(flags: NDArray[np.int32], effect: Effect) -> NDArray[np.bool_]:
    """(H, W): where the effect is among the flags (H, W), as far as they are known."""
    return (flags != UNKNOWN) & ((flags & effect.value) > 0)
