"""The marks that say in an MKV or WebM file how its eyes are laid out and which part of the sphere they see: Matroska's
StereoMode and Projection.

Elements are those of EBML (RFC 8794): number, size, content. In a movie (RFC 9559) Segment holds SeekHead with
the places of the others, Void, Info, Tracks, Tags, Clusters with the pictures, Cues. libavformat leaves a Void
behind SeekHead: Tracks grows into it, what lies between moves to the front, and nothing behind Tracks changes.

DisplayWidth and DisplayHeight are the size of one eye's picture (RFC 9559, 18.10), so they go with StereoMode.

Blender 5.2 marks its movies itself; which eye is first differs from movie to movie for no reason, and squeezed pictures
are taken for whole ones. So a mark that is there already counts for nothing.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

from ..errors import BadInputError
from ..words import Words
from .mp4 import damaged
from .projection import MoviePanorama
from .splicing import Edit, splice

EBML, DOC_TYPE, SEGMENT = 0x1A45DFA3, 0x4282, 0x18538067
SEEK_HEAD, SEEK, SEEK_POSITION, VOID, CRC_32 = 0x114D9B74, 0x4DBB, 0x53AC, 0xEC, 0xBF
CLUSTER, TRACKS, TRACK_ENTRY, TRACK_TYPE, VIDEO = 0x1F43B675, 0x1654AE6B, 0xAE, 0x83, 0xE0
PIXEL_WIDTH, PIXEL_HEIGHT = 0xB0, 0xBA
STEREO_MODE, DISPLAY_WIDTH, DISPLAY_HEIGHT = 0x53B8, 0x54B0, 0x54BA
PROJECTION, PROJECTION_TYPE, PROJECTION_PRIVATE = 0x7670, 0x7671, 0x7672
PROJECTION_POSES = (0x7673, 0x7674, 0x7675)
"""Yaw, pitch and roll, in degrees."""

VIDEO_TRACK = 1
EQUIRECTANGULAR = 1
"""A ProjectionType."""

WEBM_MODES = frozenset({0, 1, 2, 3, 11})
"""Values of StereoMode that WebM has (WebM Project, "WebM Container Guidelines")."""

DOUBLED = {**dict.fromkeys((1, 8, 9, 11), (2, 1)), **dict.fromkeys((2, 3, 6, 7), (1, 2))}
"""Factors by which libavformat takes the frame to be wider and higher than one eye's picture, by StereoMode."""

MAX_HEADER_BYTES = 12
"""Bytes: four of number and eight of size."""

MAX_HEAD_BYTES = 1 << 28
"""Bytes up to the end of Tracks, in memory; attached files may lie before them."""


@dataclass(frozen=True)
class Element:
    """One element of a Matroska file. Its header starts at `start`, its content is [content, stop), all in bytes from
    the beginning of the data that it was read from. number is its ID, and width the number of bytes that hold its
    size."""

    number: int
    width: int
    start: int
    content: int
    stop: int


@dataclass(frozen=True)
class _Head:
    """The beginning of a Matroska file, up to the end of its Tracks. data are these bytes; origin is where the content
    of Segment begins, from which the places in SeekHead count; elements are those of Segment, in order, Tracks being
    the last."""

    data: bytes
    origin: int
    elements: list[Element]


