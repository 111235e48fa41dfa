"""Damaged, foreign and odd .blend files. Each is rendered, or refused or given up in one line; nothing is left behind,
and the file itself is as it was."""

from __future__ import annotations

import functools
import gzip
import io
import os
import random
import shutil
import tarfile
import zipfile
from collections.abc import Iterable, Iterator
from pathlib import Path

from tests.hostile import byte_damage, kinds_of_files, library_files
from tests.hostile.blends import DONE, EITHER, REFUSED
from tests.hostile.case import Case
from tests.hostile.linked_files import MAIN, linked_sets
from tests.hostile.odd_runs import GIGABYTE, render_beside
from tests.hostile.program import DEMO

TITLE = ".blend files"
SEEN_BEFORE = 179

FLIPPED_BLOCK_HEADERS, FLIPPED_DNA, FLIPPED_DATA, FLIPPED_COMPRESSED = 24, 24, 40, 24
"""Cases of each kind. Where bits are flipped comes from the case's number."""


def cases() -> Iterable[Case]:
    sets = linked_sets()
    plain = (sets / "plain" / MAIN).read_bytes()
    compressed = (sets / "plain" / "compressed.blend").read_bytes()
    yield from _of_bytes("truncated", byte_damage.truncations(plain), EITHER)
    yield from _flipped(plain, compressed)
    yield from _of_bytes("field of a block", _fields(plain), EITHER)
    yield from _of_bytes("header", _headers(plain), EITHER)
    yield from _compressed(plain, compressed)
    yield from _of_bytes("another file called .blend", _foreign(), REFUSED)
    yield from _contents(sets / "contents")
    yield from kinds_of_files.cases(sets / "plain" / MAIN)
    yield from library_files.cases(sets)


# Bytes


def _of_bytes(kind: str, contents: Iterable[tuple[str, bytes]], statuses: tuple[int, ...]) -> Iterator[Case]:
    for name, content in contents:
        yield Case(f"{kind}: {name}", functools.partial(_check_bytes, content, statuses))


def _check_bytes(content: bytes, statuses: tuple[int, ...], folder: Path) -> None:
    (folder / MAIN).write_bytes(content)
    render_beside(folder, statuses)
    assert (folder / MAIN).read_bytes() == content, "the file was changed"


def _flipped(plain: bytes, compressed: bytes) -> Iterator[Case]:
    def flipped(content: bytes, first: int, last: int, seed: int, count: int = 1) -> bytes:
        return byte_damage.with_flipped_bits(content, first, last, seed=seed, count=count)

    blocks = byte_damage.blocks_of(plain)
    dna = next(block for block in blocks if block.code == "DNA1")
    at_random = random.Random(17)
    header = [(f"byte {place}", flipped(plain, place, place + 1, place)) for place in range(blocks[0].start)]
    headers = [
        (f"{number}, of {block.code}", flipped(plain, block.start, block.data, number))
        for number, block in enumerate(at_random.sample(blocks, FLIPPED_BLOCK_HEADERS))
    ]
    in_dna = [(str(seed), flipped(plain, dna.data, dna.end, seed, 1 + seed % 3)) for seed in range(FLIPPED_DNA)]
    data = [
        (str(seed), flipped(plain, blocks[0].start, dna.start, seed, 4 ** (seed % 5))) for seed in range(FLIPPED_DATA)
    ]
    frame = [
        (str(seed), flipped(compressed, 4 if seed % 3 else 0, len(compressed) if seed % 3 else 20, seed))
        for seed in range(FLIPPED_COMPRESSED)
    ]
    yield from _of_bytes("bit flipped in the header", header, EITHER)
    yield from _of_bytes("bit flipped in a block's header", headers, EITHER)
    yield from _of_bytes("bits flipped in DNA1", in_dna, EITHER)
    yield from _of_bytes("bits flipped in blocks", data, EITHER)
    yield from _of_bytes("bit flipped in a compressed file", frame, EITHER)


FIELDS = {
    "length": (0, 1, -1, -8, 1 << 31, (1 << 31) - 1, 1 << 40, (1 << 62)),
    "count": (0, -1, (1 << 31) - 1, 1 << 40, 1 << 62),
    "struct": (0, -1, (1 << 31) - 1, 7),
    "pointer": (0, 1, (1 << 64) - 1),
}


