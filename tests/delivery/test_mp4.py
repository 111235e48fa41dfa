import random
import struct

import pytest

from stereo_reproject.delivery.layouts import LAYOUTS
from stereo_reproject.delivery.marks import write_marks_of
from stereo_reproject.delivery.mp4 import write_marks
from stereo_reproject.delivery.splicing import Edit, splice
from stereo_reproject.errors import StereoReprojectError
from tests.delivery.movies import described, encode, frames, refused, stereo

KINDS = {
    "h264.mp4": ("-c:v libx264 -pix_fmt yuv420p", ""),
    "faststart.mp4": ("-c:v libx264 -pix_fmt yuv420p -movflags +faststart", "aac"),
    "hevc.mov": ("-c:v libx265 -x265-params log-level=error -pix_fmt yuv420p -tag:v hvc1", "aac"),
    "prores.mov": ("-c:v prores_ks", "pcm_s16le"),
    "prores-faststart.mov": ("-c:v prores_ks -movflags +faststart", ""),
    "av1.mp4": ("-c:v libaom-av1 -cpu-used 8 -pix_fmt yuv420p", ""),
    "mpeg4.mp4": ("-c:v mpeg4", ""),
}


@pytest.fixture(scope="module")
def movies(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mp4")
    return {name: encode(folder / name, options, sound=sound) for name, (options, sound) in KINDS.items()}


@pytest.fixture(params=KINDS)
def movie(request, movies, tmp_path):
    path = tmp_path / request.param
    path.write_bytes(movies[request.param].read_bytes())
    return path


@pytest.fixture
def faststart(movies, tmp_path):
    path = tmp_path / "faststart.mp4"
    path.write_bytes(movies["faststart.mp4"].read_bytes())
    return path


def test_every_player_finds_the_mark_and_the_pictures(movie):
    before, later = frames(movie), frames(movie, start=0.2)
    size = movie.stat().st_size
    write_marks(movie, 2)
    assert stereo(movie) == "side by side"
    assert frames(movie) == before
    assert frames(movie, start=0.2) == later
    assert movie.stat().st_size == size + 13
    write_marks(movie, 1)
    assert stereo(movie) == "top and bottom"
    assert frames(movie) == before
    assert movie.stat().st_size == size + 13


def test_taking_the_mark_away_gives_the_file_that_was(movie):
    before = movie.read_bytes()
    write_marks(movie, None)
    assert movie.read_bytes() == before
    write_marks(movie, 2)
    write_marks(movie, None)
    assert movie.read_bytes() == before


def test_the_mark_comes_before_the_shape_of_the_pixels(faststart):
    write_marks(faststart, 2)
    data = faststart.read_bytes()
    assert data.index(b"avcC") < data.index(b"st3d") < data.index(b"pasp")


def boxed(kind, *content):
    content = b"".join(content)
    return struct.pack(">I4s", 8 + len(content), kind) + content


def test_apples_marks_go(faststart):
    """As Blender 5.2 writes them into MOV files."""
    before = frames(faststart)
    write_marks(faststart, 2)
    theirs = boxed(b"vexu", boxed(b"eyes", boxed(b"stri", bytes(4), b"\x0b"))) + boxed(b"hfov", b"\0\0\0\7")
    clean = faststart.read_bytes()
    at = clean.index(b"pasp") - 4
    edits = [Edit(at, at, theirs)]
    start = 0
    for kind in (b"moov", b"trak", b"mdia", b"minf", b"stbl", b"stsd", b"avc1"):
        start = clean.index(kind, start + 8) - 4
        size = int.from_bytes(clean[start : start + 4]) + len(theirs)
        edits.append(Edit(start, start + 4, size.to_bytes(4)))
    for table in [i for i in range(len(clean)) if clean.startswith(b"stco", i)]:
        count = int.from_bytes(clean[table + 8 : table + 12])
        numbers = struct.unpack(f">{count}I", clean[table + 12 : table + 12 + 4 * count])
        moved = struct.pack(f">{count}I", *(number + len(theirs) for number in numbers))
        edits.append(Edit(table + 12, table + 12 + 4 * count, moved))
    splice(faststart, edits)
    assert b"vexu" in faststart.read_bytes()
    write_marks(faststart, 2)
    assert faststart.read_bytes() == clean
    assert frames(faststart) == before


def test_sizes_of_64_bits(movies, tmp_path):
    """Of the pictures' box before and the description's box behind, as in a movie of many gigabytes."""
    path = tmp_path / "large.mp4"
    data = movies["h264.mp4"].read_bytes()
    free, moov = data.index(b"free") - 4, data.index(b"moov") - 4
    mdat = free + 8
    assert data[mdat + 4 : mdat + 8] == b"mdat"
    # The free box is there for this: with its eight bytes the size has 64 bits, and no picture moves.
    size = struct.pack(">I4sQ", 1, b"mdat", moov - free)
    description = data[moov + 8 :]
    path.write_bytes(
        data[:free]
        + size
        + data[mdat + 8 : moov]
        + struct.pack(">I4sQ", 1, b"moov", 16 + len(description))
        + description
    )
    before = frames(path)
    write_marks(path, 2)
    assert stereo(path) == "side by side"
    assert frames(path) == before == frames(movies["h264.mp4"])


def test_a_cross_eyed_movie_has_a_mark_that_ffmpeg_does_not_know(faststart):
    before = frames(faststart)
    assert write_marks_of(faststart, LAYOUTS["cross-eyed"])
    assert "Unknown st3d mode value 4" in described(faststart)
    assert frames(faststart) == before


def test_a_layout_without_a_mark(faststart):
    before = faststart.read_bytes()
    assert not write_marks_of(faststart, LAYOUTS["anaglyph-red-cyan"])
    assert faststart.read_bytes() == before


@pytest.mark.parametrize("share", [0.01, 0.1, 0.3, 0.9, 0.999])
def test_a_file_that_is_not_whole(movie, share):
    data = movie.read_bytes()
    movie.write_bytes(data[: int(len(data) * share)])
    with refused(movie, "is not a whole movie"):
        write_marks(movie, 2)


def test_an_empty_file(tmp_path):
    path = tmp_path / "f.mp4"
    path.touch()
    with refused(path, "is not a whole movie"):
        write_marks_of(path, LAYOUTS["side-by-side"])


def test_a_fragmented_movie(tmp_path):
    path = encode(tmp_path / "f.mp4", "-c:v libx264 -pix_fmt yuv420p -movflags frag_every_frame+empty_moov")
    with refused(path, "fragmented"):
        write_marks(path, 2)


def test_any_damage_is_refused_or_outlived(movies, tmp_path):
    """Bytes of the description changed at random: one of our errors, or a mark; never anything else."""
    path, chance = tmp_path / "f.mp4", random.Random(1)
    data = movies["faststart.mp4"].read_bytes()
    start, stop = data.index(b"moov"), data.index(b"mdat")
    for _ in range(300):
        broken = bytearray(data)
        for _ in range(3):
            broken[chance.randrange(start, stop)] = chance.choice((0, 1, 7, 255))
        path.write_bytes(broken)
        try:
            write_marks(path, 2)
        except StereoReprojectError:
            assert path.read_bytes() == broken


def test_other_containers_are_left_alone(tmp_path):
    path = encode(tmp_path / "a.avi", "-c:v mjpeg")
    before = path.read_bytes()
    assert not write_marks_of(path, LAYOUTS["side-by-side"])
    assert path.read_bytes() == before


@pytest.mark.parametrize("seed", range(20))
def test_splice_does_what_slices_do(tmp_path, seed):
    chance = random.Random(seed)
    path, data = tmp_path / "f", chance.randbytes(chance.randrange(1, 3000))
    path.write_bytes(data)
    places = sorted(chance.randrange(len(data) + 1) for _ in range(2 * chance.randrange(4)))
    pairs = zip(places[::2], places[1::2], strict=True)
    edits = [Edit(start, stop, chance.randbytes(chance.randrange(9))) for start, stop in pairs]
    expected = data
    for edit in reversed(edits):
        expected = expected[: edit.start] + edit.new + expected[edit.stop :]
    splice(path, chance.sample(edits, len(edits)))
    assert path.read_bytes() == expected
    assert list(tmp_path.iterdir()) == [path]
