"""The marks that say in an MP4 or MOV file how its eyes are laid out and which part of the sphere they see: Google's
st3d and sv3d boxes, and in HEVC movies of panoramas Apple's vexu and hfov.

Boxes are those of ISO/IEC 14496-12: size, type, content; the video's are moov, trak, mdia, minf, stbl, stsd, then the
sample entry (avc1, hvc1, apcn ...), in which the marks are. Source: Google, "Spherical Video V2 RFC".

Blender 5.2 puts Apple's own marks, vexu and hfov, into MOV files; part of what it writes there differs from movie to
movie for no reason, which eye is first among it. So those go when these come.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from ..errors import BadInputError, StereoReprojectError
from ..words import Words
from .projection import MoviePanorama, box_bytes, mp4_boxes
from .splicing import Edit, splice

PATH_TO_ENTRIES = (b"mdia", b"minf", b"stbl", b"stsd")
MARKS = (b"st3d", b"sv3d", b"vexu", b"hfov")
AFTER_THE_MARKS = (b"pasp", b"clap")
"""The RFC has them follow the marks."""

HEVC = (b"hvc1", b"hev1")
"""Sample entries in which Apple's players look for marks."""

VISUAL_SAMPLE_ENTRY = 78
"""Bytes of its own before its boxes (ISO/IEC 14496-12, 12.1.3)."""

SIZE_32, SIZE_64 = 8, 16
"""Bytes of a box's header, with a 32-bit and with a 64-bit size."""

MAX_MOOV_BYTES = 1 << 30
"""Bytes; what is larger is no description of a movie but a damaged number."""


@dataclass(frozen=True)
class Box:
    """One box of an MP4 file: its type, and its place in the file in bytes. The header is [start, content), the content
    [content, stop). open_ended is True for a box that has no size of its own and goes on to the end of the file."""

    kind: bytes
    start: int
    content: int
    stop: int
    open_ended: bool = False


@dataclass(frozen=True)
class _Moov:
    """The bytes of an MP4's moov box, which describes the movie. `start` is the box's place in the file: all places in
    the methods count from the beginning of the file. `name` is the file's name for messages."""

    start: int
    data: bytes
    name: str

    def read(self, start: int, stop: int) -> bytes:
        """Return the bytes [start, stop) of the file."""
        return self.data[start - self.start : stop - self.start]

    def number(self, start: int, size: int = 4) -> int:
        """Return the unsigned number of `size` bytes at `start`."""
        return int.from_bytes(self.read(start, start + size))

    def boxes(self, start: int, stop: int) -> Iterator[Box]:
        """Yield the boxes that follow one another in [start, stop). Raises StereoReprojectError where one does not fit
        in there."""
        # QuickTime may end a list of boxes with four zero bytes.
        while start + SIZE_32 <= stop:
            size, kind = struct.unpack(">I4s", self.read(start, start + SIZE_32))
            header = SIZE_32
            if size == 1:
                header, size = SIZE_64, self.number(start + SIZE_32, 8)
            if not header <= size <= stop - start:
                raise damaged(self.name)
            yield Box(kind, start, start + header, start + size)
            start += size

    def child(self, parent: Box, kind: bytes) -> Box | None:
        """Return the first box of type `kind` directly inside `parent`; None without one."""
        return next((box for box in self.boxes(parent.content, parent.stop) if box.kind == kind), None)

    def descendants(self, parent: Box, kinds: tuple[bytes, ...]) -> list[Box] | None:
        """Return the boxes of these types, each inside the one before and the first inside `parent`; None where one is
        missing."""
        found: list[Box] = []
        for kind in kinds:
            box = self.child(found[-1] if found else parent, kind)
            if box is None:
                return None
            found.append(box)
        return found


def damaged(name: str) -> StereoReprojectError:
    """Return the error for a movie, called `name`, that is not whole."""
    return StereoReprojectError(
        Words("{name} is not a whole movie; was the rendering stopped or is the disk full?", name=name)
    )


def write_marks(path: Path, mode: int | None, panorama: MoviePanorama | None = None) -> None:
    """Set the stereo layout and the projection of the first video track of an MP4 or MOV file: put in an st3d box with
    the value `mode`, or none if that is None, and boxes that say which part of the sphere is shown, or none if
    `panorama` is None. Marks that are there already are removed, Apple's included. The file is replaced by a changed
    copy.

    Raises StereoReprojectError if the file is damaged, and BadInputError if it cannot be read or written, has no room
    for the marks, or is a kind of MP4 that is not supported. After an error the file is as it was.
    """
    try:
        with path.open("rb") as file:
            moov_box, moov = _read_moov(file, path.name)
    except OSError as error:
        raise BadInputError(
            Words("{path} cannot be read ({reason})", path=path, reason=error.strerror or str(error))
        ) from error
    edits, ancestors = _mark_edits(moov, moov_box, mode, panorama)
    growth = sum(edit.growth for edit in edits)
    if not any(edit.new or edit.stop > edit.start for edit in edits):
        return
    if growth:
        edits += _offset_edits(moov, moov_box, growth)
        edits += [_resized(box, growth) for box in ancestors if not box.open_ended]
    splice(path, edits)


