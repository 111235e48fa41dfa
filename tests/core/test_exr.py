"""Files in and out, read back and written by OpenEXR itself."""

import contextlib
import os
import signal
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from stereo_reproject.errors import BadInputError, StereoReprojectError
from stereo_reproject.exr import read_render, write_eye, write_stereo, write_table

SHAPE = (6, 10)
CHANNELS = {"Combined": "RGBA", "Depth": "Z", "Normal": "XYZ", "Diffuse Color": "RGB", "Vector": "XYZW", "Mist": "Z"}
READ_ONLY = {"UV": "UVA", "CryptoObject00": "rgba"}
FULL_DISK = Path("/dev/full")


def passes(seed=0):
    rng = np.random.default_rng(seed)
    result = {
        name: rng.uniform(-2.0, 9.0, (*SHAPE, len(letters))).astype(np.float32) for name, letters in CHANNELS.items()
    }
    result["Depth"][1, 2] = np.inf
    result["Combined"][0, 0] = [1e-30, 1e30, -3.0, 0.1]  # more than half a float could hold
    return result


def channels_of(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        assert len(file.parts) == 1
        pixels = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
        return pixels, dict(file.header())


def check_channel(pixels, name, expected):
    assert pixels[name].dtype == np.float32
    np.testing.assert_array_equal(pixels[name], expected, err_msg=name)


# What is delivered


def test_an_eye_comes_back_with_every_pass_bit_by_bit(tmp_path):
    eye = passes()
    write_eye(tmp_path / "left.exr", eye, view="left")
    pixels, header = channels_of(tmp_path / "left.exr")
    assert header["view"] == "left"
    for k, letter in enumerate("RGBA"):
        check_channel(pixels, letter, eye["Combined"][..., k])
    check_channel(pixels, "Depth.Z", eye["Depth"][..., 0])
    for name in ("Normal", "Vector", "Diffuse Color"):
        for k, letter in enumerate(CHANNELS[name]):
            check_channel(pixels, f"{name}.{letter}", eye[name][..., k])
    assert len(pixels) == sum(image.shape[2] for image in eye.values())


def test_a_stereo_file_is_multi_view_as_openexr_has_it(tmp_path):
    """The default view comes first, its colours without its name; a layer's view is the last part but one."""
    eyes = {"left": passes(1), "right": passes(2)}
    write_stereo(tmp_path / "stereo.exr", eyes)
    pixels, header = channels_of(tmp_path / "stereo.exr")
    assert list(header["multiView"]) == ["left", "right"]
    for k, letter in enumerate("RGBA"):
        check_channel(pixels, letter, eyes["left"]["Combined"][..., k])
        check_channel(pixels, f"right.{letter}", eyes["right"]["Combined"][..., k])
    check_channel(pixels, "Depth.left.Z", eyes["left"]["Depth"][..., 0])
    check_channel(pixels, "Depth.right.Z", eyes["right"]["Depth"][..., 0])
    for k, letter in enumerate("XYZ"):
        check_channel(pixels, f"Normal.left.{letter}", eyes["left"]["Normal"][..., k])
        check_channel(pixels, f"Normal.right.{letter}", eyes["right"]["Normal"][..., k])
    assert len(pixels) == 2 * sum(image.shape[2] for image in eyes["left"].values())


def test_a_pass_that_only_one_eye_has_is_only_that_eye_s(tmp_path):
    eyes = {"left": passes(1), "right": passes(2)}
    del eyes["right"]["Vector"]
    write_stereo(tmp_path / "stereo.exr", eyes)
    pixels, _ = channels_of(tmp_path / "stereo.exr")
    assert {name for name in pixels if name.startswith("Vector")} == {f"Vector.left.{letter}" for letter in "XYZW"}


def test_a_table_holds_its_numbers(tmp_path):
    values = np.random.default_rng(0).normal(size=(*SHAPE, 4)).astype(np.float32)
    values[0, 0] = [0.0, 16777215.0, -1.0, 1e-20]
    write_table(tmp_path / "table.exr", values)
    pixels, header = channels_of(tmp_path / "table.exr")
    assert header["compression"] == OpenEXR.NO_COMPRESSION
    for k, letter in enumerate("RGBA"):
        check_channel(pixels, letter, values[..., k])


def test_a_picture_cut_out_of_a_larger_one_is_written_as_it_is(tmp_path):
    """Views of arrays are not laid out as a file wants them."""
    values = np.random.default_rng(0).normal(size=(40, 30, 4)).astype(np.float32)[5:35:3, ::-2]
    write_eye(tmp_path / "eye.exr", {"Combined": values}, view="left")
    pixels, _ = channels_of(tmp_path / "eye.exr")
    check_channel(pixels, "G", values[..., 1])


# What Blender wrote


def write_one_part(path, views, layer="View Layer"):
    """As Blender 4.5 does: one part, the view's name before the channel's letter."""
    channels = {}
    for view, seed in views.items():
        for name, image in passes(seed).items():
            for k, letter in enumerate(CHANNELS[name]):
                channels[f"{layer}.{name}.{view}.{letter}"] = image[..., k].copy()
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.NO_COMPRESSION, "multiView": list(views)}
    header[f"cycles.{layer}.synchronization_time"] = "00:01.50"
    with OpenEXR.File(header, channels) as file:
        file.write(str(path))