def write_marks(
    path: Path,
    mode: int | None,
    panorama: MoviePanorama | None = None,
    *,
    across: int = 1,
    down: int = 1,
) -> None:
    """Set StereoMode of the first video track of an MKV or WebM file to `mode`, and its Projection to that of
    `panorama`; what is None is removed. The file is replaced by a changed copy.

    across, down: the number of pictures of full size side by side and above one another in a frame; both are 1 where
    eyes are squeezed or interlaced. The pixels keep their aspect. Raises StereoReprojectError if the file is damaged,
    and BadInputError if it cannot be read, has no room for the marks, or is a stream of unknown size. After an error
    the file is as it was.
    """
    try:
        with path.open("rb") as file:
            head = _read_head(file, path.name)
    except OSError as error:
        raise BadInputError(
            Words("{path} cannot be read ({reason})", path=path, reason=error.strerror or str(error))
        ) from error
    tracks = head.elements[-1]
    try:
        new = _with_video(head.data, tracks, lambda video: _marked(head.data, video, mode, panorama, (across, down)))
    except (ValueError, IndexError, KeyError, StopIteration) as error:
        raise damaged(path.name) from error
    if new != head.data[tracks.start : tracks.stop]:
        splice(path, _fitted(head, new, path.name))


def doc_type(path: Path) -> str:
    """Return the type of a file by its EBML header: "matroska", "webm", or another; "" if it has no such header. Raises
    OSError."""
    with path.open("rb") as file:
        data = file.read(1024)
    try:
        header = _element(data, 0, len(data))
        found = next((e for e in _elements(data, header.content, header.stop) if e.number == DOC_TYPE), None)
    except (ValueError, IndexError):
        return ""
    return data[found.content : found.stop].rstrip(b"\0").decode("ascii", "replace") if found else ""


def _read_head(file: BinaryIO, name: str) -> _Head:
    """Return the beginning of an open file up to the end of Tracks. `name` is the file's name for messages. Raises
    StereoReprojectError if the file is damaged or has no Tracks before its pictures."""
    end = file.seek(0, 2)
    segment = _outer(file, _outer(file, 0, name).stop, name)
    if segment.number != SEGMENT or segment.stop > end:
        raise damaged(name)
    elements = [_outer(file, segment.content, name)]
    while elements[-1].number != TRACKS:
        elements.append(_outer(file, elements[-1].stop, name))
        if elements[-1].number == CLUSTER:
            raise damaged(name)
    if elements[-1].stop > min(segment.stop, MAX_HEAD_BYTES):
        raise damaged(name)
    file.seek(0)
    return _Head(file.read(elements[-1].stop), segment.content, elements)


def _outer(file: BinaryIO, start: int, name: str) -> Element:
    """Return the element whose header starts at byte `start` of a file; only the header is read. `name` is the file's
    name for messages. Raises StereoReprojectError if the file ends there, and BadInputError if the element's size is
    unknown."""
    file.seek(start)
    try:
        found = _element(file.read(MAX_HEADER_BYTES), 0, None)
    except IndexError as error:
        raise damaged(name) from error
    except ValueError as error:
        raise BadInputError(
            Words("{name} is a stream or unfinished: its size is not known; write it again", name=name)
        ) from error
    return replace(found, start=start, content=found.content + start, stop=found.stop + start)


def _element(data: bytes, start: int, stop: int | None) -> Element:
    """Return the element whose header starts at `start` in `data`. Raises ValueError if its size is unknown or if it
    goes on beyond `stop` (None for no limit), IndexError if the data end within its header."""
    number, at = _variable(data, start, keep_marker=True)
    size, content = _variable(data, at, keep_marker=False)
    width = content - at
    if size == (1 << 7 * width) - 1 or (stop is not None and content + size > stop):
        raise ValueError
    return Element(number, width, start, content, content + size)


def _variable(data: bytes, at: int, *, keep_marker: bool) -> tuple[int, int]:
    """Return a number of variable length (RFC 8794, 4) that starts at `at`, and the place where it ends. keep_marker
    leaves in the bit that tells the length, as in IDs. Raises IndexError if it is not whole."""
    length = 9 - data[at].bit_length()
    value = int.from_bytes(data[at : at + length])
    if length > 8 or at + length > len(data):
        raise IndexError
    return value if keep_marker else value & (1 << 7 * length) - 1, at + length


