"""Mono animations: frames of one view, through the scene's own camera, of which only key frames are rendered whole."""

import json
from dataclasses import replace

import bpy
import numpy as np
import pytest
from bpy.app.handlers import persistent

from stereo_reproject.blender.commands.animation import render_animation_files
from stereo_reproject.blender.commands.compare import REFERENCE_SEED_OFFSET, REPEATED_SEED_OFFSET, render_reference
from stereo_reproject.blender.engines.render import call_render
from stereo_reproject.blender.engines.renderer import shifted_seed
from stereo_reproject.blender.output.pictures import read_png
from stereo_reproject.errors import BadInputError
from stereo_reproject.images.exr import read_channels
from stereo_reproject.sequence.progress import Listener
from stereo_reproject.settings.animation import AnimationSettings
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings, for_mono
from tests.blender.scene.test_changes import brighter_lamp, keyed, moving_camera
from tests.render.test_key_frames import nudged_box
from tests.render.test_trace_requests import small_studio
from tests.render.test_views_frames import saved

SETTINGS = StereoSettings(fill="packed")
SIZE, SAMPLES, SEED = (96, 64), 8, 3

SYNCED_ANEW = 1e-5
"""Difference of colours of the same rays where Cycles has built its tree of surfaces anew, as after a comparison."""


def as_exr(scene):
    """The scene as it is rendered, with stereo settings that a mono animation does not look at."""
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.cycles.samples, scene.cycles.seed, scene.cycles.use_denoising = SAMPLES, SEED, False
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR", "32", "NONE"
    scene.render.use_multiview = True
    settings.views_format = "INDIVIDUAL"
    scene.render.filepath = "//shot_"
    scene.frame_start, scene.frame_end = 1, 4
    scene.camera.scale = (1.7, 0.6, 1.1)
    keyed(scene.camera.data.stereo, "interocular_distance", 0.1, 0.4)


def report_of(folder):
    return json.loads((folder / "shot_animation.json").read_text())


def frames_of(scene, folder, *, frames=(1, 2, 3, 4), settings=SETTINGS, **options):
    """The report of a mono animation in folder/out."""
    folder.mkdir(exist_ok=True)
    options = {"reuse": 4, "mono": True, **options}
    asked = AnimationSettings(frames=tuple(frames), output=str(folder / "out"), **options)
    render_animation_files(scene, settings, asked, saved(scene, folder), listener=Listener())
    return report_of(folder / "out")


def blenders_own(scene, folder):
    """Render the scene's frames into folder/plain, as Blender itself does without stereoscopy."""
    scene.render.use_multiview, scene.render.filepath = False, f"{folder / 'plain'}/shot_"
    try:
        call_render(scene, animation=True)
    finally:
        scene.render.use_multiview, scene.render.filepath = True, "//shot_"


def colour_of(path):
    channels = read_channels(path)
    return np.stack([channels[letter] for letter in "RGB"], axis=-1)


def assert_same_rays(one, other, frame):
    pictures = (colour_of(folder / f"out/shot_{frame:04d}.exr") for folder in (one, other))
    np.testing.assert_allclose(*pictures, rtol=SYNCED_ANEW, atol=SYNCED_ANEW)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The folder of an animation of ours and of Blender's own, beside each other, and the report of ours."""
    folder = tmp_path_factory.mktemp("mono")
    scene = small_studio(folder, moving_camera, nudged_box, as_exr, lit=True)
    report = frames_of(scene, folder, compare_every=1, holes=True)
    blenders_own(scene, folder)
    return folder, report


def test_names_and_channels_are_those_that_blender_gives(made):
    folder, report = made
    ours, plain = folder / "out", folder / "plain"
    names = sorted(path.name for path in plain.iterdir())
    assert names == [f"shot_{frame:04d}.exr" for frame in (1, 2, 3, 4)]
    assert sorted(path.name for path in ours.glob("*.exr")) == names
    assert sorted(path.name for path in (ours / "holes").iterdir()) == [
        f"shot_{frame:04d}.png" for frame in range(1, 5)
    ]
    for name in names:
        assert read_channels(ours / name).keys() == read_channels(plain / name).keys()
    assert [row["files"][-1] for row in report["frames"]] == names


def test_a_key_frame_is_the_frame_that_blender_renders(made):
    folder, report = made
    assert [row["reuse"]["key_frame"] for row in report["frames"]] == [None, 1, 1, 1]
    assert report["frames"][0]["reuse"] == {"key_frame": None, "whole": "a key frame"}
    ours, plain = (colour_of(folder / name / "shot_0001.exr") for name in ("out", "plain"))
    np.testing.assert_array_equal(ours, plain)
    ours, plain = (colour_of(folder / name / "shot_0004.exr") for name in ("out", "plain"))
    assert np.abs(ours - plain).max() > 0.01, "the test would not see another noise"


def test_made_frames_keep_the_promise_and_are_held_against_plain_renders(made):
    _, report = made
    compared = report["compare"]
    assert compared["frames"] == 4
    assert compared["honest_ratio"] < 1.25, "small pictures, few samples"
    assert 0.0 < compared["flicker"] < 2.0
    assert compared["speedup"] == report["totals"]["speedup"]
    assert report["totals"]["multiview_synced"] is None
    assert not any(row["compare"]["synced_anew"] for row in report["frames"])
    for row in report["frames"]:
        assert "first_eye" not in row["compare"]
        assert row["views"] == 1
    traced = [row["fractions"]["rerendered"] for row in report["frames"]]
    assert traced[0] == 1.0
    assert max(traced[1:]) < 0.9


