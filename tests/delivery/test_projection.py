"""The part of the sphere that a movie shows, as its marks tell it to players: read by a parser that is not the
writer's, and by FFmpeg."""

import struct

import numpy as np
import pytest

from stereo_reproject.delivery import matroska, mp4
from stereo_reproject.delivery.layouts import LAYOUTS
from stereo_reproject.delivery.marks import write_marks_of
from stereo_reproject.delivery.projection import FRONT, WHOLE, MoviePanorama, panorama_of
from tests.delivery.movies import encode, frames, refused, sphere, stereo

PART = MoviePanorama(left=0.125, right=0.25, top=0.0625, bottom=0.5)

HEVC = "-c:v libx265 -x265-params log-level=error -pix_fmt yuv420p"
MP4_KINDS = {
    "h264.mp4": "-c:v libx264 -pix_fmt yuv420p",
    "faststart.mp4": "-c:v libx264 -pix_fmt yuv420p -movflags +faststart",
    "hvc1.mp4": f"{HEVC} -tag:v hvc1 -movflags +faststart",
    "hev1.mp4": f"{HEVC} -tag:v hev1",
    "hvc1.mov": f"{HEVC} -tag:v hvc1",
    "prores.mov": "-c:v prores_ks",
}
MKV_KINDS = {
    "ffv1.mkv": "-c:v ffv1",
    "unsummed.mkv": "-c:v ffv1 -write_crc32 0",
    "hevc.mkv": HEVC,
    "vp9.webm": "-c:v libvpx-vp9 -pix_fmt yuv420p",
}
OF_APPLE = ("hvc1.mp4", "hev1.mp4", "hvc1.mov")


@pytest.fixture(scope="module")
def movies(tmp_path_factory):
    folder = tmp_path_factory.mktemp("movies")
    return {name: encode(folder / name, options) for name, options in {**MP4_KINDS, **MKV_KINDS}.items()}


@pytest.fixture
def copy(movies, tmp_path):
    def copied(name):
        path = tmp_path / name
        path.write_bytes(movies[name].read_bytes())
        return path

    return copied


HOLDS_BOXES = {b"moov": 0, b"trak": 0, b"mdia": 0, b"minf": 0, b"stbl": 0, b"stsd": 8, b"sv3d": 0, b"proj": 0} | {
    **dict.fromkeys((b"vexu", b"eyes", b"pack"), 0),
    **dict.fromkeys((b"avc1", b"hvc1", b"hev1", b"apcn"), 78),
}
"""Boxes of boxes, and the bytes of their own that come first."""


def parsed(data, start=0, stop=None):
    """All boxes as (path, start of the header, content), where each fills the one around it exactly."""
    stop = len(data) if stop is None else stop
    while start < stop:
        size, kind = struct.unpack(">I4s", data[start : start + 8])
        assert 8 <= size <= stop - start, (kind, size, stop - start)
        yield (kind,), start, data[start + 8 : start + size]
        if kind in HOLDS_BOXES:
            inside = parsed(data, start + 8 + HOLDS_BOXES[kind], start + size)
            yield from (((kind, *path), place, content) for path, place, content in inside)
        start += size
    assert start == stop


def content_of(path, *ends):
    """The contents of all boxes whose paths end so."""
    return [content for way, _, content in parsed(path.read_bytes()) if way[-len(ends) :] == ends]


def entry_kinds(path):
    """The boxes of the sample entry, in order."""
    return [way[-1] for way, _, _ in parsed(path.read_bytes()) if len(way) == 8 and way[-3] == b"stsd"]


def chunks(path):
    """The first bytes of each chunk of pictures, where the tables say that they are."""
    data, found = path.read_bytes(), []
    for way, _, content in parsed(data):
        form = {b"stco": ">I", b"co64": ">Q"}.get(way[-1])
        if form is not None:
            places = [place for (place,) in struct.iter_unpack(form, content[8:])]
            assert len(places) == int.from_bytes(content[4:8]) > 0
            found += [data[place : place + 32] for place in places]
    return found


