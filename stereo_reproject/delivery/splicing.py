"""Some bytes of a large file replaced, the rest copied in blocks; the file is whole at every moment."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from ..errors import BadInputError
from ..files import put_in_place, sync
from ..words import Words

BLOCK_BYTES = 1 << 20
"""Copied at a time: movies have gigabytes."""


@dataclass(frozen=True)
class Edit:
    """One change of a file: the bytes [start, stop) are replaced by `new`. It is an insertion where start equals
    stop."""

    start: int
    stop: int
    new: bytes

    @property
    def growth(self) -> int:
        """The number of bytes by which the file becomes longer; negative if it becomes shorter."""
        return len(self.new) - (self.stop - self.start)


def splice(path: Path, edits: Sequence[Edit]) -> None:
    """Apply edits, which must not overlap and may be in any order, to a file. A changed copy is written beside it and
    then takes its place, so that the file is whole at every moment.

    Raises BadInputError if the copy cannot be written; then the file is as it was.
    """
    if all(edit.start == edit.stop and not edit.new for edit in edits):
        return
    handle, name = -1, None
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}-", dir=path.parent)
        with os.fdopen(handle, "wb") as target, path.open("rb") as source:
            _copy_edited(source, target, edits)
            target.flush()
            sync(target.fileno())
        shutil.copymode(path, name)
        put_in_place(Path(name), path)
    except BaseException as error:
        if name is not None:
            with contextlib.suppress(OSError):
                Path(name).unlink()
        if isinstance(error, OSError):
            reason = error.strerror or error
            raise BadInputError(
                Words("{path} cannot be written ({reason}); is the disk full?", path=path, reason=reason)
            ) from error
        raise


def _copy_edited(source: BinaryIO, target: BinaryIO, edits: Sequence[Edit]) -> None:
    """Copy `source` to `target` with the edits applied."""
    for edit in sorted(edits, key=lambda edit: (edit.start, edit.stop)):
        _copy(source, target, edit.start - source.tell())
        target.write(edit.new)
        source.seek(edit.stop)
    shutil.copyfileobj(source, target, BLOCK_BYTES)


def _copy(source: BinaryIO, target: BinaryIO, count: int) -> None:
    """Copy the next `count` bytes of `source` to `target`, in blocks. Raises OSError if the source ends before."""
    while count > 0:
        block = source.read(min(count, BLOCK_BYTES))
        if not block:
            raise OSError("the file became shorter")
        target.write(block)
        count -= len(block)
