"""PNG files: their pixels, read back by the format's own rules, and places that cannot be written."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from stereo_reproject.errors import BadInputError
from stereo_reproject.images.png import SIGNATURE, write_png, write_png_bands

FULL_DISK = Path("/dev/full")


def picture(height: int = 7, width: int = 5) -> np.ndarray:
    return np.random.default_rng(0).integers(0, 256, (height, width, 3)).astype(np.uint8)


def chunks_of(content: bytes) -> dict[bytes, bytes]:
    """Chunks of a PNG by kind, their checksums checked."""
    assert content.startswith(SIGNATURE)
    found, at = {}, len(SIGNATURE)
    while at < len(content):
        (length,) = struct.unpack_from(">I", content, at)
        kind, data = content[at + 4 : at + 8], content[at + 8 : at + 8 + length]
        assert struct.unpack_from(">I", content, at + 8 + length) == (zlib.crc32(kind + data),)
        found[kind] = found.get(kind, b"") + data
        at += 12 + length
    return found


@pytest.mark.parametrize("cut", [np.s_[:], np.s_[::-1], np.s_[:, ::2]])
def test_a_png_has_the_pixels_that_were_written(tmp_path, cut):
    written = picture()[cut]
    height, width = written.shape[:2]
    write_png(tmp_path / "a.png", written)
    chunks = chunks_of((tmp_path / "a.png").read_bytes())
    assert [*chunks] == [b"IHDR", b"IDAT", b"IEND"]
    assert struct.unpack(">IIBBBBB", chunks[b"IHDR"]) == (width, height, 8, 2, 0, 0, 0)
    rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(height, 1 + 3 * width)
    assert not rows[:, 0].any(), "a row's filter"
    np.testing.assert_array_equal(rows[:, 1:].reshape(height, width, 3), written)


def test_a_png_in_bands_is_the_same_picture_and_each_is_written_before_the_next(tmp_path):
    written, path = picture(), tmp_path / "a.png"
    sizes = []

    def bands():
        for k in range(0, len(written), 3):
            sizes.append(path.stat().st_size)
            yield written[k : k + 3]

    write_png_bands(path, (written.shape[1], len(written)), bands(), texts={"Frame": "7", "Note": "Grüße"})
    chunks = chunks_of(path.read_bytes())
    assert [*chunks] == [b"IHDR", b"iTXt", b"IDAT", b"IEND"]
    assert chunks[b"iTXt"] == b"Frame\0\0\0\0\x007" + b"Note\0\0\0\0\0" + "Grüße".encode()
    write_png(tmp_path / "whole.png", written)
    whole = chunks_of((tmp_path / "whole.png").read_bytes())
    assert zlib.decompress(chunks[b"IDAT"]) == zlib.decompress(whole[b"IDAT"])
    assert len(sizes) == 3


def test_a_place_that_cannot_be_written_is_bad_input(tmp_path):
    (tmp_path / "folder.png").mkdir()
    for path in (tmp_path / "missing" / "a.png", tmp_path / "folder.png"):
        with pytest.raises(BadInputError, match=path.name):
            write_png(path, picture())


@pytest.mark.skipif(not FULL_DISK.exists(), reason="a device that is always full, as Linux has it")
def test_a_full_disk_is_bad_input(tmp_path):
    (tmp_path / "a.png").symlink_to(FULL_DISK)
    with pytest.raises(BadInputError, match="full"):
        write_png(tmp_path / "a.png", picture())
