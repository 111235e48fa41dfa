"""Animations whose frames are made from key frames: the same wherever a run begins, and right in what moves."""

import json
from dataclasses import replace

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.commands.animation import render_animation_files
from stereo_reproject.errors import BadInputError
from stereo_reproject.images.exr import read_channels
from stereo_reproject.sequence.progress import Listener
from stereo_reproject.settings.animation import AnimationSettings, read_reuse
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from tests.blender.scene.test_changes import brighter_lamp, keyed, moving_box, moving_camera
from tests.render.test_trace_requests import small_studio
from tests.render.test_views_frames import saved

SETTINGS = StereoSettings(fill="packed", scene=SceneOverrides(size=(96, 64), samples=8, denoise=False, seed=3))


def as_exr(scene):
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.use_multiview = True
    scene.render.image_settings.views_format = "INDIVIDUAL"
    scene.frame_start, scene.frame_end = 1, 4


def frames_of(scene, folder, *, frames=(1, 2, 3, 4), settings=SETTINGS, **options):
    """The report of an animation in folder/out."""
    folder.mkdir(exist_ok=True)
    asked = AnimationSettings(
        frames=tuple(frames), output=str(folder / "out"), layout="individual", file_format="OPEN_EXR", **options
    )
    render_animation_files(scene, settings, asked, saved(scene, folder), listener=Listener())
    return json.loads((folder / "out" / "animation.json").read_text())


def nudged_box(scene):
    keyed(bpy.data.objects["Box"], "location", -1.0, -0.8, 0)


def eye(folder, frame, letter):
    return read_channels(folder / "out" / f"{frame:04d}_{letter}.exr")


def test_a_made_frame_is_the_same_wherever_a_run_begins(tmp_path):
    scene = small_studio(tmp_path, moving_camera, nudged_box, as_exr, lit=True)
    report = frames_of(scene, tmp_path / "all", reuse=4)
    assert [row["reuse"]["key_frame"] for row in report["frames"]] == [None, 1, 1, 1]
    assert report["frames"][0]["reuse"]["whole"] == "a key frame"
    assert all(row["reuse"]["first_eye_traced"] < 0.9 for row in report["frames"][1:])
    frames_of(scene, tmp_path / "later", frames=(3,), reuse=4)
    for letter in "LR":
        ours, alone = eye(tmp_path / "all", 3, letter), eye(tmp_path / "later", 3, letter)
        assert ours.keys() == alone.keys()
        for channel, values in alone.items():
            np.testing.assert_array_equal(ours[channel], values, err_msg=channel)


def test_each_eye_of_a_made_frame_keeps_the_promise_and_flicker_is_measured(tmp_path):
    scene = small_studio(tmp_path, moving_camera, as_exr, lit=True)
    report = frames_of(scene, tmp_path / "all", frames=(1, 2, 3), reuse=3, compare_every=1)
    compared = report["compare"]
    assert compared["frames"] == 3
    assert compared["honest_ratio"] < 1.25, "small pictures, few samples"
    assert 0.0 < compared["flicker"] < 2.0
    assert compared["speedup"] == report["totals"]["speedup"]
    assert "first_eye" not in report["frames"][0]["compare"]
    for row in report["frames"][1:]:
        assert row["compare"]["first_eye"]["honest_ratio"] < 1.25


def test_frames_are_made_by_the_camera_without_osl_too(tmp_path):
    scene = small_studio(tmp_path, moving_camera, as_exr, lit=True)
    report = frames_of(scene, tmp_path / "all", frames=(1, 2), settings=replace(SETTINGS, packed_by="portal"), reuse=2)
    assert [row["reuse"]["key_frame"] for row in report["frames"]] == [None, 1]


def test_frames_after_a_compared_key_frame_are_denoised(tmp_path):
    """A comparison leaves nothing of the scene in which the key frame was rendered and denoised."""
    scene = small_studio(tmp_path, moving_camera, as_exr, lit=True)
    denoised = replace(SETTINGS, scene=replace(SETTINGS.scene, denoise=True))
    report = frames_of(scene, tmp_path / "all", frames=(1, 2), settings=denoised, reuse=2, compare_every=2)
    assert "compare" in report["frames"][0]
    assert [row["reuse"]["key_frame"] for row in report["frames"]] == [None, 1]