def write_many_parts(path, views, layer="View Layer"):
    """As Blender 5.2 does: a part for each pass and view, which has the view in its header."""
    parts = []
    for name, letters in CHANNELS.items():
        for view, seed in views.items():
            channels = {
                f"{layer}.{name}.{letter}": passes(seed)[name][..., k].copy() for k, letter in enumerate(letters)
            }
            header = {"type": OpenEXR.scanlineimage, "name": f"{layer}.{name}-{view}", "view": view}
            if not parts:
                header[f"cycles.{layer}.synchronization_time"] = "00:01.50"
            parts.append(OpenEXR.Part(header, channels))
    with OpenEXR.File(parts) as file:
        file.write(str(path))


LAYOUTS = {"4.5": write_one_part, "5.2": write_many_parts}


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("view", ["left", "right"])
def test_a_render_of_one_view_comes_back_whole(tmp_path, layout, view):
    LAYOUTS[layout](tmp_path / "render.exr", {view: 3})
    read, attributes = read_render(tmp_path / "render.exr", layer="View Layer", view=view)
    expected = passes(3)
    assert set(read) == set(expected)
    for name, image in read.items():
        assert image.dtype == np.float32
        np.testing.assert_array_equal(image, expected[name], err_msg=name)
    assert attributes["cycles.View Layer.synchronization_time"] == "00:01.50"


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("view", ["left", "right"])
def test_of_two_views_the_one_that_was_asked_for_comes_back(tmp_path, layout, view):
    views = {"left": 4, "right": 5}
    LAYOUTS[layout](tmp_path / "render.exr", views)
    read, _ = read_render(tmp_path / "render.exr", layer="View Layer", view=view)
    assert set(read) == set(CHANNELS)
    for name, expected in passes(views[view]).items():
        np.testing.assert_array_equal(read[name], expected, err_msg=name)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("layer", ["A", "Fog.Near", "left"])
def test_a_layer_may_be_called_anything(tmp_path, layout, layer):
    LAYOUTS[layout](tmp_path / "render.exr", {"left": 3}, layer)
    read, _ = read_render(tmp_path / "render.exr", layer=layer, view="left")
    assert set(read) == set(CHANNELS)
    np.testing.assert_array_equal(read["Combined"], passes(3)["Combined"])


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_composite_beside_a_layer_is_not_part_of_it(tmp_path, layout):
    LAYOUTS[layout](tmp_path / "render.exr", {"left": 3}, "Composite")
    with pytest.raises(StereoReprojectError, match="no Combined pass"):
        read_render(tmp_path / "render.exr", layer="View Layer", view="left")


