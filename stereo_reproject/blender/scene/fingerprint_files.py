"""Lines for a fingerprint from files of datablocks, packed or not: by content, wherever they lie."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import bpy

from .file_digest import file_digest, files_digest, sequence_digest
from .fingerprint_arrays import digest_of, pixels_digest

TILE = re.compile(r"<UDIM>|<UVTILE>")
BUILTIN = "<builtin>"


class Files:
    """The files that datablocks use, as lines for a fingerprint (`lines`). Each file is read once, however many
    datablocks use it.
    """

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._known: dict[tuple[Path, str], str] = {}

    def add(self, owner: str, block: bpy.types.ID, path: str) -> None:
        """Add a line for the file that the property `path` of a datablock points to; owner names the datablock in it.
        Nothing is added for an empty path, a builtin, or a packed file.
        """
        if not path or path == BUILTIN or getattr(block, "packed_file", None):
            return
        numbered = getattr(block, "is_sequence", False) or getattr(block, "source", "") == "SEQUENCE"
        found = Path(bpy.path.abspath(path, library=block.library))
        self.lines.append(f"{owner} {self._digest(found, 'sequence' if numbered else 'file')}")

    def add_image(self, owner: str, image: bpy.types.Image) -> None:
        """Add a line for the file of an image, its sequence or its tiles; owner names the image in it. Nothing is added
        for a packed or generated image.
        """
        if image.source == "TILED" and not image.packed_files:
            found = Path(bpy.path.abspath(image.filepath, library=image.library))
            numbers = [str(tile.number) for tile in image.tiles]
            tiles = {number: found.with_name(TILE.sub(number, found.name)) for number in numbers}
            self.lines.append(f"{owner} {files_digest(tiles)}")
        elif image.source in ("FILE", "SEQUENCE", "MOVIE") and not image.packed_files:
            self.add(owner, image, image.filepath)

    def _digest(self, path: Path, kind: str) -> str:
        """Return the digest of a file, or of all files of its sequence if kind is "sequence"."""
        if (path, kind) not in self._known:
            self._known[path, kind] = sequence_digest(path) if kind == "sequence" else file_digest(path)
        return self._known[path, kind]


def image_lines(image: bpy.types.Image) -> Iterator[str]:
    """Yield a fingerprint's lines for what an image itself holds: packed files, what it is generated from, unsaved
    pixels. No image is loaded for it.
    """
    for packed in image.packed_files:
        yield f"packed {packed.view} {packed.tile_number} {packed_digest(packed.packed_file)}"
    if image.source == "GENERATED":
        size = (image.generated_width, image.generated_height)
        yield f"{image.generated_type} {size} {image.use_generated_float} {tuple(image.generated_color)}"
    if image.is_dirty:
        yield f"pixels {pixels_digest(image)}"


def packed_digest(packed: bpy.types.PackedFile | None) -> str:
    """Return the digest of a packed file's content; "" for None."""
    return "" if packed is None else digest_of(packed.data)
