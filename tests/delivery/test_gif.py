"""GIFs are read back by Pillow, which is not ours: sizes, times, the loop, and colours near the pictures'."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from stereo_reproject.delivery.gif import write_gif
from stereo_reproject.delivery.palette import DITHER_LEVELS, LOOKUP_BITS, in_palette, palette_of
from stereo_reproject.errors import BadInputError

MAX_MEAN_LEVELS = 1.5 * DITHER_LEVELS
"""Mean difference of a picture's channels, at most: a quarter of the dither's range, and the distance to the nearest
entry where 256 colours are to do for ramps of all three channels."""

LOOKUP_LEVELS = 1 << (8 - LOOKUP_BITS)


def smooth(width=96, height=64):
    """A picture whose channels are ramps, in bytes."""
    y, x = np.mgrid[:height, :width]
    return np.stack([255 * x // width, 255 * y // height, 255 * (x + y) // (width + height)], axis=-1).astype(np.uint8)


def read_back(path):
    """The pictures of a GIF and what its header says, as Pillow has them."""
    with Image.open(path) as file:
        pictures = []
        for number in range(file.n_frames):
            file.seek(number)
            pictures.append(np.array(file.convert("RGB")))
        return pictures, file.info


def test_both_pictures_come_back_in_their_order_and_play_for_ever(tmp_path):
    left, right = smooth(), smooth()[:, ::-1]
    write_gif(tmp_path / "wiggle.gif", [left, right], 0.25)
    found, info = read_back(tmp_path / "wiggle.gif")
    assert len(found) == 2
    assert info["loop"] == 0
    assert info["duration"] == 250
    for picture, back in zip((left, right), found, strict=True):
        assert back.shape == picture.shape
        assert np.abs(back.astype(int) - picture).mean() < MAX_MEAN_LEVELS
    assert np.abs(found[0].astype(int) - left).mean() < np.abs(found[1].astype(int) - left).mean()


def test_pictures_of_few_colours_keep_each_to_the_lookup_s_step(tmp_path):
    """A palette that holds every colour: only the dither may choose another, and here they are far apart."""
    colours = np.array([[0, 0, 0], [255, 255, 255], [220, 30, 30], [30, 60, 220]], np.uint8)
    picture = colours[np.random.default_rng(3).integers(0, 4, (40, 50))]
    write_gif(tmp_path / "few.gif", [picture], 0.1)
    (found,), _ = read_back(tmp_path / "few.gif")
    assert np.abs(found.astype(int) - picture).max() <= LOOKUP_LEVELS


def test_what_stands_still_is_the_same_in_both(tmp_path):
    left = smooth()
    right = left.copy()
    right[:20] = 255 - right[:20]
    write_gif(tmp_path / "wiggle.gif", [left, right], 0.2)
    found, _ = read_back(tmp_path / "wiggle.gif")
    np.testing.assert_array_equal(found[0][20:], found[1][20:])


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 1 << 16), width=st.integers(1, 90), height=st.integers(1, 90), levels=st.integers(1, 256))
def test_any_picture_in_its_own_palette_is_read_as_it_is(tmp_path_factory, seed, width, height, levels):
    """Grey levels of noise fill the table of strings and begin it anew, and end on each number of bits."""
    path = tmp_path_factory.getbasetemp() / "any.gif"
    picture = np.random.default_rng(seed).integers(0, levels, (height, width, 1), np.uint8).repeat(3, axis=2)
    write_gif(path, [picture], 0.1)
    (found,), _ = read_back(path)
    palette = palette_of(picture, 256)
    np.testing.assert_array_equal(found, palette[in_palette(picture, palette)])


def test_the_mean_of_a_dithered_grey_is_that_grey():
    """Between two entries, the dither mixes them in the right shares."""
    palette = np.array([[100] * 3, [108] * 3], np.uint8)
    for grey in (103, 104, 105):
        picture = np.full((64, 64, 3), grey, np.uint8)
        mean = palette[in_palette(picture, palette)].mean()
        assert abs(mean - grey) < LOOKUP_LEVELS


def test_a_gif_too_large_for_its_header_is_refused(tmp_path):
    with pytest.raises(BadInputError, match="65535"):
        write_gif(tmp_path / "wide.gif", [np.zeros((1, 65536, 3), np.uint8)], 0.1)
    assert not (tmp_path / "wide.gif").exists()