def _elements(data: bytes, start: int, stop: int) -> Iterator[Element]:
    """Yield the elements that follow one another in data[start:stop]. Raises as `_element` does."""
    while start < stop:
        element = _element(data, start, stop)
        yield element
        start = element.stop


def _with_video(data: bytes, tracks: Element, changed: Callable[[Element], bytes]) -> bytes:
    """Return the bytes of the Tracks element with other content in the Video element of its first video track:
    `changed` returns that content. Raises ValueError where there is no video track, and other errors where the data are
    damaged."""
    for entry in _elements(data, tracks.content, tracks.stop):
        children = list(_elements(data, entry.content, entry.stop)) if entry.number == TRACK_ENTRY else []
        kind = next((_uint(data, e) for e in children if e.number == TRACK_TYPE), None)
        if kind == VIDEO_TRACK:
            video = next(e for e in children if e.number == VIDEO)
            new_video = _master(video, changed(video))
            new_entry = _master(entry, _with(data, entry, video, new_video))
            return _master(tracks, _with(data, tracks, entry, new_entry))
    raise ValueError


def _marked(
    data: bytes, video: Element, mode: int | None, panorama: MoviePanorama | None, eyes: tuple[int, int]
) -> bytes:
    """Return the content of a Video element with StereoMode set to `mode` and the size for display that goes with it,
    and with the Projection of `panorama`; None removes either. eyes are `across` and `down` of `write_marks`."""
    children = list(_elements(data, video.content, video.stop))
    values = {element.number: _uint(data, element) for element in children}
    projection = b"" if panorama is None else _projection(panorama)
    marks: tuple[int, ...] = (PROJECTION,)
    if mode is None and STEREO_MODE not in values:
        return _without(data, children, marks) + projection
    marks += (STEREO_MODE, DISPLAY_WIDTH, DISPLAY_HEIGHT)
    width, height = _frame_shape(values)
    across, down = eyes
    # A ratio that stays whole numbers.
    width, height = (width // across, height) if width % across == 0 else (width, height * across)
    width, height = (width, height // down) if height % down == 0 else (width * down, height)
    mark = b"" if mode is None else _unsigned(STEREO_MODE, mode)
    size = _unsigned(DISPLAY_WIDTH, width) + _unsigned(DISPLAY_HEIGHT, height)
    return _without(data, children, marks) + mark + size + projection


def _without(data: bytes, elements: list[Element], numbers: tuple[int, ...]) -> bytes:
    """Return the bytes of these elements but for those with one of these IDs."""
    return b"".join(data[e.start : e.stop] for e in elements if e.number not in numbers)


def _projection(panorama: MoviePanorama) -> bytes:
    """Return the bytes of a Projection element."""
    poses = b"".join(_short(number, bytes(4)) for number in PROJECTION_POSES)
    kind = _unsigned(PROJECTION_TYPE, EQUIRECTANGULAR)
    return _short(PROJECTION, kind + _short(PROJECTION_PRIVATE, panorama.equi) + poses)


def _frame_shape(values: dict[int, int]) -> tuple[int, int]:
    """Return (width, height) at which the whole frame, with both eyes in it, is to be shown so that its pixels keep
    their aspect. values are the numbers in the track's Video element, by ID."""
    pixels = values[PIXEL_WIDTH], values[PIXEL_HEIGHT]
    width, height = values.get(DISPLAY_WIDTH, pixels[0]), values.get(DISPLAY_HEIGHT, pixels[1])
    across, down = DOUBLED.get(values.get(STEREO_MODE, 0), (1, 1))
    # One eye's size that has the frame's own shape: the eyes are squeezed and the pixels square.
    if width * pixels[1] == height * pixels[0]:
        return width, height
    return width * across, height * down


def _uint(data: bytes, element: Element) -> int:
    """Return the unsigned number that is the content of an element."""
    return int.from_bytes(data[element.content : element.stop])


def _unsigned(number: int, value: int) -> bytes:
    """Return the bytes of an element with a two-byte ID, `number`, whose content is an unsigned number, `value`."""
    return _short(number, value.to_bytes(max((value.bit_length() + 7) // 8, 1)))


def _short(number: int, content: bytes) -> bytes:
    """Return the bytes of an element with a two-byte ID, `number`, and less than 127 bytes of content."""
    return number.to_bytes(2) + bytes([0x80 | len(content)]) + content


def _with(data: bytes, parent: Element, child: Element, new: bytes) -> bytes:
    """Return the content of `parent` with one of its children, `child`, replaced by the bytes `new`."""
    return data[parent.content : child.start] + new + data[child.stop : parent.stop]


def _master(old: Element, content: bytes) -> bytes:
    """Return the bytes of an element like `old` with another content. If the content begins with a checksum (RFC 8794,
    11.3.1), that is computed anew."""
    content = _summed(content)
    width = old.width
    while len(content) >= (1 << 7 * width) - 1:
        width += 1
    number = old.number.to_bytes((old.number.bit_length() + 7) // 8)
    return number + (len(content) | 1 << 7 * width).to_bytes(width) + content


def _summed(content: bytes) -> bytes:
    """Return an element's content with its checksum made right; content without a checksum stays as it is."""
    if content[:2] != bytes([CRC_32, 0x84]):
        return content
    return content[:2] + zlib.crc32(content[6:]).to_bytes(4, "little") + content[6:]


def _fitted(head: _Head, tracks: bytes, name: str) -> list[Edit]:
    """Return the edits of the file that put `tracks`, the bytes of the new Tracks, in place of the old ones, with
    nothing behind Tracks moved.

    A Void element before Tracks becomes smaller or larger by the difference in size, what lies between moves, and
    SeekHead gets the new places. Raises BadInputError if no Void before Tracks is large enough; `name` is the file's
    name for messages.
    """
    *elements, old = head.elements
    growth = len(tracks) - (old.stop - old.start)
    edits = [Edit(old.start, old.stop, tracks)]
    if not growth:
        return edits
    room = next((e for e in elements if e.number == VOID and _void(e.stop - e.start - growth) is not None), None)
    if room is None:
        raise BadInputError(
            Words("{name} has no room for the mark of its stereo layout; write it with Blender", name=name)
        )
    edits.append(Edit(room.start, room.stop, _void(room.stop - room.start - growth) or b""))
    places = [element.start - head.origin for element in head.elements if element.start > room.start]
    moved = {place: place - growth for place in places}
    try:
        edits += [_relocated(head.data, e, moved) for e in elements if e.number == SEEK_HEAD]
    except (ValueError, IndexError, OverflowError) as error:
        raise damaged(name) from error
    return edits


def _void(size: int) -> bytes | None:
    """Return the bytes of a Void element, a placeholder, of exactly `size` bytes in all; b"" for 0, and None for a size
    that no Void can have here."""
    if size == 0:
        return b""
    if size < 2 or size > 1 << 24:
        return None
    width = 1 if size - 2 < 0x7F else 8
    content = size - 1 - width
    return bytes([VOID]) + (content | 1 << 7 * width).to_bytes(width) + bytes(content)


def _relocated(data: bytes, seek_head: Element, moved: dict[int, int]) -> Edit:
    """Return the edit of a SeekHead element that replaces the places in it by `moved`, the new place for each old one;
    others stay."""
    content = bytearray(data[seek_head.content : seek_head.stop])
    for seek in _elements(data, seek_head.content, seek_head.stop):
        for element in _elements(data, seek.content, seek.stop) if seek.number == SEEK else ():
            if element.number == SEEK_POSITION and _uint(data, element) in moved:
                start, stop = element.content - seek_head.content, element.stop - seek_head.content
                content[start:stop] = moved[_uint(data, element)].to_bytes(stop - start)
    return Edit(seek_head.content, seek_head.stop, _summed(bytes(content)))
