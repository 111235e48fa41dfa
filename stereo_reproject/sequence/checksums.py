"""Checksums of files, in the form in which records and movie notes keep them."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from io import BufferedReader
from pathlib import Path
from typing import Any

from ..files import open_regular


def checksum(path: Path) -> dict[str, Any]:
    """Return a file's size and SHA-256 as {"bytes": int, "sha256": str}; a link is followed. Raises OSError."""
    with open_regular(path, follow=True) as file:
        return _checksum_of(file)


def is_unchanged(path: Path, known: Mapping[str, Any]) -> bool:
    """Return True if a regular file still has the size and the SHA-256 in `known`, a dict from `checksum`. Raises
    OSError, also where it is missing or a link."""
    with open_regular(path) as file:
        # The size is known at once; the checksum needs every byte.
        return os.fstat(file.fileno()).st_size == known["bytes"] and _checksum_of(file) == known


def _checksum_of(file: BufferedReader) -> dict[str, Any]:
    """Return the dict of `checksum` for an open file."""
    return {"bytes": os.fstat(file.fileno()).st_size, "sha256": hashlib.file_digest(file, "sha256").hexdigest()}
