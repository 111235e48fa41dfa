"""Many views of many frames: each frame as it is alone, whatever ends the run, and a movie of all of them."""

import json
import os
import re
import signal
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.commands.animation import SavedScene, render_frames_of
from stereo_reproject.blender.commands.frame_kinds import Quilts
from stereo_reproject.blender.commands.views import render_views_files
from stereo_reproject.blender.output.pictures import read_png
from stereo_reproject.errors import BadInputError
from stereo_reproject.images.exr import read_channels
from stereo_reproject.jobs.supervisor import Session
from stereo_reproject.jobs.work_folder import WORK_PREFIX
from stereo_reproject.pipeline import many_views
from stereo_reproject.pipeline.view_plan import ViewCosts
from stereo_reproject.sequence.journal_folder import JOURNAL
from stereo_reproject.sequence.progress import Listener
from stereo_reproject.settings.animation import AnimationSettings
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from stereo_reproject.settings.views import ViewsSettings
from tests.blender.snapshot import everything
from tests.delivery.movies import frames as movie_frames
from tests.images.test_multi_view import parts_of
from tests.render import processes
from tests.render.processes import children, wait_for
from tests.render.test_command_line import DEMO, workers_of
from tests.render.test_fill import PACKED
from tests.render.test_scene_views import with_views
from tests.render.test_trace_requests import small_studio

VIEWS = ViewsSettings(4, baseline=0.3, columns=2, rows=2)
SETTINGS = StereoSettings(fill="packed", scene=SceneOverrides(size=(64, 48), samples=4, denoise=False, seed=3))
TAG = "qs2x2a1.3333"

ALL_RENDERED, NEARLY_FREE = ViewCosts(9.0, 9.0), ViewCosts(0.01, 0.01)

SECONDS = 300.0
"""Far more than any of these runs takes."""

posix = pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")


def moving_box(scene):
    box = bpy.data.objects["Box"]
    for frame, x in ((1, -1.0), (4, 0.5)):
        box.location.x = x
        box.keyframe_insert("location", frame=frame)


def moving_focus(scene):
    """The convergence distance is animated, and so is the lens, which must go on moving."""
    data = scene.camera.data
    for frame, factor in ((1, 1.0), (4, 1.4)):
        data.stereo.convergence_distance = 4.0 * factor
        data.lens = 40.0 * factor
        data.stereo.keyframe_insert("convergence_distance", frame=frame)
        data.keyframe_insert("lens", frame=frame)


def scene_of(folder, *changes):
    return small_studio(folder, moving_box, *changes, lit=True)


def saved(scene, folder):
    """The scene as the writer opens it."""
    blend, work = folder / "saved.blend", folder / "work"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend), compress=False, copy=True)
    work.mkdir(exist_ok=True)
    return SavedScene(blend, Session(), work)


def render(scene, folder, *, frames=(1, 2, 3), listener=None, views_of_a_frame=VIEWS, **options):
    """Return the report of the run, and the numbers of the frames that it tells of."""
    asked = AnimationSettings(frames=tuple(frames), output=str(folder / "out"), **options)
    told = []
    listener = listener or Listener(on_frame=lambda event: told.append(event["frame"]))
    kind = Quilts(SETTINGS, views_of_a_frame)
    return render_frames_of(kind, scene, asked, saved(scene, folder), listener=listener), told


def render_alone(scene, folder, frame, views):
    """The report of the views of this frame, rendered by themselves, and the folder of their files."""
    settings = replace(SETTINGS, scene=replace(SETTINGS.scene, frame=frame))
    folder.mkdir()
    report, _ = render_views_files(scene, settings, views, folder)
    return report, folder / "out"


def quilts(folder):
    return {path.name: path.read_bytes() for path in folder.glob("quilt_*qs*")}


