"""The files of frames that are many views: players read the end of a quilt's name."""

import json
from dataclasses import asdict, replace

import pytest

from stereo_reproject.delivery.quilts import Quilt
from stereo_reproject.sequence.quilt_frames import QuiltFrames
from stereo_reproject.settings.views import view_names

QUILT = Quilt(8, 6, 0.75, (420, 560))


def files(layout=None):
    return QuiltFrames(QUILT, {name: name for name in view_names(48)}, layout)


def test_the_frame_stands_before_what_players_read():
    assert files().files(7) == ["quilt_0007_qs8x6a0.75.png", "quilt_0007_qs8x6a0.75.exr", "reports/0007.json"]
    assert files().quilts(12345)[0] == "quilt_12345_qs8x6a0.75.png"


def test_the_frames_of_a_view_are_a_sequence_of_pictures():
    of_views = files("individual").view_files(7)
    assert len(of_views) == 48
    assert of_views["view_03"] == "views/view_03_0007.exr"
    assert files("individual").files(7)[-2:] == ["views/view_47_0007.exr", "reports/0007.json"]


def test_all_views_of_a_frame_may_be_in_one_file():
    stored = files("multi-view")
    assert stored.view_files(7) == {}
    assert stored.files(7) == [*files().files(7)[:-1], "views_0007.exr", "reports/0007.json"]


@pytest.mark.parametrize(
    ("layout", "stored"),
    [("individual", ["views/a_b_0007.exr", "views/right_0007.exr"]), ("multi-view", ["views_0007.exr"])],
)
def test_without_a_quilt_the_views_show_a_frame(layout, stored):
    scene_views = QuiltFrames(None, {"a:b": "a_b", "right": "right"}, layout)
    assert scene_views.pictures(7) == stored
    assert scene_views.files(7) == [*stored, "reports/0007.json"]
    assert files(layout).pictures(7) == files().quilts(7)[:1]


@pytest.mark.parametrize("layout", [None, "individual", "multi-view"])
@pytest.mark.parametrize("quilt", [QUILT, None])
def test_another_process_is_told_all_of_it(layout, quilt):
    if layout is not None or quilt is not None:
        known = replace(files("individual"), quilt=quilt, layout=layout)
        assert QuiltFrames.of_fields(json.loads(json.dumps(asdict(known)))) == known
