"""The marks of stereo layout and projection in a movie, whichever container it is in."""

from __future__ import annotations

from pathlib import Path

from ..errors import BadInputError
from ..words import Words
from . import matroska, mp4
from .layouts import Layout
from .projection import MoviePanorama

EBML_MAGIC = b"\x1a\x45\xdf\xa3"
MP4_FIRST_BOXES = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip")
"""QuickTime files may begin with any of them."""


def write_marks_of(path: Path, layout: Layout, panorama: MoviePanorama | None = None) -> bool:
    """Mark a movie file with its stereo layout, and with the part of the sphere that it shows (None for a planar one),
    by the means of its container. Return True if the container can say this layout.

    If it cannot, any mark of a layout in an MP4, MOV, MKV or WebM is removed, for it would be wrong (Blender 5.2 writes
    some); other containers, such as AVI, are not changed. Raises StereoReprojectError if the file is damaged, and
    BadInputError if it cannot be read or written; then it is as it was.
    """
    try:
        with path.open("rb") as file:
            magic = file.read(8)
        kind = matroska.doc_type(path) if magic[:4] == EBML_MAGIC else ""
    except OSError as error:
        raise BadInputError(
            Words("{path} cannot be read ({reason})", path=path, reason=error.strerror or str(error))
        ) from error
    if len(magic) < 8:
        raise mp4.damaged(path.name)
    if magic[:4] == EBML_MAGIC:
        mode = None if kind == "webm" and layout.stereo_mode not in matroska.WEBM_MODES else layout.stereo_mode
        across, down = (layout.across, layout.down) if mode else (1, 1)
        matroska.write_marks(path, mode, panorama, across=across, down=down)
        return mode is not None
    if magic[4:] in MP4_FIRST_BOXES:
        mp4.write_marks(path, layout.st3d, panorama)
        return layout.st3d is not None
    return False