@pytest.mark.parametrize("changes", [(), (moving_focus,)])
def test_each_frame_is_as_it_is_alone(tmp_path, monkeypatch, changes):
    monkeypatch.setattr(many_views, "_costs", lambda *_: ALL_RENDERED)
    scene = scene_of(tmp_path, *changes)
    render(scene, tmp_path, frames=(1, 3), views=True)
    for frame in (1, 3):
        report, alone = render_alone(scene, tmp_path / f"alone-{frame}", frame, VIEWS)
        told = json.loads((tmp_path / "out" / "reports" / f"{frame:04d}.json").read_text())
        for key in ("frame", "size", "focus_distance", "baseline", "views"):
            assert told[key] == report[key]
        for view in VIEWS.names:
            ours = read_channels(tmp_path / "out" / "views" / f"{view}_{frame:04d}.exr")
            expected = read_channels(alone / "views" / f"{view}.exr")
            assert ours.keys() == expected.keys()
            for channel, values in expected.items():
                np.testing.assert_array_equal(ours[channel], values, err_msg=f"{channel} of {view}")
        ours = read_channels(tmp_path / "out" / f"quilt_{frame:04d}_{TAG}.exr")
        np.testing.assert_array_equal(ours["R"], read_channels(alone / f"quilt_{TAG}.exr")["R"])
        shown = read_png(tmp_path / "out" / f"quilt_{frame:04d}_{TAG}.png")
        np.testing.assert_allclose(shown, read_png(alone / f"quilt_{TAG}.png"), atol=2.01 / 255.0)
    views = [read_channels(tmp_path / "out" / "views" / f"view_00_{frame:04d}.exr")["R"] for frame in (1, 3)]
    assert np.abs(views[0] - views[1]).mean() > 0.001, "nothing has moved"


def test_a_frame_that_is_rendered_again_is_the_same_though_it_would_be_decided_otherwise(tmp_path, monkeypatch):
    monkeypatch.setattr(many_views, "_costs", lambda *_: NEARLY_FREE)
    scene = scene_of(tmp_path)
    report, told = render(scene, tmp_path, views=False)
    assert told == [1, 2, 3]
    assert [row["rendered_views"] for row in report["frames"]] == [2, 2, 2]
    assert all(0.5 < row["fractions"]["rerendered"] < 1.0 for row in report["frames"])
    out = tmp_path / "out"
    before = quilts(out)
    assert sorted(before) == sorted(f"quilt_{k:04d}_{TAG}.{kind}" for k in (1, 2, 3) for kind in ("png", "exr"))
    assert not (out / "views").exists()
    (out / f"quilt_0002_{TAG}.png").write_bytes(b"damaged")
    (out / f"quilt_0003_{TAG}.exr").unlink()
    monkeypatch.setattr(many_views, "_costs", lambda *_: ALL_RENDERED)
    report, told = render(scene, tmp_path, existing="resume")
    assert told == [2, 3]
    assert quilts(out) == before
    report, told = render(scene, tmp_path, existing="resume", movie="")
    assert told == []
    (movie,) = report["movies"]
    assert Path(movie) == out / f"{Path(bpy.data.filepath).stem or scene.name}_{TAG}.mp4"
    assert len([line for line in movie_frames(Path(movie)) if line.startswith("0,")]) == 3
    # With the files of each view, what is there is not all that is asked for.
    _, told = render(scene, tmp_path, frames=(2,), existing="resume", views=True)
    assert told == [2]
    assert len(list((out / "views").iterdir())) == VIEWS.count
    assert quilts(out) == before


def parts_by_name(path):
    """The view and the channels of each part of an EXR, by the part's name, in the file's order."""
    return {header["name"]: (header["view"], channels) for header, channels in parts_of(path)}


def test_all_views_of_a_frame_may_be_in_one_file(tmp_path, monkeypatch):
    monkeypatch.setattr(many_views, "_costs", lambda *_: ALL_RENDERED)
    scene, views = scene_of(tmp_path), replace(VIEWS, layout="multi-view")
    report, told = render(scene, tmp_path, frames=(1, 3), views_of_a_frame=views)
    out = tmp_path / "out"
    assert told == [1, 3]
    assert [row["files"] for row in report["frames"]] == [
        [f"quilt_{k:04d}_{TAG}.exr", f"quilt_{k:04d}_{TAG}.png", f"reports/{k:04d}.json", f"views_{k:04d}.exr"]
        for k in (1, 3)
    ]
    assert not (out / "views").exists()
    for frame in (1, 3):
        _, alone = render_alone(scene, tmp_path / f"alone-{frame}", frame, views)
        ours, expected = (parts_by_name(path) for path in (out / f"views_{frame:04d}.exr", alone / "views.exr"))
        assert list(ours) == list(expected)
        assert {view for view, _ in ours.values()} == set(VIEWS.names)
        for name, (view, channels) in expected.items():
            assert ours[name][0] == view
            assert ours[name][1].keys() == channels.keys()
            for channel, values in channels.items():
                np.testing.assert_array_equal(ours[name][1][channel], values, err_msg=f"{channel} of {name}")
    before = (out / "views_0003.exr").read_bytes()
    (out / "views_0003.exr").write_bytes(before[:-100])
    _, told = render(scene, tmp_path, frames=(1, 3), views_of_a_frame=views, existing="resume")
    assert told == [3]
    assert (out / "views_0003.exr").read_bytes() == before
    _, told = render(scene, tmp_path, frames=(1, 3), views_of_a_frame=views, existing="overwrite")
    assert told == [1, 3]
    assert (out / "views_0003.exr").read_bytes() == before