@pytest.mark.parametrize("name", READ_ONLY)
def test_channels_come_in_the_order_that_their_letters_have(tmp_path, name):
    letters = READ_ONLY[name]
    image = np.arange(24.0, dtype=np.float32).reshape(2, 3, 4)[..., : len(letters)]
    colour = {f"L.Combined.left.{letter}": np.zeros((2, 3), np.float32) for letter in "RGBA"}
    colour["L.Depth.left.Z"] = np.ones((2, 3), np.float32)
    channels = {f"L.{name}.left.{letter}": image[..., k].copy() for k, letter in enumerate(letters)}
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, {**colour, **channels}) as file:
        file.write(str(tmp_path / "render.exr"))
    read, _ = read_render(tmp_path / "render.exr", layer="L", view="left")
    np.testing.assert_array_equal(read[name], image)
    write_eye(tmp_path / "eye.exr", read, view="left")
    written = OpenEXR.File(str(tmp_path / "eye.exr"), separate_channels=True).channels()
    for k, letter in enumerate(letters):
        np.testing.assert_array_equal(written[f"{name}.{letter}"].pixels, image[..., k])


# What goes wrong


def test_a_render_cut_off_in_the_middle_is_an_error(tmp_path):
    write_many_parts(tmp_path / "render.exr", {"left": 3})
    whole = (tmp_path / "render.exr").read_bytes()
    (tmp_path / "render.exr").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(StereoReprojectError):
        read_render(tmp_path / "render.exr", layer="View Layer", view="left")


@pytest.mark.parametrize("content", [None, b"", b"not a picture", b"\x76\x2f\x31\x01\x02\x00\x00\x00"])
def test_what_cannot_be_read_is_an_error_in_one_line(tmp_path, content, capfd):
    path = tmp_path / "render.exr"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(StereoReprojectError) as raised:
        read_render(path, layer="View Layer", view="left")
    assert "render.exr" in str(raised.value)
    assert "\n" not in str(raised.value)


WRITERS = {
    "eye": lambda path, eye: write_eye(path, eye, view="left"),
    "stereo": lambda path, eye: write_stereo(path, {"left": eye, "right": eye}),
    "table": lambda path, eye: write_table(path, eye["Combined"]),
}


def check_refusal(write, path, eye):
    with pytest.raises(BadInputError) as raised:
        write(path, eye)
    assert path.name in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS.keys())
def test_a_place_that_cannot_be_written_is_bad_input(tmp_path, write):
    (tmp_path / "folder.exr").mkdir()
    (tmp_path / "file").write_text("not a folder")
    for path in (tmp_path / "missing" / "left.exr", tmp_path / "folder.exr", tmp_path / "file" / "left.exr"):
        check_refusal(write, path, passes())


@contextlib.contextmanager
def files_limited_to(size):
    """Writing beyond `size` bytes fails: as near to a full disk as a test comes without one."""
    resource = pytest.importorskip("resource")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)


@pytest.mark.skipif(os.name != "posix", reason="file size limits as POSIX has them")
@pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS.keys())
def test_a_disk_that_fills_up_is_bad_input(tmp_path, write):
    """Noise does not compress: the file is far larger than the limit, however it is buffered."""
    eye = {"Combined": np.random.default_rng(0).normal(size=(300, 300, 4)).astype(np.float32)}
    with files_limited_to(64 * 1024):
        check_refusal(write, tmp_path / "left.exr", eye)


@pytest.mark.skipif(not FULL_DISK.exists(), reason="a device that is always full, as Linux has it")
@pytest.mark.parametrize("write", [WRITERS["eye"], WRITERS["stereo"]], ids=["eye", "stereo"])
def test_a_full_disk_is_bad_input(tmp_path, write):
    (tmp_path / "left.exr").symlink_to(FULL_DISK)
    check_refusal(write, tmp_path / "left.exr", passes())
