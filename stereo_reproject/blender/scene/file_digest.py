"""Digests of files by a few samples of their content, never by path or date, which differ from machine to machine."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

BLOCK_BYTES = 64 * 1024
"""Size of each sample."""
SAMPLED_BLOCKS = 8
"""Number of samples of a file that is larger than all of them, from its beginning to its end."""
SMALL_BLOCK_BYTES = 4 * 1024
"""Size of each of the two samples of a file that is one of many."""

MISSING = "missing"


def file_digest(path: Path, *, block: int = BLOCK_BYTES, samples: int = SAMPLED_BLOCKS) -> str:
    """Return the digest of a file by its size and samples of its content, `samples` blocks of `block` bytes; the
    content is read whole where it is not larger. `MISSING` if it cannot be read.
    """
    digest = hashlib.sha256()
    try:
        with path.open("rb") as file:
            size = file.seek(0, 2)
            digest.update(str(size).encode())
            last = max(size - block, 0)
            if size <= block * samples:
                file.seek(0)
                digest.update(file.read())
                return digest.hexdigest()
            for sample in range(samples):
                file.seek(last * sample // (samples - 1))
                digest.update(file.read(block))
    except OSError:
        return MISSING
    return digest.hexdigest()


def sequence_digest(path: Path) -> str:
    """Return the digest of all files numbered as `path` is, with their numbers; of the file alone where its name has no
    number. `MISSING` if there are none.
    """
    found = numbered_like(path)
    if found is None:
        return file_digest(path)
    return files_digest(found) if found else MISSING


def numbered_like(path: Path) -> dict[str, Path] | None:
    """Return the files beside `path` whose names differ from its name only in the number, by their numbers as text.
    None where its name has no number; empty where the folder cannot be read.
    """
    numbered = re.fullmatch(r"(.*?)(\d+)(\D*)", path.name)
    if numbered is None:
        return None
    pattern = re.compile(re.escape(numbered[1]) + r"(\d+)" + re.escape(numbered[3]))
    try:
        return {match[1]: file for file in path.parent.iterdir() if (match := pattern.fullmatch(file.name))}
    except OSError:
        return {}


def files_digest(files: dict[str, Path]) -> str:
    """Return the digest of files that belong together. Each has a name, such as its number, that counts in place of its
    path.
    """
    lines = (f"{name} {file_digest(files[name], block=SMALL_BLOCK_BYTES, samples=2)}" for name in sorted(files))
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()