# The scene's own views

RIG = {"left": "_L", "mid:dle": "_M", "right": "_R"}
"""Suffixes of the views, by name: one of them is no name of a file."""

FROM_SCENE = ViewsSettings(0, from_scene=True)


def moving_rig(scene):
    """Each camera is animated by itself: one passes another, and one zooms."""
    with_views(scene, RIG)
    passing, zooming = scene.objects["Rig_M"], scene.objects["Rig_R"].data
    across = scene.camera.matrix_world.to_3x3().normalized().col[0]
    start = passing.location.copy()
    for frame, away in ((1, 0.0), (3, 0.3)):
        passing.location = start + away * across
        passing.keyframe_insert("location", frame=frame)
        zooming.lens = 40.0 + 10.0 * away
        zooming.keyframe_insert("lens", frame=frame)
    scene.frame_set(1)


def same_views(folder, alone, frame):
    """Assert that the views of a frame are, to the bit, those of a run of this frame alone."""
    for file in ("left", "mid_dle", "right"):
        ours = read_channels(folder / "views" / f"{file}_{frame:04d}.exr")
        expected = read_channels(alone / "views" / f"{file}.exr")
        assert ours.keys() == expected.keys()
        for channel, values in expected.items():
            np.testing.assert_array_equal(ours[channel], values, err_msg=f"{channel} of {file}")


@pytest.mark.parametrize("packed_by", PACKED)
def test_the_scenes_own_cameras_stand_in_each_frame_as_in_it_alone(tmp_path, monkeypatch, packed_by):
    monkeypatch.setattr(many_views, "_costs", lambda *_: NEARLY_FREE)
    monkeypatch.setattr(f"{__name__}.SETTINGS", replace(SETTINGS, packed_by=packed_by))
    scene, views = scene_of(tmp_path, moving_rig), replace(FROM_SCENE, columns=2, rows=2)
    before = everything()
    report, told = render(scene, tmp_path, views_of_a_frame=views)
    assert everything() == before
    out = tmp_path / "out"
    assert told == [1, 2, 3]
    assert json.loads((out / "views_animation.json").read_text())["frames"] == report["frames"]
    assert [row["rendered_views"] for row in report["frames"]] == [2, 2, 2]
    assert any("of the 4 places of the quilt, 1 stay black" in line for line in report["warnings"])
    orders = []
    for frame in (1, 2, 3):
        own, alone = render_alone(scene, tmp_path / f"alone-{frame}", frame, views)
        told_of = json.loads((out / "reports" / f"{frame:04d}.json").read_text())
        assert [(view["name"], view["how"]) for view in told_of["views"]] == [
            (view["name"], view["how"]) for view in own["views"]
        ]
        orders.append([view["name"] for view in own["views"] if view["how"] == "made"])
        same_views(out, alone, frame)
        quilt = read_channels(out / f"quilt_{frame:04d}_{TAG}.exr")["R"]
        np.testing.assert_array_equal(quilt, read_channels(alone / f"quilt_{TAG}.exr")["R"])
    assert orders[0] == ["mid:dle"]
    assert orders[2] == ["right"], "no camera has passed another"


