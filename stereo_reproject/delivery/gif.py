"""Animated GIF files, which play for ever wherever a picture can be shown.

Source: CompuServe, "Graphics Interchange Format, Version 89a" (1990), with Netscape's application extension for loops.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInputError
from ..words import Words
from .palette import in_palette, palette_of

PALETTE_COLOURS = 256
MAX_SIDE_PX = 65535
"""Largest width and height that the file's header can hold."""

LOOP_FOREVER = b"\x21\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00"
KEEP = 1 << 2
"""Disposal method of a picture: it stays until the next one is drawn over it (section 23)."""

WHOLE_PALETTE = 0xF7
"""Flags of the header: one palette of 256 colours of 8 bits for all pictures (section 18)."""

PIXEL_BITS = 8
CLEAR, END, FIRST_CODE = 256, 257, 258
"""Codes of LZW for pixels of 8 bits: two that are none of a string of pixels, and the first of those that are."""

MAX_CODE_BITS = 12
MAX_BLOCK_BYTES = 255
TRAILER = b"\x3b"


def write_gif(path: Path, pictures: Sequence[NDArray[np.uint8]], seconds: float) -> None:
    """Write pictures (H, W, 3) of one size, in bytes as a screen shows them, as a GIF that shows each for `seconds` and
    begins anew for ever. All have one palette, so that what stands still does not flicker.

    Raises BadInputError where the pictures are too large for a GIF, and OSError.
    """
    height, width = pictures[0].shape[:2]
    if max(height, width) > MAX_SIDE_PX:
        raise BadInputError(
            Words(
                "a GIF has at most {max_side_px} pixels along a side, not {side}",
                max_side_px=MAX_SIDE_PX,
                side=max(height, width),
            )
        )
    palette = palette_of(np.stack(list(pictures)), PALETTE_COLOURS)
    table = np.zeros((PALETTE_COLOURS, 3), np.uint8)
    table[: len(palette)] = palette
    header = b"GIF89a" + struct.pack("<HHBBB", width, height, WHOLE_PALETTE, 0, 0)
    frames = [_frame(in_palette(picture, palette), seconds) for picture in pictures]
    path.write_bytes(b"".join([header, table.tobytes(), LOOP_FOREVER, *frames, TRAILER]))


def _frame(indices: NDArray[np.uint8], seconds: float) -> bytes:
    """Return one picture (H, W), given by entries of the palette, as the file has it: how long it is shown, its place,
    and its pixels.
    """
    height, width = indices.shape
    # A browser takes 0 and 1 for a mistake, and shows such a picture for longer.
    hundredths = max(round(100.0 * seconds), 2)
    control = struct.pack("<BBBBHBB", 0x21, 0xF9, 4, KEEP, hundredths, 0, 0)
    place = struct.pack("<BHHHHB", 0x2C, 0, 0, width, height, 0)
    packed = packed_pixels(indices.ravel())
    blocks = [packed[k : k + MAX_BLOCK_BYTES] for k in range(0, len(packed), MAX_BLOCK_BYTES)]
    return control + place + bytes([PIXEL_BITS]) + b"".join(bytes([len(b)]) + b for b in blocks) + b"\0"


def packed_pixels(indices: NDArray[np.uint8]) -> bytes:
    """Return pixels (N) as LZW packs them for a GIF (appendix F): codes of 9 to 12 bits, the lowest bit first."""
    codes, bits = _lzw(indices.tobytes())
    sizes = np.array(bits, np.int64)
    starts = np.cumsum(sizes) - sizes
    places = np.arange(sizes.sum()) - np.repeat(starts, sizes)
    return np.packbits((np.repeat(np.array(codes, np.int64), sizes) >> places) & 1, bitorder="little").tobytes()


def _lzw(pixels: bytes) -> tuple[list[int], list[int]]:
    """Return the codes of a row of pixels, and how many bits each has."""
    codes, bits = [CLEAR], [PIXEL_BITS + 1]
    strings: dict[int, int] = {}
    size, following = PIXEL_BITS + 1, FIRST_CODE
    prefix = pixels[0]
    for pixel in pixels[1:]:
        # A string is known by the code of all but its last pixel, and that pixel.
        string = prefix << PIXEL_BITS | pixel
        known = strings.get(string)
        if known is not None:
            prefix = known
            continue
        codes.append(prefix)
        bits.append(size)
        if following < 1 << MAX_CODE_BITS:
            strings[string] = following
            # A reader learns this code from the next one: from that on it expects the longer ones.
            size += following == 1 << size
            following += 1
        else:
            codes.append(CLEAR)
            bits.append(size)
            strings.clear()
            size, following = PIXEL_BITS + 1, FIRST_CODE
        prefix = pixel
    last = min(size + (following == 1 << size), MAX_CODE_BITS)
    return [*codes, prefix, END], [*bits, size, last]