def _fields(plain: bytes) -> Iterator[tuple[str, bytes]]:
    blocks = {block.code: block for block in byte_damage.first_of_each(plain)}
    chosen = [("SC", "count"), ("SC", "struct"), ("OB", "length"), ("ME", "pointer"), ("DATA", "length")]
    chosen += [("DATA", "count"), ("DNA1", "length"), ("GLOB", "struct"), ("CA", "pointer"), ("OB", "struct")]
    for code, field in chosen:
        for value in FIELDS[field]:
            yield f"{field} of {code} is {value}", byte_damage.with_field(plain, blocks[code], field, value)
    for code, other in (("SC", "OB"), ("OB", "SC"), ("CA", "ME"), ("ME", "ZZ"), ("GLOB", "REND"), ("WO", "DATA")):
        place = blocks[code].start
        yield f"code {other} for {code}", byte_damage.replaced(plain, place, other.encode().ljust(4, b"\0"))
    first, second = blocks["SC"], blocks["OB"]
    yield (
        "two blocks at one address",
        byte_damage.replaced(plain, second.start + 8, plain[first.start + 8 : first.start + 16]),
    )
    yield "the scene twice", plain[: first.end] + plain[first.start :]
    yield "blocks in reverse order", _reordered(plain)
    yield "no DNA1", plain[: blocks["DNA1"].start] + plain[blocks["DNA1"].end :]
    yield "DNA1 twice", plain[: blocks["DNA1"].end] + plain[blocks["DNA1"].start :]
    yield "no scene", plain[: first.start] + plain[first.end :]
    yield "no window manager", plain[: blocks["WM"].start] + plain[blocks["WM"].end :] if "WM" in blocks else plain
    yield "something behind the end", plain + b"BLENDER" + plain


def _reordered(plain: bytes) -> bytes:
    blocks = byte_damage.blocks_of(plain)
    parts = [plain[block.start : block.end] for block in blocks[:-2]]
    end = b"".join(plain[block.start : block.end] for block in blocks[-2:])
    return plain[: blocks[0].start] + b"".join(reversed(parts)) + end


def _headers(plain: bytes) -> Iterator[tuple[str, bytes]]:
    """Other headers on the blocks of this file."""
    body = plain[byte_damage.blocks_of(plain)[0].start :]
    for header in (
        b"BLENDER-v999", b"BLENDER-v000", b"BLENDER-v100", b"BLENDER_v279", b"BLENDER-V405", b"BLENDER_V249",
        b"BLENDER-v4 5", b"BLENDER17-01v0502", b"BLENDER17-01v9999", b"BLENDER17-02v0502", b"BLENDER17-99v0502",
        b"BLENDER17-00v0502", b"BLENDER99-01v0502", b"BLENDER16-01v0502", b"BLENDER00-01v0502", b"BLENDER17_01v0502",
        b"BLENDER17-01V0502", b"BLENDER17-01v-502", b"blender-v405", b"BLENDER\0\0\0\0\0", b"BLENDER" * 3,
        b"BLENDER17-01v0502" * 2,
    ):  # fmt: skip
        yield header.decode("ascii").replace("\0", "0"), header + body
    yield "a mark of UTF-8 before it", b"\xef\xbb\xbf" + plain
    yield "line ends as in texts", plain.replace(b"\n", b"\r\n")
    yield "spaces before it", b"    " + plain


# Compressed