def test_the_scenes_own_views_need_no_quilt(tmp_path, monkeypatch):
    monkeypatch.setattr(many_views, "_costs", lambda *_: ALL_RENDERED)
    scene = scene_of(tmp_path, moving_rig)
    report, told = render(scene, tmp_path, views_of_a_frame=FROM_SCENE)
    out = tmp_path / "out"
    assert told == [1, 2, 3]
    files = sorted(path.relative_to(out).as_posix() for path in out.rglob("*.*") if JOURNAL not in path.parts)
    views = [f"views/{file}_{k:04d}.exr" for file in ("left", "mid_dle", "right") for k in (1, 2, 3)]
    assert [name for name in files if name.startswith(("quilt", "views/"))] == views
    assert report["frames"][0]["files"] == ["reports/0001.json", *views[::3]]
    (out / "views" / "left_0002.exr").unlink()
    assert render(scene, tmp_path, views_of_a_frame=FROM_SCENE, existing="resume")[1] == [2]
    # What a view's camera is called is its suffix alone, which is in no fingerprint of pairs.
    one, other = scene.render.views["left"], scene.render.views["right"]
    one.camera_suffix, other.camera_suffix = other.camera_suffix, one.camera_suffix
    assert render(scene, tmp_path, views_of_a_frame=FROM_SCENE, existing="resume")[1] == [1, 2, 3]
    in_one = replace(FROM_SCENE, layout="multi-view")
    report, _ = render(scene, tmp_path, frames=(2,), views_of_a_frame=in_one, existing="overwrite")
    assert report["frames"][0]["files"] == ["reports/0002.json", "views_0002.exr"]
    assert {view for view, _ in parts_by_name(out / "views_0002.exr").values()} == set(RIG)


def without_a_camera_later(scene):
    """A marker switches to a camera of another rig, which lacks one."""
    other = scene.camera.copy()
    other.name = "Other_L"
    scene.collection.objects.link(other)
    scene.timeline_markers.new("cut", frame=3).camera = other


def orthographic_later(scene):
    without_a_camera_later(scene)
    for suffix in ("_M", "_R"):
        other = scene.camera.copy()
        other.name, other.data = f"Other{suffix}", other.data.copy()
        scene.collection.objects.link(other)
    scene.objects["Other_R"].data.type = "ORTHO"


def scenes_camera_first(scene):
    """Of several markers, Blender takes the first before all."""
    scene.timeline_markers.new("first", frame=1).camera = scene.camera


@pytest.mark.parametrize(
    ("changes", "views", "line"),
    [
        ((scenes_camera_first, without_a_camera_later), {}, "the scene needs one called 'Other_R'"),
        ((scenes_camera_first, orthographic_later), {}, "camera 'Other_R' is no perspective camera"),
        ((), {"columns": 2, "rows": 1}, "a quilt of 2 x 1 must have a place for each of the 3 views"),
    ],
)
def test_what_a_later_frame_lacks_is_said_before_the_first(tmp_path, changes, views, line):
    scene = scene_of(tmp_path, moving_rig, *changes)
    with pytest.raises(BadInputError, match=line) as told:
        render(scene, tmp_path, views_of_a_frame=replace(FROM_SCENE, **views))
    assert "\n" not in str(told.value)
    assert not (tmp_path / "out").exists()


# The real command


SIZE = ["--size", "64x48", "--samples", "2", "--no-denoise", "--seed", "5"]
OPTIONS = ["--views", "4", "--cone", "10", "--focus", "6.9", *SIZE]


@pytest.fixture(scope="module")
def blend(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "demo.blend"
    bpy.ops.wm.open_mainfile(filepath=str(DEMO), load_ui=False)
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)
    return path


def start(blend, folder, frames, *options):
    return processes.start("views", blend, folder, "--frames", frames, *OPTIONS, *options)


def end(process, folder):
    return processes.end(process, folder, SECONDS)


def views(blend, folder, frames, *options):
    return end(start(blend, folder, frames, *options), folder)


def finished(folder):
    return sorted(path.stem for path in (folder / JOURNAL).glob("quilt_[0-9]*.json"))


