"""The render time in metadata and stamps is the pair's, at the place where Blender's own would stand."""

import numpy as np
import OpenEXR
import pytest

from stereo_reproject.blender.output.delivery import deliver_side_by_side, deliver_to_result
from stereo_reproject.blender.output.stamp import timecode, with_render_time
from stereo_reproject.images.passes import COLOUR_PASS
from tests.blender.snapshot import everything
from tests.blender.toolbox import add_camera, empty_scene
from tests.operators.test_operators import views_of_result

SIZE = (320, 90)

LABEL_PX = 70
"""Columns of the stamp that hold its label, "RenderTime", in letters of 12 pixels; digits come after it."""

STAMPS = ("camera", "date", "filename", "frame", "frame_range", "hostname", "lens", "marker", "memory", "scene", "time")


@pytest.fixture
def scene():
    scene = empty_scene(*SIZE, samples=1)
    add_camera(scene)
    render = scene.render
    for name in STAMPS:
        setattr(render, f"use_stamp_{name}", False)
    render.use_stamp = render.use_stamp_render_time = True
    return scene


def grey_eye():
    grey = np.full((SIZE[1], SIZE[0], 4), 0.2, np.float32)
    grey[..., 3] = 1.0
    return grey


def left_eye(scene, folder, metadata):
    """What is delivered with the metadata, as Blender saves it; a grey picture but for its stamp."""
    eyes = {view: {scene.view_layers[0].name: {COLOUR_PASS: grey_eye()}} for view in ("left", "right")}
    deliver_to_result(scene, eyes, metadata=metadata)
    folder.mkdir()
    return views_of_result(scene, folder)["_L"][..., :3]


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.004, "00:00.00"), (12.34, "00:12.34"), (205.07, "03:25.07"), (7384.5, "02:03:04.50")]
)
def test_times_are_written_as_blender_does(seconds, text):
    assert timecode(seconds) == text


def test_the_stamp_has_the_pair_s_time_where_blender_has_its_own(scene, tmp_path):
    blenders_own = left_eye(scene, tmp_path / "own", {})
    ours = left_eye(scene, tmp_path / "ours", with_render_time({}, 45.67))
    another = left_eye(scene, tmp_path / "another", with_render_time({}, 89.01))
    written = blenders_own != grey_eye()[..., :3]
    assert written[:, :LABEL_PX].any()
    np.testing.assert_array_equal(ours[:, :LABEL_PX], blenders_own[:, :LABEL_PX])
    assert (ours != blenders_own).any()
    assert (ours != another).any()


def test_the_scene_s_own_note_stands_beside_it(scene, tmp_path):
    scene.render.use_stamp_note, scene.render.stamp_note_text = True, "Take two"
    both = left_eye(scene, tmp_path / "both", with_render_time({}, 45.67))
    scene.render.use_stamp_note = False
    alone = left_eye(scene, tmp_path / "alone", with_render_time({}, 45.67))
    assert (both != grey_eye()[..., :3]).sum() > 1.5 * (alone != grey_eye()[..., :3]).sum()


def test_metadata_have_the_pair_s_time_and_the_scene_s_note(scene, tmp_path):
    scene.render.use_stamp_note, scene.render.stamp_note_text = True, "Take two"
    left_eye(scene, tmp_path / "result", with_render_time({"Cast": "nobody"}, 45.67))
    with OpenEXR.File(str(tmp_path / "result" / "result_L.exr")) as file:
        header = dict(file.header())
    assert {name: header[name] for name in ("RenderTime", "Note", "Cast")} == {
        "RenderTime": "00:45.67",
        "Note": "Take two",
        "Cast": "nobody",
    }


def test_without_the_scene_s_render_time_there_is_none(scene, tmp_path):
    """So that a frame rendered again can be the same file."""
    scene.render.use_stamp_render_time = False
    eye = left_eye(scene, tmp_path / "result", with_render_time({}, 45.67))
    np.testing.assert_array_equal(eye, grey_eye()[..., :3])
    with OpenEXR.File(str(tmp_path / "result" / "result_L.exr")) as file:
        assert "RenderTime" not in file.header()


def test_the_scene_s_settings_are_as_they_were(scene, tmp_path):
    scene.render.use_stamp_note, scene.render.stamp_note_text = True, "Take two"
    before = everything()
    eyes = {view: grey_eye() for view in ("left", "right")}
    deliver_side_by_side(scene, eyes, tmp_path / "pair.png", metadata=with_render_time({}, 45.67))
    assert everything() == before
