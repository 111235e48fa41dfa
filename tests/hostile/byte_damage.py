"""A .blend file as bytes: where its blocks lie, and ways to damage them. Knows both headers: of Blender before 5, and
from 5 on."""

from __future__ import annotations

import random
import struct
from collections.abc import Iterator
from dataclasses import dataclass

OLD_HEADER = 12
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
ZSTD_BLOCK = 1 << 17
"""Bytes of a Zstandard block at most."""


@dataclass(frozen=True)
class Block:
    """A block of the file: at start its header, then its data up to end."""

    code: str
    start: int
    data: int
    end: int


def blocks_of(content: bytes) -> list[Block]:
    """The blocks of an uncompressed .blend, the last of them ENDB."""
    modern = content[7:8].isdigit()
    start = int(content[7:9]) if modern else OLD_HEADER
    found = []
    while start < len(content):
        code = content[start : start + 4].rstrip(b"\0").decode("ascii")
        if modern:
            (length,) = struct.unpack_from("<q", content, start + 16)
            data = start + 32
        else:
            (length,) = struct.unpack_from("<i", content, start + 4)
            data = start + 24
        found.append(Block(code, start, data, data + length))
        start = data + length
        if code == "ENDB":
            break
    return found


def first_of_each(content: bytes) -> list[Block]:
    """The first block of each code."""
    found: dict[str, Block] = {}
    for block in blocks_of(content):
        found.setdefault(block.code, block)
    return list(found.values())


def places_of_fields(content: bytes, block: Block) -> dict[str, tuple[int, str]]:
    """Where the fields of a block's header lie, and how they are packed, by their names."""
    if content[7:8].isdigit():
        fields = {"struct": (4, "<i"), "pointer": (8, "<Q"), "length": (16, "<q"), "count": (24, "<q")}
    else:
        fields = {"length": (4, "<i"), "pointer": (8, "<Q"), "struct": (16, "<i"), "count": (20, "<i")}
    return {name: (block.start + offset, packed) for name, (offset, packed) in fields.items()}


def with_field(content: bytes, block: Block, name: str, value: int) -> bytes:
    """The file with another value in a block's header; one that does not fit is cut to the field's bits."""
    place, packed = places_of_fields(content, block)[name]
    size = struct.calcsize(packed)
    return replaced(content, place, (value & ((1 << 8 * size) - 1)).to_bytes(size, "little"))


def replaced(content: bytes, place: int, by: bytes) -> bytes:
    """The file with other bytes from this place on."""
    return content[:place] + by + content[place + len(by) :]


def with_flipped_bits(content: bytes, first: int, last: int, *, seed: int, count: int = 1) -> bytes:
    """The file with so many bits flipped between two places."""
    changed, at_random = bytearray(content), random.Random(seed)
    for _ in range(count):
        changed[at_random.randrange(first, max(last, first + 1))] ^= 1 << at_random.randrange(8)
    return bytes(changed)


def truncations(content: bytes) -> Iterator[tuple[str, bytes]]:
    """The file's beginnings: within its header, and for each kind of block before, in and behind one."""
    blocks = blocks_of(content)
    for length in sorted({7, 8, 9, 11, 12, 13, 16, blocks[0].start - 1, blocks[0].start}):
        yield f"after {length} bytes", content[:length]
    for block in first_of_each(content):
        middle = (block.data + block.end) // 2
        yield f"in the header of {block.code}", content[: block.start + 6]
        if block.code != "ENDB":
            yield f"in the data of {block.code}", content[:middle]
            yield f"behind {block.code}", content[: block.end]
    dna = next(block for block in blocks if block.code == "DNA1")
    for share in (0.02, 0.1, 0.3, 0.6, 0.8, 0.95, 0.999):
        yield f"in DNA1, at {100 * share:g} %", content[: dna.data + int(share * (dna.end - dna.data))]
    for share in (0.05, 0.2, 0.4, 0.75, 0.9):
        yield f"at {100 * share:g} % of the file", content[: int(share * len(content))]


def zstd(content: bytes) -> bytes:
    """A Zstandard frame of uncompressed blocks."""
    # Version 1, one segment, 8 bytes of content size, no checksum, no dictionary.
    frame = bytearray(ZSTD_MAGIC + b"\xe0" + struct.pack("<Q", len(content)))
    for start in range(0, max(len(content), 1), ZSTD_BLOCK):
        part = content[start : start + ZSTD_BLOCK]
        frame += _block_header(len(part), kind=0, last=start + ZSTD_BLOCK >= len(content)) + part
    return bytes(frame)


def zstd_bomb(beginning: bytes, length: int) -> bytes:
    """A small Zstandard frame of this beginning and zeros up to this length."""
    # No content size, a window of 2^22 bytes.
    frame = bytearray(ZSTD_MAGIC + b"\x00" + b"\x60")
    frame += _block_header(len(beginning), kind=0, last=False) + beginning
    for _ in range(length // ZSTD_BLOCK):
        frame += _block_header(ZSTD_BLOCK, kind=1, last=False) + b"\0"
    return bytes(frame + _block_header(1, kind=1, last=True) + b"\0")


def skippable(content: bytes) -> bytes:
    """A Zstandard frame that readers pass over."""
    return struct.pack("<II", 0x184D2A50, len(content)) + content


def _block_header(size: int, *, kind: int, last: bool) -> bytes:
    return (size << 3 | kind << 1 | last).to_bytes(3, "little")
