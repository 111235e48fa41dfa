"""The files of frames that are many views: players read the end of a quilt's name."""

import json
from dataclasses import asdict

import pytest

from stereo_reproject.delivery.quilts import Quilt
from stereo_reproject.sequence.quilt_frames import QuiltFrames
from stereo_reproject.settings.views import view_names

QUILT = Quilt(8, 6, 0.75, (420, 560))


def files(layout=None):
    return QuiltFrames(QUILT, view_names(48), layout)


def test_the_frame_stands_before_what_players_read():
    assert files().files(7) == ["quilt_0007_qs8x6a0.75.png", "quilt_0007_qs8x6a0.75.exr", "reports/0007.json"]
    assert files().picture(12345) == "quilt_12345_qs8x6a0.75.png"


def test_the_frames_of_a_view_are_a_sequence_of_pictures():
    of_views = files("individual").view_files(7)
    assert len(of_views) == 48
    assert of_views["view_03"] == "views/view_03_0007.exr"
    assert files("individual").files(7)[-2:] == ["views/view_47_0007.exr", "reports/0007.json"]


def test_all_views_of_a_frame_may_be_in_one_file():
    stored = files("multi-view")
    assert stored.view_files(7) == {}
    assert stored.files(7) == [*files().files(7)[:-1], "views_0007.exr", "reports/0007.json"]


@pytest.mark.parametrize("layout", [None, "individual", "multi-view"])
def test_another_process_is_told_all_of_it(layout):
    told = json.loads(json.dumps(asdict(files(layout))))
    assert QuiltFrames.of_fields(told) == files(layout)
