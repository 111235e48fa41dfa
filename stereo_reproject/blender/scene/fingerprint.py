"""Fingerprints of a scene: everything that its pictures depend on, by value, in a few digits.

The bytes of a .blend are no such fingerprint: they differ each time that it is saved. Values that curves and drivers
set are left out, because they differ in each frame; the curves count. Nothing is evaluated, so the scene stays as it
is.
"""

from __future__ import annotations

import hashlib
import json

import bpy

from .fingerprint_reading import Key, Reader

DIGEST_DIGITS = 16
"""Hexadecimal digits of the digest of a kind of datablock: chance makes two of them equal once in 10^19."""
FILES = "files"


def scene_fingerprint(scene: bpy.types.Scene) -> str:
    """Return a hexadecimal SHA-256 of all that can change the scene's pictures, in whichever frame the scene stands.
    Where pictures are saved, which frames are rendered, and what only windows show do not count.
    """
    return fingerprint_of(scene_fingerprints(scene))


def fingerprint_of(digests: dict[str, str]) -> str:
    """Return one digest, a hexadecimal SHA-256, of all the digests that `scene_fingerprints` returns."""
    return hashlib.sha256(json.dumps(digests, sort_keys=True).encode()).hexdigest()


def scene_fingerprints(scene: bpy.types.Scene) -> dict[str, str]:
    """Return a digest for each kind of datablock ("objects", "meshes", "files"), so that a change can be named."""
    reader = Reader()
    found: dict[Key, str] = {}
    waiting: list[bpy.types.ID] = [scene]
    while waiting:
        block = waiting.pop()
        key = reader.key(block)
        if key not in found:
            read, references = reader.read(block)
            found[key] = _digest(read)
            waiting.extend(references)
    lines: dict[str, list[str]] = {FILES: sorted(reader.files.lines)}
    for key in sorted(found):
        lines.setdefault(key[0], []).append(f"{key} {found[key]}")
    return {kind: _digest(lines[kind])[:DIGEST_DIGITS] for kind in sorted(lines)}


def what_changed(before: dict[str, str], after: dict[str, str]) -> list[str]:
    """Return the kinds of datablock in which two results of `scene_fingerprints` differ, sorted."""
    return sorted(kind for kind in before.keys() | after.keys() if before.get(kind) != after.get(kind))


def _digest(lines: list[str]) -> str:
    """Return the hexadecimal SHA-256 of these lines."""
    # A name may hold what is no valid Unicode.
    return hashlib.sha256("\n".join(lines).encode("utf-8", "surrogateescape")).hexdigest()