def test_what_moves_is_where_a_plain_render_has_it(tmp_path):
    """The box goes on by some pixels: without being traced anew it would stay behind."""
    scene = small_studio(tmp_path, nudged_box, as_exr, lit=True)
    many = replace(SETTINGS, scene=replace(SETTINGS.scene, samples=64))
    report = frames_of(scene, tmp_path / "made", frames=(1, 4), settings=many, reuse=4)
    assert report["frames"][1]["reuse"]["key_frame"] == 1
    frames_of(scene, tmp_path / "plain", frames=(1, 4), settings=many)
    for letter in "LR":
        made, plain, before = (
            np.stack([eye(tmp_path / folder, frame, letter)[channel] for channel in "RGB"], axis=-1)
            for folder, frame in (("made", 4), ("plain", 4), ("plain", 1))
        )
        moved = np.abs(plain - before).max(axis=-1) > 0.1
        assert moved.sum() > 50
        apart = np.abs(made - plain)
        assert apart[moved].mean() < 0.1 * np.abs(before - plain)[moved].mean() + 2.0 * apart[~moved].mean()


def test_a_frame_whose_light_changes_is_rendered_whole_and_says_so(tmp_path):
    scene = small_studio(tmp_path, brighter_lamp, as_exr, lit=True)
    report = frames_of(scene, tmp_path / "all", frames=(1, 2), reuse=4)
    assert report["frames"][1]["reuse"]["key_frame"] is None
    assert "light" in report["frames"][1]["reuse"]["whole"]


def test_motion_blur_says_why_nothing_is_made(tmp_path):
    def blurred(scene):
        scene.render.use_motion_blur = True

    scene = small_studio(tmp_path, moving_box, blurred, as_exr, lit=True)
    report = frames_of(scene, tmp_path / "all", frames=(1, 2), reuse=4)
    assert [row["reuse"]["whole"] for row in report["frames"]] == ["motion blur"] * 2


def test_a_cut_begins_anew(tmp_path):
    def cut(scene):
        other = bpy.data.objects.new("Other", scene.camera.data.copy())
        scene.collection.objects.link(other)
        other.matrix_world = scene.camera.matrix_world
        other.location.x += 0.5
        for frame, camera in ((1, scene.camera), (3, other)):
            scene.timeline_markers.new(f"F{frame}", frame=frame).camera = camera
        keyed(other, "location", other.location[0], other.location[0] + 0.1, 0)

    scene = small_studio(tmp_path, cut, as_exr, lit=True)
    report = frames_of(scene, tmp_path / "all", reuse=4)
    assert [row["reuse"]["key_frame"] for row in report["frames"]] == [None, 1, None, 3]


def test_frames_of_another_reuse_are_no_frames_of_this_one(tmp_path):
    scene = small_studio(tmp_path, moving_camera, as_exr, lit=True)
    frames_of(scene, tmp_path / "all", frames=(1, 2), reuse=4)
    kept = frames_of(scene, tmp_path / "all", frames=(1, 2), reuse=4, existing="resume")
    assert [row["reuse"]["key_frame"] for row in kept["frames"]] == [None, 1]
    again = frames_of(scene, tmp_path / "all", frames=(1, 2), existing="resume")
    assert all("reuse" not in row for row in again["frames"])


@pytest.mark.parametrize("text", ["1", "0", "-3", "often", "1001", "2.5", ""])
def test_a_number_of_frames_that_cannot_be_reused_is_refused(text):
    with pytest.raises(BadInputError, match="--reuse must be auto, off, or a whole number from 2 to 1000"):
        read_reuse(text)
    with pytest.raises(BadInputError, match="reuse must be a whole number"):
        AnimationSettings(reuse=1)


def test_reuse_is_read_as_a_number_or_a_word():
    assert (read_reuse("12"), read_reuse("off")) == (12, None)
    assert read_reuse("auto") >= 2