def _compressed(plain: bytes, compressed: bytes) -> Iterator[Case]:
    whole = byte_damage.zstd(plain)
    half = len(plain) // 2
    good = [
        ("Zstandard", compressed),
        ("Zstandard, not made smaller", whole),
        ("gzip, as before 3.0", gzip.compress(plain)),
        ("two Zstandard frames", byte_damage.zstd(plain[:half]) + byte_damage.zstd(plain[half:])),
    ]
    odd = [
        ("nothing before a frame", byte_damage.zstd(b"") + whole),
        ("a frame that is passed over, before", byte_damage.skippable(b"hello") + whole),
        ("a frame that is passed over, behind", whole + byte_damage.skippable(b"hello" * 1000)),
        ("frames that are passed over alone", byte_damage.skippable(b"") * 20),
        ("garbage behind", whole + b"garbage" * 100),
        ("garbage within", byte_damage.replaced(compressed, len(compressed) // 2, os.urandom(64))),
        ("zeros within", byte_damage.replaced(compressed, len(compressed) // 3, bytes(4096))),
        ("cut in its frame's header", compressed[:6]),
        ("its magic alone", compressed[:4]),
        ("cut in half", compressed[: len(compressed) // 2]),
        ("without its last byte", compressed[:-1]),
        ("of nothing", byte_damage.zstd(b"")),
        ("of a text", byte_damage.zstd(b"BLENDING is fun\n" * 100)),
        ("of gzip", byte_damage.zstd(gzip.compress(plain))),
        ("of Zstandard", byte_damage.zstd(whole)),
        ("with a dictionary", byte_damage.replaced(whole, 4, b"\xe3")),
        ("with a window of 2^41 bytes", byte_damage.ZSTD_MAGIC + b"\x00\xff" + whole[13:]),
        ("a bomb: 4 GB of zeros", byte_damage.zstd_bomb(b"", 4 * GIGABYTE)),
        ("a bomb: a header and 256 MB of zeros", byte_damage.zstd_bomb(plain[:17], GIGABYTE // 4)),
        ("a bomb within a file", byte_damage.zstd_bomb(plain[: 1 << 17], GIGABYTE // 2)),
        ("its size said to be 2^60", byte_damage.replaced(whole, 5, (1 << 60).to_bytes(8, "little"))),
        ("gzip cut in half", gzip.compress(plain)[:20000]),
        ("gzip with garbage behind", gzip.compress(plain) + b"garbage"),
        ("gzip with garbage within", byte_damage.replaced(gzip.compress(plain), 20000, os.urandom(64))),
        ("two gzips, one behind the other", gzip.compress(plain[:half]) + gzip.compress(plain[half:])),
        ("gzip of nothing", gzip.compress(b"")),
        ("gzip of gzip", gzip.compress(gzip.compress(plain))),
        ("gzip of Zstandard", gzip.compress(whole)),
        ("gzip's first bytes alone", b"\x1f\x8b\x08"),
        ("gzip's magic and a text", b"\x1f\x8bhello"),
        ("gzip: 1 GB of zeros", _gzip_bomb()),
    ]
    yield from _of_bytes("compressed", good, DONE)
    yield from _of_bytes("compressed oddly", odd, EITHER)


def _gzip_bomb() -> bytes:
    part = io.BytesIO()
    with gzip.GzipFile(fileobj=part, mode="wb", compresslevel=9, mtime=0) as file:
        file.write(b"BLENDER-v405" + bytes(16 << 20))
    # Readers take what follows as one file.
    return part.getvalue() * 64


# Other files


def _foreign() -> Iterator[tuple[str, bytes]]:
    yield "nothing", b""
    yield "a zero", b"\0"
    yield "a million zeros", bytes(1_000_000)
    yield "the magic's beginning", b"BLEND"
    yield "random", random.Random(1).randbytes(50_000)
    yield "a text", b"This is no scene.\n" * 100
    yield "HTML of an error page", b"<!DOCTYPE html><html><body>404 Not Found</body></html>"
    yield "JSON", b'{"scene": null}'
    yield "a pointer of Git LFS", b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 12345\n"
    yield "PNG", b"\x89PNG\r\n\x1a\n" + bytes(200)
    yield "EXR", b"\x76\x2f\x31\x01\x02\0\0\0" + bytes(200)
    yield "a program", b"\x7fELF\x02\x01\x01" + bytes(200)
    yield "a script", b"#!/bin/sh\ntouch /tmp/hostile-outside\n"
    yield "PDF", b"%PDF-1.7\n" + bytes(200)
    yield "MP4", b"\0\0\0\x18ftypmp42" + bytes(200)
    yield "UTF-16", "BLENDER-v405".encode("utf-16")
    yield "a zip with a .blend in it", _zip()
    yield "a tar with a .blend in it", _tar()
    yield "BLENDER in lower case", b"blender-v405RENDH" + bytes(200)
    yield "BLENDER alone", b"BLENDER"
    yield "BLENDER and a text", b"BLENDER is a program to make pictures with.\n" * 30
    yield "BLENDER and zeros", b"BLENDER-v405" + bytes(5000)
    yield "BLENDER and zeros, as from 5 on", b"BLENDER17-01v0500" + bytes(5000)
    yield "BLENDER and noise", b"BLENDER-v405" + random.Random(2).randbytes(5000)


def _zip() -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.write(DEMO, "scene.blend")
    return file.getvalue()


def _tar() -> bytes:
    file = io.BytesIO()
    with tarfile.open(fileobj=file, mode="w") as archive:
        archive.add(DEMO, "scene.blend")
    return file.getvalue()


def _contents(contents: Path) -> Iterator[Case]:
    """Files that hold a part of a scene, or a scene that lacks something."""
    for path in sorted(contents.glob("*.blend")):
        statuses = DONE if path.stem == "scenes" else REFUSED
        word = () if statuses == DONE else ("camera",)
        yield _copied(f"holds: {path.stem}", path, statuses, *word)
    yield _copied("a backup of Blender's", linked_sets() / "plain" / MAIN, DONE, name="main.blend1")
    yield _copied("without an extension", linked_sets() / "plain" / MAIN, DONE, name="scene")
    yield _copied("called as a picture", linked_sets() / "plain" / MAIN, DONE, name="scene.png")


def _copied(case: str, path: Path, statuses: tuple[int, ...], *words: str, name: str = MAIN) -> Case:
    def check(folder: Path) -> None:
        shutil.copyfile(path, folder / name)
        render_beside(folder, statuses, *words, main=name)

    return Case(case, check)
