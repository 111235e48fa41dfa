"""Files in and out, checked against OpenEXR itself."""

import contextlib
import os
import signal
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from stereo_reproject.errors import BadInputError, StereoReprojectError
from stereo_reproject.images.exr import read_eye, read_render, write_eye, write_stereo, write_table

SHAPE = (6, 10)
CHANNELS = {"Combined": "RGBA", "Depth": "Z", "Normal": "XYZ", "Diffuse Color": "RGB", "Vector": "XYZW", "Mist": "Z"}
READ_ONLY = {"UV": "UVA", "CryptoObject00": "rgba"}
VIEWS = ("left", "right")
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
    # Where there is no surface, Blender's depth is a number.
    expected = np.where(np.isinf(expected), np.float32(1e10), expected)
    assert pixels[name].dtype == np.float32
    np.testing.assert_array_equal(pixels[name], expected, err_msg=name)


# Delivered files


def test_an_eye_is_one_part_with_its_colour_on_top_and_every_pass_bit_by_bit(tmp_path):
    eye, fog = passes(), passes(1)
    write_eye(tmp_path / "left.exr", {"View Layer": eye, "Fog.Near": fog}, view="left")
    pixels, header = channels_of(tmp_path / "left.exr")
    assert header["view"] == "left"
    for k, letter in enumerate("RGBA"):
        check_channel(pixels, letter, eye["Combined"][..., k])
        check_channel(pixels, f"Fog.Near.Combined.{letter}", fog["Combined"][..., k])
    check_channel(pixels, "Depth.Z", eye["Depth"][..., 0])
    for name in ("Normal", "Vector", "Diffuse Color"):
        for k, letter in enumerate(CHANNELS[name]):
            check_channel(pixels, f"{name}.{letter}", eye[name][..., k])
            check_channel(pixels, f"Fog.Near.{name}.{letter}", fog[name][..., k])
    assert len(pixels) == 2 * sum(image.shape[2] for image in eye.values())


@pytest.mark.parametrize("names", [("View Layer",), ("Z", "A"), ("Depth", "left"), ("Fog.Near", "Fog"), ("",)])
def test_an_eye_s_layers_come_back(tmp_path, names):
    layers = {name: passes(seed) for seed, name in enumerate(names)}
    write_eye(tmp_path / "left.exr", layers, view="left")
    read = read_eye(tmp_path / "left.exr")
    assert next(iter(read)) == names[0]
    assert set(read) == set(layers)
    for layer, expected in layers.items():
        assert set(read[layer]) == set(expected)
        for name, image in expected.items():
            np.testing.assert_array_equal(read[layer][name], image, err_msg=f"{layer}.{name}")


