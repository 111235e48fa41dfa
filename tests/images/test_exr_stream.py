"""Files written piece by piece, read back by OpenEXR itself."""

import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from stereo_reproject.errors import BadInputError
from stereo_reproject.images.exr_stream import StreamedPart, streamed_exr

LONG = "a name of a channel that is longer than thirty-one bytes"


def values(height, width, dtype, seed):
    return np.random.default_rng(seed).normal(size=(height, width)).astype(dtype)


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
@pytest.mark.parametrize("height", [1, 16, 47])
@pytest.mark.parametrize("step", [1, 7, 16, 100])
def test_one_part(tmp_path, dtype, height, step):
    path, size = tmp_path / "one.exr", (33, height)
    found = {letter: values(height, 33, dtype, k) for k, letter in enumerate("RGBA")}
    with streamed_exr(path, [StreamedPart("RGBA", texts={"Frame": "7"})], size, dtype) as stream:
        for top in range(0, height, step):
            stream.write({letter: rows[top : top + step] for letter, rows in found.items()})
    [part] = OpenEXR.File(str(path), separate_channels=True).parts
    assert part.header["Frame"] == "7"
    for letter, rows in found.items():
        assert part.channels[letter].pixels.dtype == dtype
        np.testing.assert_array_equal(part.channels[letter].pixels, rows)


def test_what_hardly_differs_is_packed(tmp_path):
    path = tmp_path / "flat.exr"
    with streamed_exr(path, [StreamedPart("V")], (256, 256), np.float32) as stream:
        stream.write({"V": np.ones((256, 256))})
    assert path.stat().st_size < 256 * 256
    [part] = OpenEXR.File(str(path), separate_channels=True).parts
    np.testing.assert_array_equal(part.channels["V"].pixels, 1.0)


def test_several_parts_in_any_order(tmp_path):
    path = tmp_path / "parts.exr"
    parts = [StreamedPart("RGBA", "layer.Combined-a", "a"), StreamedPart([LONG, "B"], "layer.Other-b", "b")]
    found = [{name: values(40, 20, np.float32, k) for k, name in enumerate(part.channels)} for part in parts]
    with streamed_exr(path, parts, (20, 40), np.float32) as stream:
        for number in (1, 0):
            for rows in (slice(0, 30), slice(30, 40)):
                stream.write({name: image[rows] for name, image in found[number].items()}, number)
    read = OpenEXR.File(str(path), separate_channels=True).parts
    assert [(part.header["name"], part.header["view"]) for part in read] == [(part.name, part.view) for part in parts]
    for part, images in zip(read, found, strict=True):
        assert set(part.channels) == set(images)
        for name, image in images.items():
            np.testing.assert_array_equal(part.channels[name].pixels, image)


@pytest.mark.skipif(sys.platform != "linux", reason="there is no such device")
def test_a_full_disk_is_said():
    with (
        pytest.raises(BadInputError, match="disk full"),
        streamed_exr(Path("/dev/full"), [StreamedPart("V")], (64, 64), np.float32) as stream,
    ):
        stream.write({"V": values(64, 64, np.float32, 1)})
