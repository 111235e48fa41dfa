import random
import zlib

import pytest

from stereo_reproject.delivery.layouts import LAYOUTS
from stereo_reproject.delivery.marks import write_marks_of
from stereo_reproject.delivery.matroska import write_marks
from stereo_reproject.errors import StereoReprojectError
from tests.delivery.movies import described, encode, frames, refused, stereo

KINDS = {
    "ffv1.mkv": ("-c:v ffv1", "flac"),
    "ffv1-silent.mkv": ("-c:v ffv1", ""),
    "h264.mkv": ("-c:v libx264 -pix_fmt yuv420p", ""),
    "av1.mkv": ("-c:v libaom-av1 -cpu-used 8 -pix_fmt yuv420p", ""),
    "cues-first.mkv": ("-c:v ffv1 -cues_to_front 1", ""),
    "reserved.mkv": ("-c:v ffv1 -reserve_index_space 5000", "flac"),
    "unsummed.mkv": ("-c:v ffv1 -write_crc32 0", ""),
    "vp9.webm": ("-c:v libvpx-vp9 -pix_fmt yuv420p", "libopus"),
    "av1.webm": ("-c:v libaom-av1 -cpu-used 8 -pix_fmt yuv420p", ""),
}
SEEK_HEAD, TRACKS, CLUSTER, CUES = b"\x11\x4d\x9b\x74", b"\x16\x54\xae\x6b", b"\x1f\x43\xb6\x75", b"\x1c\x53\xbb\x6b"


@pytest.fixture(scope="module")
def movies(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mkv")
    return {name: encode(folder / name, options, sound=sound) for name, (options, sound) in KINDS.items()}


@pytest.fixture(params=KINDS)
def movie(request, movies, tmp_path):
    path = tmp_path / request.param
    path.write_bytes(movies[request.param].read_bytes())
    return path


@pytest.fixture
def ffv1(movies, tmp_path):
    path = tmp_path / "ffv1.mkv"
    path.write_bytes(movies["ffv1.mkv"].read_bytes())
    return path


def places(data):
    """Of the elements that SeekHead names, by their numbers; each is where it says."""
    # An independent reader of what libavformat writes: segment's header of 12 bytes, entries ID 4 and position 1 to 8.
    origin = data.index(b"\x18\x53\x80\x67") + 12
    found, at = {}, data.index(SEEK_HEAD)
    end = data.index(b"\xec", at + 60)
    while (at := data.find(b"\x53\xab\x84", at, end)) >= 0:
        number, length = data[at + 3 : at + 7], data[at + 9] & 0x7F
        found[number] = origin + int.from_bytes(data[at + 10 : at + 10 + length])
        at += 10
    return found


def checksums_hold(data):
    """Of the SeekHead and the Tracks, where they have one."""
    for place in (data.index(SEEK_HEAD), places(data)[TRACKS]):
        at = place + 4
        width = 9 - data[at].bit_length()
        size = int.from_bytes(data[at : at + width]) - (1 << 7 * width)
        content = data[at + width : at + width + size]
        if content[:2] == b"\xbf\x84" and int.from_bytes(content[2:6], "little") != zlib.crc32(content[6:]):
            return False
    return True


def test_every_player_finds_the_mark_and_the_pictures(movie):
    before, later, data = frames(movie), frames(movie, start=0.2), movie.read_bytes()
    write_marks(movie, 1, across=2)
    assert stereo(movie) == "side by side"
    assert frames(movie) == before
    assert frames(movie, start=0.2) == later
    marked = movie.read_bytes()
    assert len(marked) == len(data)
    assert places(marked).keys() == places(data).keys()
    assert all(marked.startswith(number, place) for number, place in places(marked).items())
    assert checksums_hold(marked)
    assert marked[marked.index(CLUSTER) :] == data[data.index(CLUSTER) :]
    write_marks(movie, 3, down=2)
    assert stereo(movie) == "top and bottom"
    assert frames(movie) == before


def test_the_checks_of_this_file_can_fail(movies):
    data = movies["ffv1.mkv"].read_bytes()
    assert checksums_hold(data)
    at = places(data)[TRACKS] + 30
    assert not checksums_hold(data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :])
    assert len(places(data)) == 4