@pytest.mark.parametrize("name", MP4_KINDS)
def test_every_mp4_says_it_to_ffmpeg(copy, name):
    path = copy(name)
    before, later, starts, clean = frames(path), frames(path, start=0.2), chunks(path), path.read_bytes()
    front = "half equirectangular" if name in OF_APPLE else "tiled equirectangular [32, 0, 31, 0]"
    for layout, eyes in (("side-by-side", "side by side"), ("top-bottom", "top and bottom")):
        for panorama, shown in ((FRONT, front), (WHOLE, "equirectangular")):
            assert write_marks_of(path, LAYOUTS[layout], panorama)
            assert (stereo(path), sphere(path)) == (eyes, shown)
            assert frames(path) == before
            assert frames(path, start=0.2) == later
            assert chunks(path) == starts
    write_marks_of(path, LAYOUTS["side-by-side"])
    assert (stereo(path), sphere(path)) == ("side by side", "")
    write_marks_of(path, LAYOUTS["individual"])
    assert path.read_bytes() == clean


def test_the_checks_of_this_file_can_fail(copy):
    path = copy("faststart.mp4")
    starts = chunks(path)
    data = path.read_bytes()
    path.write_bytes(data.replace(b"mdat", b"mdat!", 1))
    assert chunks_or_damage(path) != starts
    place = next(place for way, place, _ in parsed(data) if way[-1] == b"stbl")
    path.write_bytes(data[:place] + struct.pack(">I", 9) + data[place + 4 :])
    assert chunks_or_damage(path) is None


def chunks_or_damage(path):
    try:
        return chunks(path)
    except (AssertionError, struct.error):
        return None


def test_the_bytes_of_a_vr180_mp4(copy):
    """By the layouts in Google's paper."""
    path = copy("h264.mp4")
    write_marks_of(path, LAYOUTS["side-by-side"], FRONT)
    kinds = entry_kinds(path)
    assert kinds[kinds.index(b"st3d") :][:3] == [b"st3d", b"sv3d", b"pasp"]
    assert b"vexu" not in kinds
    assert b"hfov" not in kinds
    assert content_of(path, b"st3d") == [bytes.fromhex("00000000 02")]
    (header,) = content_of(path, b"sv3d", b"svhd")
    assert header == bytes(4) + b"Stereo Reprojection\0"
    assert content_of(path, b"sv3d", b"proj", b"prhd") == [bytes(16)]
    quarter = "00000000 00000000 00000000 3fffffff 3fffffff"
    assert content_of(path, b"sv3d", b"proj", b"equi") == [bytes.fromhex(quarter)]


def test_each_bound_has_its_place(copy):
    """Top, bottom, left, right in the file; left, top, right, bottom in what FFmpeg prints, in pixels of 64 x 32."""
    path = copy("h264.mp4")
    write_marks_of(path, LAYOUTS["top-bottom"], PART)
    (content,) = content_of(path, b"sv3d", b"proj", b"equi")
    bounds = np.array(struct.unpack(">5I", content)[1:]) / 2.0**32
    assert bounds == pytest.approx([0.0625, 0.5, 0.125, 0.25], abs=1e-9)
    shown = sphere(path)
    left, top, right, bottom = map(int, shown.partition("[")[2].rstrip("]").split(","))
    assert shown.startswith("tiled equirectangular")
    # FFmpeg counts in pixels of a picture of the whole sphere.
    whole = np.array([64 / 0.625, 32 / 0.4375] * 2)
    assert [left, top, right, bottom] == pytest.approx(whole * [0.125, 0.0625, 0.25, 0.5], abs=1.0)


