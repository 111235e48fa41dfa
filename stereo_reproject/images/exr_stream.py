"""OpenEXR files written piece by piece, so that no more than a few rows of a picture are ever held.

The module OpenEXR takes whole files alone. Source: OpenEXR's documentation, "OpenEXR File Layout"; compression is ZIP,
of blocks of 16 rows.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..errors import BadInputError
from ..words import Words

MAGIC = struct.pack("<i", 20000630)
VERSION, LONG_NAMES, MULTI_PART = 2, 0x400, 0x1000
"""The version of the format, and flags beside it: of names of more than 31 bytes, and of several parts."""

MAX_SHORT_NAME_BYTES = 31

ZIP, ROWS_OF_BLOCK = 3, 16
ZIP_LEVEL = 4
"""Level of zlib: that which OpenEXR itself takes."""

PIXEL_TYPES = {np.dtype(np.float16): 1, np.dtype(np.float32): 2}


@dataclass(frozen=True)
class StreamedPart:
    """A part of a file: its name and the view that it is of (both "" in a file of one part), the names of its channels,
    and the texts in its header."""

    channels: Sequence[str]
    name: str = ""
    view: str = ""
    texts: Mapping[str, str] = field(default_factory=dict)

    @property
    def in_order(self) -> list[str]:
        """The names of the channels as the file has them, in the order of their letters."""
        return sorted(self.channels, key=str.encode)


class ExrStream:
    """An OpenEXR file that is being written, all of whose parts are (width, height) pixels of one type, float16 or
    float32. The rows of each part are written from its top to its bottom; `streamed_exr` opens and finishes it.
    """

    def __init__(
        self,
        file: BinaryIO,
        parts: Sequence[StreamedPart],
        size: tuple[int, int],
        dtype: DTypeLike,
        pool: ThreadPoolExecutor,
    ) -> None:
        self._file, self._parts, self._size, self._dtype, self._pool = file, parts, size, np.dtype(dtype), pool
        self._is_multi_part = len(parts) > 1
        blocks = -(-size[1] // ROWS_OF_BLOCK)
        headers = [self._header(part, blocks) for part in parts]
        file.write(MAGIC + struct.pack("<i", self._flags()) + b"".join(headers))
        if self._is_multi_part:
            file.write(b"\0")
        self._offsets_at = file.tell()
        file.write(bytes(8 * blocks * len(parts)))
        self._offsets: list[list[int]] = [[] for _ in parts]
        width = size[0]
        self._waiting: list[NDArray] = [np.empty((0, len(part.channels), width), self._dtype) for part in parts]
        """Rows of each part that do not yet fill a block."""

    def write(self, channels: Mapping[str, NDArray], part: int = 0) -> None:
        """Write the next rows (h, W) of a part, by the names of its channels."""
        rows = np.stack([channels[name] for name in self._parts[part].in_order], axis=1).astype(self._dtype, copy=False)
        rows = np.concatenate([self._waiting[part], rows])
        done = len(self._offsets[part]) * ROWS_OF_BLOCK
        end = len(rows) if done + len(rows) >= self._size[1] else len(rows) // ROWS_OF_BLOCK * ROWS_OF_BLOCK
        blocks = [rows[top : min(top + ROWS_OF_BLOCK, end)] for top in range(0, end, ROWS_OF_BLOCK)]
        self._waiting[part] = rows[end:].copy()
        for number, packed in enumerate(self._pool.map(_packed, blocks)):
            self._offsets[part].append(self._file.tell())
            own = struct.pack("<i", part) if self._is_multi_part else b""
            self._file.write(own + struct.pack("<ii", done + number * ROWS_OF_BLOCK, len(packed)) + packed)

    def finish(self) -> None:
        """Write where the blocks of each part are."""
        self._file.seek(self._offsets_at)
        for offsets in self._offsets:
            self._file.write(struct.pack(f"<{len(offsets)}Q", *offsets))

    def _flags(self) -> int:
        """Return the number of the version with its flags."""
        names = [name for part in self._parts for name in (*part.channels, *part.texts)]
        has_long = any(len(name.encode()) > MAX_SHORT_NAME_BYTES for name in names)
        return VERSION | LONG_NAMES * has_long | MULTI_PART * self._is_multi_part

    def _header(self, part: StreamedPart, blocks: int) -> bytes:
        """Return the header of a part of so many blocks."""
        kind = PIXEL_TYPES[self._dtype]
        channels = b"".join(name.encode() + b"\0" + struct.pack("<iBxxxii", kind, 0, 1, 1) for name in part.in_order)
        width, height = self._size
        window = struct.pack("<iiii", 0, 0, width - 1, height - 1)
        values = [
            ("channels", "chlist", channels + b"\0"),
            ("compression", "compression", bytes([ZIP])),
            ("dataWindow", "box2i", window),
            ("displayWindow", "box2i", window),
            ("lineOrder", "lineOrder", b"\0"),
            ("pixelAspectRatio", "float", struct.pack("<f", 1.0)),
            ("screenWindowCenter", "v2f", struct.pack("<ff", 0.0, 0.0)),
            ("screenWindowWidth", "float", struct.pack("<f", 1.0)),
        ]
        if self._is_multi_part:
            values += [("name", "string", part.name.encode()), ("type", "string", b"scanlineimage")]
            values += [("chunkCount", "int", struct.pack("<i", blocks)), ("view", "string", part.view.encode())]
        values += [(name, "string", text.encode()) for name, text in part.texts.items()]
        return b"".join(_attribute(*value) for value in values) + b"\0"


def _attribute(name: str, kind: str, value: bytes) -> bytes:
    """Return an attribute of a header."""
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value


def _packed(rows: NDArray) -> bytes:
    """Return a block of rows (h, C, W) as ZIP has it: first bytes of numbers before the second ones, each as its
    difference from the one before; as it is where that is no smaller."""
    plain = np.ascontiguousarray(rows).view(np.uint8).ravel()
    ordered = np.concatenate([plain[0::2], plain[1::2]])
    differences = np.empty_like(ordered)
    differences[:1] = ordered[:1]
    differences[1:] = ordered[1:] - ordered[:-1] + np.uint8(128)
    packed = zlib.compress(differences.data, ZIP_LEVEL)
    return packed if len(packed) < plain.size else plain.tobytes()


@contextmanager
def streamed_exr(
    path: Path, parts: Sequence[StreamedPart], size: tuple[int, int], dtype: DTypeLike
) -> Iterator[ExrStream]:
    """Have a file of these parts to write rows into, for the time of a `with` block; size is (width, height). Raises
    BadInputError where writing fails."""
    try:
        with path.open("wb") as file, ThreadPoolExecutor() as pool:
            stream = ExrStream(file, parts, size, dtype, pool)
            yield stream
            stream.finish()
    except OSError as error:
        raise BadInputError(
            Words(
                "cannot write {name}: {reason}; is the disk full?", name=path.name, reason=error.strerror or str(error)
            )
        ) from error