@pytest.mark.parametrize(
    ("layout", "shape", "mode"),
    [
        ("side-by-side", "1:1", "left_right"),
        ("side-by-side-half", "2:1", "left_right"),
        ("cross-eyed", "1:1", "right_left"),
        ("top-bottom", "1:1", "top_bottom"),
        ("top-bottom-half", "1:2", "top_bottom"),
        ("anaglyph-red-cyan", "1:1", "anaglyph_cyan_red"),
        ("anaglyph-dubois", "1:1", "anaglyph_cyan_red"),
        ("anaglyph-green-magenta", "1:1", "anaglyph_green_magenta"),
        ("interlace-rows", "1:2", "row_interleaved_rl"),
        ("interlace-columns", "2:1", "col_interleaved_lr"),
        ("interlace-checkerboard", "1:1", "checkerboard_rl"),
    ],
)
def test_the_eyes_keep_their_shape(ffv1, layout, shape, mode):
    """FFmpeg tells the shape of a pixel once each eye has its whole picture's; squeezed ones are wider or higher."""
    assert write_marks_of(ffv1, LAYOUTS[layout])
    assert f"SAR {shape} " in described(ffv1)
    assert mode in described(ffv1)
    once = ffv1.read_bytes()
    assert write_marks_of(ffv1, LAYOUTS[layout])
    assert ffv1.read_bytes() == once


@pytest.mark.parametrize(
    ("layout", "rows", "mode"),
    [
        ("interlace-rows", 36, "row_interleaved_rl"),
        ("interlace-rows", 35, "row_interleaved_lr"),
        ("interlace-checkerboard", 36, "checkerboard_rl"),
        ("interlace-checkerboard", 35, "checkerboard_lr"),
        ("interlace-columns", 35, "col_interleaved_lr"),
        ("side-by-side", 35, "left_right"),
    ],
)
def test_the_first_row_of_an_odd_number_is_the_other_eyes(ffv1, layout, rows, mode):
    """Blender begins at the bottom."""
    assert write_marks_of(ffv1, LAYOUTS[layout].at_height(rows))
    assert mode in described(ffv1)


@pytest.mark.parametrize(("half", "shape"), [("", "1:1"), ("-half", "2:1")])
def test_a_mark_of_another_counts_for_nothing(tmp_path, half, shape):
    """Blender 5.2: the eyes at random, and squeezed pictures taken for whole ones."""
    path = encode(tmp_path / "f.mkv", "-c:v ffv1 -metadata:s:v stereo_mode=right_left")
    assert stereo(path) == "side by side (inverted)"
    assert write_marks_of(path, LAYOUTS[f"side-by-side{half}"])
    assert stereo(path) == "side by side"
    assert f"SAR {shape} " in described(path)


def test_the_shape_of_pixels_is_kept(tmp_path):
    path = encode(tmp_path / "f.mkv", "-c:v ffv1 -vf setsar=4/3")
    write_marks(path, 1, across=2)
    assert "SAR 4:3" in described(path)


def test_webm_has_few_modes(movies, tmp_path):
    path = tmp_path / "f.webm"
    path.write_bytes(movies["vp9.webm"].read_bytes())
    before = path.read_bytes()
    assert not write_marks_of(path, LAYOUTS["interlace-rows"])
    assert not write_marks_of(path, LAYOUTS["individual"])
    assert path.read_bytes() == before
    assert write_marks_of(path, LAYOUTS["cross-eyed"])
    assert not write_marks_of(path, LAYOUTS["anaglyph-red-cyan"])
    assert "stereo_mode" not in described(path)
    assert "SAR 1:1" in described(path)


def test_the_name_does_not_decide(movies, tmp_path):
    path = tmp_path / "f.mp4"
    path.write_bytes(movies["ffv1.mkv"].read_bytes())
    assert write_marks_of(path, LAYOUTS["side-by-side"])
    assert stereo(path) == "side by side"


@pytest.mark.parametrize("share", [0.001, 0.01, 0.1, 0.9, 0.9999])
def test_a_file_that_is_not_whole(movie, share):
    data = movie.read_bytes()
    movie.write_bytes(data[: 6 + int(len(data) * share) - 6 * (share > 0.5)])
    with refused(movie, "is not a whole movie"):
        write_marks_of(movie, LAYOUTS["side-by-side"])


def test_a_stream_of_unknown_size(tmp_path):
    path = encode(tmp_path / "f.mkv", "-c:v ffv1 -live 1")
    with refused(path, "size is not known"):
        write_marks(path, 1)


def test_no_room(ffv1):
    data = ffv1.read_bytes()
    void = data.index(b"\xec", data.index(SEEK_HEAD) + 60)
    # Some other element of the same size.
    ffv1.write_bytes(data[:void] + b"\xed" + data[void + 1 :])
    with refused(ffv1, "no room"):
        write_marks(ffv1, 1)


def test_any_damage_is_refused_or_outlived(movies, tmp_path):
    path, chance = tmp_path / "f.mkv", random.Random(1)
    data = movies["ffv1.mkv"].read_bytes()
    for _ in range(500):
        broken = bytearray(data)
        for _ in range(3):
            broken[chance.randrange(data.index(CLUSTER))] = chance.choice((0, 1, 0x80, 0xAE, 255))
        path.write_bytes(broken)
        try:
            write_marks_of(path, LAYOUTS["side-by-side"])
        except StereoReprojectError:
            assert path.read_bytes() == broken
