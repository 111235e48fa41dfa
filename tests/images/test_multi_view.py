"""One file of all views is what a pair's is, though it is made view by view."""

import numpy as np
import OpenEXR

from stereo_reproject.images.exr import write_eye, write_stereo
from stereo_reproject.images.multi_view import write_multi_view

LAYER = "View.Layer"
MATTE = {"cryptomatte/abc/name": f"{LAYER}.CryptoObject", "cryptomatte/abc/manifest": '{"Cube":"01234567"}'}


def passes(seed):
    values = np.random.default_rng(seed)
    names = {"Combined": 4, "Depth": 1, "Normal": 3, "CryptoObject00": 4}
    return {LAYER: {name: values.random((37, 20, count), np.float32) for name, count in names.items()}}


def parts_of(path):
    return [
        (
            {name: str(value) for name, value in part.header.items() if name not in ("channels", "chunkCount")},
            {name: channel.pixels for name, channel in part.channels.items()},
        )
        for part in OpenEXR.File(str(path), separate_channels=True).parts
    ]


def test_the_file_is_that_of_a_pair(tmp_path):
    views = {"left": passes(1), "a b": passes(2)}
    del views["a b"][LAYER]["Normal"]
    files = {}
    for number, (view, layers) in enumerate(views.items()):
        files[view] = tmp_path / f"{number}.exr"
        write_eye(files[view], layers, view=view, metadata=MATTE)
    write_stereo(tmp_path / "pair.exr", views, metadata=MATTE)
    write_multi_view(tmp_path / "views.exr", files)
    ours, theirs = parts_of(tmp_path / "views.exr"), parts_of(tmp_path / "pair.exr")
    assert [header["view"] for header, _ in ours][:2] == list(views)
    # The passes after the colour are in another order.
    by_name = {header["name"]: (header, channels) for header, channels in theirs}
    assert len(ours) == len(theirs) == 7
    assert ours[0][0] == theirs[0][0]
    for header, channels in ours:
        other_header, other_channels = by_name[header["name"]]
        assert header == other_header
        assert set(channels) == set(other_channels)
        for name, pixels in channels.items():
            np.testing.assert_array_equal(pixels, other_channels[name])