def parts_of(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return [
            (dict(part.header), {name: np.array(channel.pixels) for name, channel in part.channels.items()})
            for part in file.parts
        ]


def test_a_stereo_file_has_a_part_for_each_layer_pass_and_view(tmp_path):
    """Named as Blender does it, so that it reads them; the first are plain R, G, B and A, for those that know none."""
    layers = ("View Layer", "Fog.Near")
    eyes = {view: {layer: passes(k + 2 * m) for m, layer in enumerate(layers)} for k, view in enumerate(VIEWS)}
    write_stereo(tmp_path / "stereo.exr", eyes)
    parts = parts_of(tmp_path / "stereo.exr")
    assert [(set(channels), header["view"]) for header, channels in parts[:2]] == [(set("RGBA"), v) for v in VIEWS]
    found = {header["name"]: (header["view"], channels) for header, channels in parts}
    assert len(found) == len(parts) == len(CHANNELS) * len(layers) * len(VIEWS)
    for layer in layers:
        for name, letters in CHANNELS.items():
            for view in VIEWS:
                found_view, channels = found[f"{layer}.{name}-{view}"]
                plain = (layer, name) == ("View Layer", "Combined")
                assert found_view == view
                assert set(channels) == {letter if plain else f"{layer}.{name}.{letter}" for letter in letters}
                for k, letter in enumerate(letters):
                    expected = eyes[view][layer][name][..., k]
                    check_channel(channels, letter if plain else f"{layer}.{name}.{letter}", expected)


def test_a_pass_that_only_one_eye_has_is_only_that_eye_s(tmp_path):
    eyes = {view: {"Layer": passes(k)} for k, view in enumerate(VIEWS)}
    del eyes["right"]["Layer"]["Vector"]
    write_stereo(tmp_path / "stereo.exr", eyes)
    names = {header["name"] for header, _ in parts_of(tmp_path / "stereo.exr")}
    assert {name for name in names if "Vector" in name} == {"Layer.Vector-left"}


def matte(key, layer, kind, manifest='{"ball":"0a1b2c3d"}'):
    texts = {"name": f"{layer}.{kind}", "hash": "MurmurHash3_32", "conversion": "uint32_to_float32"}
    return {f"cryptomatte/{key}/{what}": text for what, text in {**texts, "manifest": manifest}.items()}


MATTES = {
    **matte("1111111", "View Layer", "CryptoObject"),
    **matte("2222222", "View Layer", "CryptoMaterial"),
    **matte("3333333", "Fog.Near", "CryptoObject"),
    "cycles.View Layer.samples": "4",
}


def with_mattes():
    levels = {f"CryptoObject0{k}": np.full((*SHAPE, 4), k, np.float32) for k in range(2)}
    return {"View Layer": passes() | levels, "Fog.Near": passes() | levels}


def test_texts_about_cryptomattes_are_in_the_first_part(tmp_path):
    """Readers look there; only the cryptomattes that the file has are described."""
    write_stereo(tmp_path / "stereo.exr", {view: with_mattes() for view in VIEWS}, metadata=MATTES)
    headers = [header for header, _ in parts_of(tmp_path / "stereo.exr")]
    texts = {key: value for key, value in headers[0].items() if key.startswith("cryptomatte/")}
    assert texts == {key: value for key, value in MATTES.items() if key[12] in "13"}
    assert not any(key.startswith("cryptomatte/") for header in headers[1:] for key in header)


def test_in_an_eye_s_file_a_cryptomatte_is_called_as_its_channels_are(tmp_path):
    write_eye(tmp_path / "left.exr", with_mattes(), view="left", metadata=MATTES)
    pixels, header = channels_of(tmp_path / "left.exr")
    assert header["cryptomatte/1111111/name"] == "CryptoObject"
    assert header["cryptomatte/3333333/name"] == "Fog.Near.CryptoObject"
    assert header["cryptomatte/1111111/manifest"] == MATTES["cryptomatte/1111111/manifest"]
    assert "cryptomatte/2222222/name" not in header
    assert {"CryptoObject00.r", "Fog.Near.CryptoObject01.a"} <= set(pixels)


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
    write_eye(tmp_path / "eye.exr", {"Layer": {"Combined": values}}, view="left")
    pixels, _ = channels_of(tmp_path / "eye.exr")
    check_channel(pixels, "G", values[..., 1])


# Files of Blender


def write_one_part(path, views, layer="View Layer"):
    """Write a render as Blender 4.5 does: one part, the view's name before the channel's letter."""
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
    """Write a render as Blender 5.2 does: a part for each pass and view, which has the view in its header."""
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
    write_eye(tmp_path / "eye.exr", {"L": read}, view="left")
    written = OpenEXR.File(str(tmp_path / "eye.exr"), separate_channels=True).channels()
    for k, letter in enumerate(letters):
        np.testing.assert_array_equal(written[f"{name}.{letter}"].pixels, image[..., k])


# Errors


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
    "eye": lambda path, eye: write_eye(path, {"Layer": eye}, view="left"),
    "stereo": lambda path, eye: write_stereo(path, {"left": {"Layer": eye}, "right": {"Layer": eye}}),
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