@pytest.mark.parametrize("name", OF_APPLE)
@pytest.mark.parametrize(
    ("layout", "stereo_bits", "packing"),
    [
        ("side-by-side", 0b0011, b"side"),
        ("side-by-side-half", 0b0011, b"side"),
        ("cross-eyed", 0b1011, b"side"),
        ("top-bottom", 0b0011, b"over"),
    ],
)
@pytest.mark.parametrize(("panorama", "kind", "degrees"), [(FRONT, b"hequ", 180), (WHOLE, b"equi", 360)])
def test_what_apples_players_read(copy, name, layout, stereo_bits, packing, panorama, kind, degrees):
    path = copy(name)
    write_marks_of(path, LAYOUTS[layout], panorama)
    assert content_of(path, b"vexu", b"eyes", b"stri") == [bytes(4) + bytes([stereo_bits])]
    assert content_of(path, b"vexu", b"eyes", b"hero") == [bytes(4) + b"\x01"]
    assert content_of(path, b"vexu", b"proj", b"prji") == [bytes(4) + kind]
    assert content_of(path, b"vexu", b"pack", b"pkin") == [bytes(4) + packing]
    assert content_of(path, b"hfov") == [struct.pack(">I", 1000 * degrees)]
    kinds = entry_kinds(path)
    assert kinds.index(b"st3d") < kinds.index(b"sv3d") < kinds.index(b"vexu") < kinds.index(b"hfov")
    wanted = {b"side": "side by side", b"over": "top and bottom"}[packing]
    assert stereo(path) == wanted + (" (inverted)" if layout == "cross-eyed" else "")


def test_an_eye_alone_has_a_projection_and_no_eyes(copy):
    path = copy("hvc1.mp4")
    before = frames(path)
    write_marks_of(path, LAYOUTS["individual"], FRONT)
    kinds = entry_kinds(path)
    assert b"st3d" not in kinds
    assert content_of(path, b"vexu", b"proj", b"prji") == [bytes(4) + b"hequ"]
    assert content_of(path, b"vexu", b"eyes") == content_of(path, b"vexu", b"pack") == []
    assert sphere(path) == "half equirectangular"
    assert frames(path) == before


def test_apple_has_no_word_for_other_parts(copy):
    path = copy("hvc1.mp4")
    write_marks_of(path, LAYOUTS["side-by-side"], PART)
    assert not {b"vexu", b"hfov"} & set(entry_kinds(path))
    assert sphere(path).startswith("tiled equirectangular")


def test_a_planar_hevc_movie_has_none_of_it(copy):
    path = copy("hvc1.mp4")
    write_marks_of(path, LAYOUTS["side-by-side"])
    assert not {b"vexu", b"hfov", b"sv3d"} & set(entry_kinds(path))


def test_offsets_of_64_bits(copy):
    """As in movies of many gigabytes: the table of a movie whose description comes first, written anew."""
    path = copy("faststart.mp4")
    before, starts, data = frames(path), chunks(path), path.read_bytes()
    ((way, place, content),) = [found for found in parsed(data) if found[0][-1] == b"stco"]
    grown = len(content) - 8
    numbers = [number + grown for (number,) in struct.iter_unpack(">I", content[8:])]
    table = content[:8] + struct.pack(f">{len(numbers)}Q", *numbers)
    edited = bytearray(data)
    for around, start, _ in parsed(data):
        if around == way[: len(around)] and start <= place < start + int.from_bytes(data[start : start + 4]):
            edited[start : start + 4] = struct.pack(">I", int.from_bytes(data[start : start + 4]) + grown)
    edited[place : place + 8 + len(content)] = struct.pack(">I4s", 8 + len(table), b"co64") + table
    path.write_bytes(edited)
    assert frames(path) == before
    write_marks_of(path, LAYOUTS["side-by-side"], FRONT)
    assert chunks(path) == starts
    assert frames(path) == before
    assert sphere(path) == "tiled equirectangular [32, 0, 31, 0]"


def test_a_file_that_is_not_whole(copy):
    path = copy("faststart.mp4")
    path.write_bytes(path.read_bytes()[:400])
    with refused(path, "is not a whole movie"):
        mp4.write_marks(path, 2, FRONT)


HOLDS_ELEMENTS = (0x18538067, 0x1654AE6B, 0xAE, 0xE0, 0x7670)


def elements(data, start=0, stop=None):
    """All EBML elements as (path, content), where each fills the one around it exactly."""
    stop = len(data) if stop is None else stop
    while start < stop:
        width = next(n for n in range(1, 5) if data[start] & 0x80 >> n - 1)
        number, start = int.from_bytes(data[start : start + width]), start + width
        width = next(n for n in range(1, 9) if data[start] & 0x80 >> n - 1)
        size, start = int.from_bytes(data[start : start + width]) - (1 << 7 * width), start + width
        assert start + size <= stop
        yield (number,), data[start : start + size]
        if number in HOLDS_ELEMENTS:
            inside = elements(data, start, start + size)
            yield from (((number, *path), content) for path, content in inside)
        start += size


