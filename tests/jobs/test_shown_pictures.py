"""Pictures that a worker leaves while it renders."""

import numpy as np
import pytest

from stereo_reproject.images.exr import read_channels, write_picture
from stereo_reproject.jobs.shown_pictures import NAME, PictureFiles

HALF_ROUNDING = 2.0**-11
"""Of a half float, relative."""


def colour(value, size=(4, 6)):
    return np.full((*size, 4), value, np.float32)


@pytest.fixture
def told():
    return []


@pytest.fixture
def pictures(tmp_path, told):
    return PictureFiles(tmp_path, lambda event, **fields: told.append((event, fields)))


def test_each_view_has_a_file_that_is_replaced_and_announced(pictures, told, tmp_path):
    for view, value in (("left", 0.1), ("left", 0.3), ("right", 0.7)):
        pictures.show(view, colour(value))
    paths = [str(tmp_path / NAME.format(view)) for view in ("left", "left", "right")]
    assert told == [
        ("picture", {"view": view, "file": path}) for view, path in zip(("left", "left", "right"), paths, strict=True)
    ]
    assert sorted(path.name for path in tmp_path.iterdir()) == [NAME.format("left"), NAME.format("right")]
    left = read_channels(tmp_path / NAME.format("left"))
    assert sorted(left) == ["A", "B", "G", "R"]
    assert left["R"] == pytest.approx(0.3, rel=HALF_ROUNDING)


def test_a_picture_that_cannot_be_written_is_not_announced(tmp_path, told):
    gone = PictureFiles(tmp_path / "gone", lambda event, **fields: told.append((event, fields)))
    gone.show("left", colour(0.5))
    assert told == []


def test_a_picture_that_cannot_take_its_place_leaves_nothing(pictures, told, tmp_path):
    taken = tmp_path / NAME.format("left")
    (taken / "inside").mkdir(parents=True)
    pictures.show("left", colour(0.5))
    assert told == []
    assert list(tmp_path.iterdir()) == [taken]


def test_values_that_a_half_cannot_hold_are_moved_into_its_range(tmp_path):
    image = colour(0.5)
    image[0, :3, 0] = 1e9, np.nan, -np.inf
    write_picture(tmp_path / "picture.exr", image)
    red = read_channels(tmp_path / "picture.exr")["R"]
    assert list(red[0, :4]) == [65504.0, 0.0, -65504.0, 0.5]