def _read_moov(file: BinaryIO, name: str) -> tuple[Box, _Moov]:
    """Return the moov box of an open file, and its content. `name` is the file's name for messages. Raises
    StereoReprojectError if it is missing or damaged, BadInputError for a fragmented movie."""
    boxes = list(_top_boxes(file, name))
    if any(box.kind == b"moof" for box in boxes):
        raise BadInputError(
            Words("{name} is a fragmented movie, which is not supported; write it unfragmented", name=name)
        )
    box = next((box for box in boxes if box.kind == b"moov"), None)
    if box is None or box.stop - box.start > MAX_MOOV_BYTES:
        raise damaged(name)
    file.seek(box.start)
    return box, _Moov(box.start, file.read(box.stop - box.start), name)


def _top_boxes(file: BinaryIO, name: str) -> Iterator[Box]:
    """Yield the outermost boxes of an open file, of which only the headers are read. `name` is the file's name for
    messages. Raises StereoReprojectError where one is not whole."""
    end, start = file.seek(0, 2), 0
    while start < end:
        file.seek(start)
        header = file.read(SIZE_64)
        if len(header) < SIZE_32:
            raise damaged(name)
        size, kind = struct.unpack(">I4s", header[:SIZE_32])
        length, open_ended = SIZE_32, size == 0
        if size == 1:
            length, size = SIZE_64, int.from_bytes(header[SIZE_32:])
        elif open_ended:
            size = end - start
        if not length <= size <= end - start:
            raise damaged(name)
        yield Box(kind, start, start + length, start + size, open_ended)
        start += size


def _mark_edits(
    moov: _Moov, moov_box: Box, mode: int | None, panorama: MoviePanorama | None
) -> tuple[list[Edit], list[Box]]:
    """Return the edits that set the marks in the first video track (see `write_marks`), and the boxes around them,
    whose sizes change with them. Raises StereoReprojectError where there is no video track."""
    for track in moov.boxes(moov_box.content, moov_box.stop):
        way = moov.descendants(track, PATH_TO_ENTRIES) if track.kind == b"trak" else None
        if way and _is_video(moov, way[0]):
            entries = way[-1]
            # Version, flags and the number of entries come first.
            entry = next(moov.boxes(entries.content + 8, entries.stop), None)
            if entry is None or entry.content + VISUAL_SAMPLE_ENTRY > entry.stop:
                raise damaged(moov.name)
            return _entry_edits(moov, entry, _marks(entry, mode, panorama)), [moov_box, track, *way, entry]
    raise damaged(moov.name)


def _is_video(moov: _Moov, media: Box) -> bool:
    """Return True if the mdia box `media` is that of a video track."""
    handler = moov.child(media, b"hdlr")
    return handler is not None and moov.read(handler.content + 8, handler.content + 12) == b"vide"


def _marks(entry: Box, mode: int | None, panorama: MoviePanorama | None) -> bytes:
    """Return the boxes that mark a sample entry; see `write_marks`."""
    stereo = b"" if mode is None else box_bytes(b"st3d", bytes(4), bytes([mode]))
    return stereo + (b"" if panorama is None else mp4_boxes(panorama, mode, for_apple=entry.kind in HEVC))


def _entry_edits(moov: _Moov, entry: Box, marks: bytes) -> list[Edit]:
    """Return the edits of a video track's sample entry: old marks are removed, and the boxes `marks` are inserted."""
    boxes = list(moov.boxes(entry.content + VISUAL_SAMPLE_ENTRY, entry.stop))
    edits = [Edit(box.start, box.stop, b"") for box in boxes if box.kind in MARKS]
    if marks:
        end = boxes[-1].stop if boxes else entry.content + VISUAL_SAMPLE_ENTRY
        place = next((box.start for box in boxes if box.kind in AFTER_THE_MARKS), end)
        edits.append(Edit(place, place, marks))
    return edits


def _resized(box: Box, growth: int) -> Edit:
    """Return the edit that makes the size in a box's header larger by `growth` bytes."""
    if box.content - box.start == SIZE_64:
        return Edit(box.start + SIZE_32, box.start + SIZE_64, struct.pack(">Q", box.stop - box.start + growth))
    return Edit(box.start, box.start + 4, struct.pack(">I", box.stop - box.start + growth))


def _offset_edits(moov: _Moov, moov_box: Box, growth: int) -> list[Edit]:
    """Return the edits of the tables that say where in the file pictures and sound lie. What lies behind the moov box
    moves by `growth` bytes; what lies before it stays."""
    edits = []
    for track in moov.boxes(moov_box.content, moov_box.stop):
        tables = moov.descendants(track, PATH_TO_ENTRIES[:3]) if track.kind == b"trak" else None
        for table in moov.boxes(tables[-1].content, tables[-1].stop) if tables else ():
            if table.kind in (b"stco", b"co64"):
                edits.append(_moved(moov, table, ">I" if table.kind == b"stco" else ">Q", moov_box.stop, growth))
    return edits


def _moved(moov: _Moov, table: Box, form: str, behind: int, growth: int) -> Edit:
    """Return the edit of one table of offsets: those from the place `behind` on become larger by `growth`. form is the
    format of one offset for `struct`. Raises BadInputError if an offset becomes too large for it."""
    size = struct.calcsize(form)
    start, count = table.content + 8, moov.number(table.content + 4)
    if start + count * size > table.stop:
        raise damaged(moov.name)
    numbers = [offset for (offset,) in struct.iter_unpack(form, moov.read(start, start + count * size))]
    moved = [offset + growth if offset >= behind else offset for offset in numbers]
    if moved and max(moved) >= 1 << 8 * size:
        raise BadInputError(
            Words("{name}: no room for the mark, its offsets end at 4 GiB; write shorter movies", name=moov.name)
        )
    return Edit(start, start + count * size, struct.pack(f">{count}{form[1]}", *moved))
