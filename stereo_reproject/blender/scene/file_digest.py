"""Files told apart by what is in them, cheaply: never by path or date, which differ from machine to machine."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

BLOCK_BYTES = 64 * 1024
"""Bytes of each sample."""
SAMPLED_BLOCKS = 8
"""A longer file is read at its beginning, at its end and at this many places in all."""
SMALL_BLOCK_BYTES = 4 * 1024
"""Bytes of each of the two samples of a file that is one of many."""

MISSING = "missing"


def file_digest(path: Path, *, block: int = BLOCK_BYTES, samples: int = SAMPLED_BLOCKS) -> str:
    """Of the size and of samples of the content, all of it if it is no longer than them; or MISSING."""
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
    """Of all files that are numbered as `path` is, by their numbers; of a file without a number, of itself."""
    found = numbered_like(path)
    if found is None:
        return file_digest(path)
    return files_digest(found) if found else MISSING


def numbered_like(path: Path) -> dict[str, Path] | None:
    """Return the files beside `path` that are numbered as it is, by their numbers; None for a path without a number."""
    numbered = re.fullmatch(r"(.*?)(\d+)(\D*)", path.name)
    if numbered is None:
        return None
    pattern = re.compile(re.escape(numbered[1]) + r"(\d+)" + re.escape(numbered[3]))
    try:
        return {match[1]: file for file in path.parent.iterdir() if (match := pattern.fullmatch(file.name))}
    except OSError:
        return {}


def files_digest(files: dict[str, Path]) -> str:
    """Of files that belong together, each under a name that is its own and not its path's."""
    lines = (f"{name} {file_digest(files[name], block=SMALL_BLOCK_BYTES, samples=2)}" for name in sorted(files))
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()