@posix
@pytest.mark.slow
@pytest.mark.parametrize(("layout", "files"), [("individual", 3), ("multi-view", 4)])
def test_a_killed_run_is_gone_on_with(blend, tmp_path, layout, files):
    folder, stored = tmp_path / "out", ("--layout", layout)
    process = start(blend, folder, "1-4", *stored)
    wait_for(process, lambda: len(finished(folder)) >= 1, SECONDS)
    (worker,) = children(process.pid)
    for pid in (process.pid, worker):
        os.kill(pid, signal.SIGKILL)
    process.communicate(timeout=SECONDS)
    assert 1 <= len(finished(folder)) < 4
    before = quilts(folder)
    refused = views(blend, folder, "1-4", *stored)
    assert refused.status == 2
    assert "are there already" in refused.err
    assert "--resume keeps what is whole" in refused.err
    ended = views(blend, folder, "1-4", *stored, "--resume", "--movie")
    assert ended.status == 0, ended.err
    # What was handed over by then, the process that writes has written still.
    assert re.search("^[123] of 4 frames are there already", ended.out, re.MULTILINE)
    assert len(finished(folder)) == 4
    assert {name: data for name, data in quilts(folder).items() if name in before} == before
    assert sorted(path.name for path in folder.iterdir() if path.name.startswith(WORK_PREFIX)) == []
    assert workers_of(folder) == []
    assert (folder / f"demo_{TAG}.mp4").is_file()
    report = json.loads((folder / "quilt_animation.json").read_text())
    assert [row["frame"] for row in report["frames"]] == [1, 2, 3, 4]
    assert [len(row["files"]) for row in report["frames"]] == [files] * 4
    assert len(list(folder.glob("views_[0-9]*.exr"))) == 4 * (layout == "multi-view")
    again = views(blend, folder, "1-4", *stored, "--resume", "--samples", "3")
    assert again.status == 0, again.err
    assert "rendered again, for being of other settings: 1-4" in again.out


@posix
@pytest.mark.slow
def test_an_interrupted_run_keeps_its_frames(blend, tmp_path):
    folder = tmp_path / "out"
    process = start(blend, folder, "1-6")
    wait_for(process, lambda: len(finished(folder)) >= 1, SECONDS)
    process.send_signal(signal.SIGINT)
    ended = end(process, folder)
    assert ended.status == 130
    assert ended.err == "stereo_reproject: interrupted; finished frames are kept, and --resume renders the rest\n"
    assert finished(folder)
    assert len(quilts(folder)) >= 2


@posix
@pytest.mark.slow
def test_two_runs_share_the_frames(blend, tmp_path):
    folder = tmp_path / "out"
    both = [start(blend, folder, "1-5", "--resume") for _ in range(2)]
    ended = [end(process, folder) for process in both]
    assert [run.status for run in ended] == [0, 0], [run.err for run in ended]
    assert len(finished(folder)) == 5
    report = json.loads((folder / "quilt_animation.json").read_text())
    assert [row["frame"] for row in report["frames"]] == [1, 2, 3, 4, 5]
    assert not list((folder / JOURNAL).glob("*.claim.*"))


@posix
@pytest.mark.slow
def test_a_killed_run_of_the_scenes_own_views_is_gone_on_with_by_two(tmp_path):
    blend, folder = tmp_path / "rig.blend", tmp_path / "out"
    bpy.ops.wm.open_mainfile(filepath=str(DEMO), load_ui=False)
    moving_rig(bpy.context.scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(blend), compress=False)
    asked = ("--from-scene", "--frames", "1-4", *SIZE)
    process = processes.start("views", blend, folder, *asked)
    wait_for(process, lambda: len(list((folder / JOURNAL).glob("views_[0-9]*.json"))) >= 1, SECONDS)
    (worker,) = children(process.pid)
    for pid in (process.pid, worker):
        os.kill(pid, signal.SIGKILL)
    process.communicate(timeout=SECONDS)
    both = [processes.start("views", blend, folder, *asked, "--resume") for _ in range(2)]
    ended = [end(process, folder) for process in both]
    assert [run.status for run in ended] == [0, 0], [run.err for run in ended]
    rows = json.loads((folder / "views_animation.json").read_text())["frames"]
    assert [row["frame"] for row in rows] == [1, 2, 3, 4]
    assert len(list((folder / "views").iterdir())) == 4 * len(RIG)
    again = end(processes.start("views", blend, folder, *asked, "--quilt", "3x1"), folder)
    assert again.status == 2
    assert "are there already" in again.err


@pytest.mark.slow
def test_another_scene_in_the_same_folder_is_refused(blend, tmp_path):
    folder = tmp_path / "out"
    assert views(blend, folder, "1").status == 0
    bpy.ops.wm.open_mainfile(filepath=str(blend), load_ui=False)
    bpy.context.scene.camera.location.x += 0.1
    other = tmp_path / "other.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(other), compress=False)
    refused = views(other, folder, "1-2", "--resume")
    assert refused.status == 2
    assert "the scene has changed since frame 1 was rendered" in refused.err
    assert refused.err.count("\n") == 1
