"""Pictures that explain a frame: what their legends say can be read."""

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.output import pictures
from stereo_reproject.blender.output.pictures import NOTHING_LEFT, read_png, write_estimate

HEIGHT = 90
BACKGROUND = 24 / 255
WHY = "nothing that is seen looks different from each eye, and that is a long reason"


def legend_of(folder, width, *, why_none=None, known=0.0):
    """(h, W, 3): what is below the picture of an estimate that knows this share of the pixels, no error in them."""
    path = folder / "estimate.png"
    estimates = np.full((HEIGHT, width, 3), np.nan, np.float32)
    estimates[: int(known * HEIGHT)] = 1.0
    before = set(bpy.data.images)
    write_estimate(path, np.full((HEIGHT, width, 4), 0.5, np.float32), estimates, why_none=why_none)
    assert set(bpy.data.images) == before
    return read_png(path)[HEIGHT:]


def lines_in(legend):
    """How many lines of text: runs of rows in which something is bright."""
    rows = (legend > 0.8).all(axis=-1).any(axis=1)
    return int(np.sum(rows[1:] & ~rows[:-1]) + rows[0])


@pytest.mark.parametrize("width", [160, 320, 1280])
def test_a_legend_is_not_cut_off_however_narrow_the_picture(tmp_path, width):
    legend = legend_of(tmp_path, width, why_none=WHY)
    assert legend.max() > 0.8
    np.testing.assert_allclose(legend[:, -8:], BACKGROUND, atol=1e-6)
    assert (lines_in(legend) > 1) is (width < 1280)


def test_where_there_is_no_estimate_the_picture_says_why(tmp_path):
    why, unprobed = (legend_of(tmp_path, 1280, why_none=words) for words in (WHY, None))
    written = [np.flatnonzero((legend > 0.8).all(axis=-1).any(axis=0)).max() for legend in (why, unprobed)]
    assert written[0] > 2 * written[1]
    traced = [legend_of(tmp_path, 1280, why_none=words, known=1.0) for words in (WHY, None)]
    np.testing.assert_array_equal(*traced, err_msg="what was traced needs no estimate")


def test_where_no_area_is_off_the_legend_says_so(tmp_path, monkeypatch):
    written = []
    monkeypatch.setattr(pictures, "_write_with_legend", lambda _path, _picture, legend: written.append(dict(legend)))
    target = np.full((10, 10, 4), 0.5, np.float32)
    for ratio in (1.05, 1.7):
        write_estimate(tmp_path / "estimate.png", target, np.full((10, 10, 3), ratio, np.float32))
    fine, off = written
    assert list(fine) == [NOTHING_LEFT]
    assert list(off) == ["Barely off 0.0 %", "Slightly off 0.0 %", "Clearly off 100.0 %", "Far off 0.0 %"]