def video_elements(path):
    """The elements within Video: their contents by their own path."""
    found = [(way, content) for way, content in elements(path.read_bytes()) if 0xE0 in way[:-1]]
    return [(way[way.index(0xE0) + 1 :], content) for way, content in found]


@pytest.mark.parametrize("name", MKV_KINDS)
def test_every_mkv_says_it_to_ffmpeg(copy, name):
    path = copy(name)
    before, later, size = frames(path), frames(path, start=0.2), path.stat().st_size
    for layout, eyes in (("side-by-side", "side by side"), ("top-bottom", "top and bottom")):
        shown = {FRONT: "tiled equirectangular [32, 0, 31, 0]", WHOLE: "equirectangular"}
        for panorama, part in shown.items():
            assert write_marks_of(path, LAYOUTS[layout], panorama)
            assert (stereo(path), sphere(path)) == (eyes, part)
            assert frames(path) == before
            assert frames(path, start=0.2) == later
            assert path.stat().st_size == size
    once = path.read_bytes()
    write_marks_of(path, LAYOUTS["top-bottom"], WHOLE)
    assert path.read_bytes() == once
    write_marks_of(path, LAYOUTS["top-bottom"])
    assert (stereo(path), sphere(path)) == ("top and bottom", "")


def test_the_elements_of_a_vr180_mkv(copy):
    path = copy("ffv1.mkv")
    write_marks_of(path, LAYOUTS["side-by-side"], FRONT)
    found = video_elements(path)
    contents = dict(found)
    assert len(contents) == len(found)
    assert contents[(0x53B8,)] == b"\x01"
    assert contents[(0x7670, 0x7671)] == b"\x01"
    assert contents[(0x7670, 0x7672)] == bytes.fromhex("00000000 00000000 00000000 3fffffff 3fffffff")
    assert [contents[(0x7670, pose)] for pose in (0x7673, 0x7674, 0x7675)] == [bytes(4)] * 3


def test_a_projection_without_a_layout(copy):
    """Of an eye in a movie of its own: taken away again, it leaves the description as it was."""
    path = copy("ffv1.mkv")
    before = video_elements(path)
    assert not write_marks_of(path, LAYOUTS["individual"], WHOLE)
    assert (stereo(path), sphere(path)) == ("", "equirectangular")
    matroska.write_marks(path, None)
    assert video_elements(path) == before


TURN, HALF = np.pi, np.pi / 2


@pytest.mark.parametrize(
    ("longitudes", "latitudes", "panorama"),
    [
        ((-HALF, HALF), (-HALF, HALF), FRONT),
        ((-TURN, TURN), (-HALF, HALF), WHOLE),
        ((0.0, 2 * TURN), (-HALF, HALF), WHOLE),
        ((0.0, TURN), (-HALF, HALF), MoviePanorama(left=0.5)),
        ((-HALF, HALF), (0.0, HALF), MoviePanorama(left=0.25, right=0.25, bottom=0.5)),
        ((-HALF, HALF), (-HALF, 0.0), MoviePanorama(left=0.25, right=0.25, top=0.5)),
        ((HALF, -HALF), (-HALF, HALF), None),
        ((-HALF, HALF), (HALF, -HALF), None),
        ((HALF, 3 * HALF), (-HALF, HALF), None),
        ((-2 * TURN, TURN), (-HALF, HALF), None),
        ((-HALF, HALF), (-HALF, 2.0), None),
    ],
)
def test_bounds_by_angles(longitudes, latitudes, panorama):
    """Blender's angles have single precision."""
    assert panorama_of(longitudes, latitudes) == panorama
    rounded = [tuple(float(np.float32(angle)) for angle in angles) for angles in (longitudes, latitudes)]
    assert panorama_of(*rounded) == panorama


@pytest.mark.parametrize(("panorama", "across", "degrees"), [(FRONT, 180, 180), (WHOLE, 360, 360), (PART, 225, None)])
def test_degrees(panorama, across, degrees):
    assert panorama.horizontal_degrees == across
    assert panorama.degrees == degrees