def test_the_plain_render_that_is_timed_finds_its_scene_synced(tmp_path):
    """As with persistent data: the scene is rendered before, with the other seed."""
    scene = small_studio(tmp_path, as_exr)
    seeds = []

    @persistent
    def note(rendered, *_):
        seeds.append(rendered.cycles.seed)

    bpy.app.handlers.render_pre.append(note)
    try:
        found = render_reference(scene, for_mono(SETTINGS), tmp_path)
    finally:
        bpy.app.handlers.render_pre.remove(note)
    assert seeds == [shifted_seed(SEED, offset) for offset in (REPEATED_SEED_OFFSET, REFERENCE_SEED_OFFSET)]
    assert found.noise_rmse > 0.0
    assert found.first is None


def test_a_made_frame_is_the_same_wherever_a_run_begins_and_is_kept(made, tmp_path):
    folder, _ = made
    scene = small_studio(tmp_path, moving_camera, nudged_box, as_exr, lit=True)
    frames_of(scene, tmp_path, frames=(3,))
    assert_same_rays(tmp_path, folder, 3)
    before = (tmp_path / "out/shot_0003.exr").stat().st_mtime_ns
    report = frames_of(scene, tmp_path, frames=(3, 4), existing="resume")
    assert [row["reuse"]["key_frame"] for row in report["frames"]] == [1, 1]
    assert (tmp_path / "out/shot_0003.exr").stat().st_mtime_ns == before
    assert_same_rays(tmp_path, folder, 4)


def test_frames_of_pairs_are_no_mono_frames(tmp_path):
    scene = small_studio(tmp_path, moving_camera, as_exr, lit=True)
    frames_of(scene, tmp_path, frames=(1,), mono=False, layout="side-by-side")
    report = frames_of(scene, tmp_path, frames=(1,), existing="resume")
    assert [row.get("views") for row in report["frames"]] == [1]


def test_a_frame_that_cannot_be_made_is_blenders_too(tmp_path):
    scene = small_studio(tmp_path, brighter_lamp, as_exr, lit=True)
    report = frames_of(scene, tmp_path, frames=(2,))
    assert "light" in report["frames"][0]["reuse"]["whole"]
    scene.frame_start = scene.frame_end = 2
    blenders_own(scene, tmp_path)
    ours, plain = (colour_of(tmp_path / name / "shot_0002.exr") for name in ("out", "plain"))
    np.testing.assert_array_equal(ours, plain)


def test_a_movie_is_made_of_frames_with_layers(tmp_path):
    scene = small_studio(tmp_path, moving_camera, as_exr, lit=True)
    report = frames_of(scene, tmp_path, frames=(1,), file_format="OPEN_EXR_MULTILAYER", movie="")
    assert [row["files"] for row in report["frames"]] == [["shot_0001.exr"]]
    assert b"avc1" in (tmp_path / "out/shot.mp4").read_bytes()


def test_a_scene_whose_format_is_a_movie_gives_one_without_marks(tmp_path):
    def as_movie(scene):
        settings = scene.render.image_settings
        settings.views_format = "STEREO_3D"
        if hasattr(settings, "media_type"):
            settings.media_type = "VIDEO"
        settings.file_format = "FFMPEG"
        scene.render.ffmpeg.format, scene.frame_end = "MPEG4", 2

    scene = small_studio(tmp_path, moving_camera, as_exr, as_movie, lit=True)
    options = AnimationSettings(output=str(tmp_path / "out"), reuse=4, mono=True)
    done = render_animation_files(scene, SETTINGS, options, saved(scene, tmp_path), listener=Listener())
    (movie,) = done["movies"]
    assert movie.endswith("shot_0001-0002.mp4")
    content = (tmp_path / "out/shot_0001-0002.mp4").read_bytes()
    assert b"avc1" in content
    assert b"st3d" not in content
    assert read_png(tmp_path / "out/shot_0001.png").shape[:2] == SIZE[::-1]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"reuse": None}, "mono needs reuse: without, Blender itself renders such an animation"),
        ({"layout": "side-by-side"}, "mono frames hold one view: leave the layout out"),
    ],
)
def test_what_mono_cannot_have_is_refused(options, message):
    with pytest.raises(BadInputError, match=message):
        AnimationSettings(**{"reuse": 4, "mono": True, **options})


@pytest.mark.parametrize(
    ("settings", "what"),
    [
        ({"source": "right"}, "source eye"),
        ({"scene": SceneOverrides(interocular_distance=0.065)}, "interocular distance"),
        ({"scene": SceneOverrides(convergence_mode="parallel")}, "convergence mode"),
        ({"scene": SceneOverrides(panorama="vr180", size=(64, 64))}, "panorama for headsets"),
    ],
)
def test_what_is_of_two_eyes_is_refused(tmp_path, settings, what):
    scene = small_studio(tmp_path, as_exr)
    with pytest.raises(BadInputError, match=f"a mono animation has one view and no {what}: leave it out"):
        frames_of(scene, tmp_path, settings=replace(SETTINGS, **settings))
    assert not (tmp_path / "out").exists()
