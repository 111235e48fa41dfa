"""The sheet of cut-outs: it misses no traced pixel, and takes little memory however large the panorama is."""

import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest

from stereo_reproject.blender.output.cutout_sheet import SIZES_PX, sheet_cutouts, write_cutouts
from stereo_reproject.blender.output.pictures import COLOURS, MAX_USUAL_WIDTH_PX, legend_below, read_png
from stereo_reproject.images.exr import VIEWS
from stereo_reproject.images.passes import COLOUR_PASS
from stereo_reproject.images.reasons import Reason
from stereo_reproject.views.panorama import PanoramicCamera
from stereo_reproject.views.projections import Equirectangular
from tests.views.test_panorama import HALF, PICTURE, WHOLE

PIXELS_OF_THE_SHEET = 3 * 5 * SIZES_PX[1] ** 2

MOST_BYTES_PER_PIXEL = 25
"""Bytes of the sheet's own pixels at its largest: four channels of both eyes in float32 and of all rows in bytes, and
what is made of them, together some 16."""

MOST_BYTES_OF_BANDS = 48 << 20
"""Temporaries of four threads, with 12 MB each."""


def vr180(width):
    return PanoramicCamera(width, width, np.eye(4), PICTURE, Equirectangular(HALF, HALF))


def frame(eye, reasons):
    grey = np.broadcast_to(np.float32([0.2, 0.2, 0.2, 1.0]), (*reasons.shape, 4))
    return SimpleNamespace(camera=eye, eyes={view: {COLOUR_PASS: grey} for view in VIEWS}, reasons=reasons)


def test_it_takes_little_beside_the_eyes(tmp_path):
    """Of a panorama three times as wide as the sheet's cut-outs need: one made smaller, and the sheet."""
    width = 3000
    made = frame(vr180(width), np.zeros((width, width), np.uint16))
    tracemalloc.start()
    try:
        write_cutouts(tmp_path / "sheet.png", made, "right", with_legend=False)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    smaller = 16 * (width // 2) ** 2
    assert peak < smaller + MOST_BYTES_PER_PIXEL * PIXELS_OF_THE_SHEET + MOST_BYTES_OF_BANDS


@pytest.mark.parametrize("width", [600, 2200])
def test_no_line_of_traced_pixels_is_missed(tmp_path, width):
    """Lines a pixel wide, every 32 pixels: each is seen in the front cut-out, larger panoramas in fainter colours."""
    eye = vr180(width)
    reasons = np.zeros((width, width), np.uint16)
    reasons[:, 16::32] = Reason.DISOCCLUDED.bit
    write_cutouts(tmp_path / "sheet.png", frame(eye, reasons), "right", with_legend=False)
    (front, *_) = sheet_cutouts(eye)
    # The middle row of the last picture: the front cut-out, without what the sheet has beside it.
    row = np.rint(255.0 * read_png(tmp_path / "sheet.png"))[-front.size // 2, : front.size]
    red = row[:, 0] > row[:, 2] + 10.0
    lines = np.count_nonzero(red[1:] & ~red[:-1]) + int(red[0])
    in_front = np.count_nonzero(np.abs(np.arange(16, width, 32) + 0.5 - 0.5 * width) < 0.25 * width)
    assert lines == pytest.approx(in_front, abs=1)
    if front.size == front.times * width:
        assert (row == COLOURS[Reason.DISOCCLUDED]).all(axis=-1).any()


def test_a_dome_has_cutouts_of_its_own_size():
    """The first looks at a pole."""
    dome = PanoramicCamera(2048, 512, np.eye(4), PICTURE, Equirectangular(WHOLE, (0.0, 0.5 * np.pi)))
    first = sheet_cutouts(dome)[0]
    assert (first.cutout.title, first.size, first.coarser) == ("up 90°", 640, 1)


def test_texts_of_a_wide_picture_are_as_large_as_in_one_of_usual_width_when_both_fill_a_window(tmp_path):
    usual, wide = (drawn_height(tmp_path, width) / width for width in (MAX_USUAL_WIDTH_PX, 5 * SIZES_PX[1]))
    assert wide == pytest.approx(usual, rel=0.1)
    assert drawn_height(tmp_path, 400) == drawn_height(tmp_path, MAX_USUAL_WIDTH_PX)


def drawn_height(folder, width):
    """Rows of bright pixels in a text below a picture of this width."""
    picture = legend_below(folder / "text.png", [("Hg", None)], width)
    return np.ptp(np.flatnonzero((picture > 128).any(axis=(1, 2)))) + 1
