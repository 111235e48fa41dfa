"""The worker's own side of a run."""

import json
import os
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.output.opening import open_session
from stereo_reproject.errors import BadInputError
from stereo_reproject.jobs import supervisor
from stereo_reproject.programs import worker
from stereo_reproject.settings.animation import AnimationSettings
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from stereo_reproject.settings.views import views_settings
from tests.blender.toolbox import add_camera, add_plane, add_sun, diffuse, empty_scene, save_image

pytestmark = pytest.mark.blender


@pytest.fixture
def blend(tmp_path):
    scene = empty_scene(32, 18, samples=1)
    missing = bpy.data.images.new("paper", 1, 1)
    missing.source, missing.filepath = "FILE", "//paper.png"
    add_plane(scene, diffuse("wall", image=missing), size=(30, 20), location=(0, 0, -9))
    add_sun(scene)
    add_camera(scene)
    scene.cycles.use_denoising = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "wall.blend"))
    return tmp_path / "wall.blend"


@pytest.fixture
def run(blend, tmp_path):
    """Runs a job, and has what is said of it: event, its fields, and the threads that ran."""

    def run_job(command, **options):
        work = tmp_path / "work"
        for folder in ("out", "tmp"):
            (work / folder).mkdir(parents=True, exist_ok=True)
        settings = StereoSettings(scene=SceneOverrides(interocular_distance=0.1, convergence_distance=8.0))
        job = supervisor.Job(Path(blend), tmp_path, settings, command=command, **options)
        told = []
        worker.run_job(
            json.loads(supervisor._message(job, work, job.blend)),
            lambda event, **fields: told.append((event, fields, set(threading.enumerate()))),
        )
        return told

    return run_job


def assert_warned_first(told, first_render):
    """What the scene lacks is said once, before anything is rendered."""
    (warned,) = (place for place, (event, _, _) in enumerate(told) if event == "warning")
    assert told[warned][1]["message"].startswith("image file missing for 'paper'")
    assert warned < min(place for place, (_, fields, _) in enumerate(told) if fields.get("stage") == first_render)


@pytest.mark.parametrize(("command", "renders"), [("inspect", ["sketch"]), ("render", ["source", "fill"])])
def test_no_other_thread_runs_while_blender_does_and_warnings_come_first(run, command, renders):
    """4.5 dies where one takes Python's lock as an operator that was told its scene looks for it."""
    threads = set(threading.enumerate())
    told = run(command)
    assert [event for event, _, _ in told][-1] == "done"
    assert {fields.get("stage") for _, fields, _ in told} >= {"load", *renders}
    assert all(running == threads for _, _, running in told)
    assert_warned_first(told, renders[0])
    assert sum("paper" in line for line in told[-1][1]["report"]["warnings"]) == 1


def test_an_animation_warns_before_its_first_frame(run, tmp_path):
    frames = AnimationSettings(frames=(1,), output=str(tmp_path / "frames"))
    told = run("animate", files=(), animation=frames)
    assert_warned_first(told, "source")
    assert [fields["frame"] for event, fields, _ in told if event == "frame"] == [1]
    assert sum("paper" in line for line in told[-1][1]["report"]["warnings"]) == 1


@pytest.mark.parametrize("command", ["inspect", "render", "animate", "tradeoff"])
def test_strict_ends_before_anything_is_rendered(run, tmp_path, command):
    frames = AnimationSettings(frames=(1,), output=str(tmp_path / "frames")) if command == "animate" else None
    with pytest.raises(BadInputError, match="image file missing for 'paper'"):
        run(command, animation=frames, strict=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["wall.blend", "work"]


def test_frames_rendered_without_strict_are_those_of_a_strict_run(run, tmp_path, blend):
    """And the other way round: it changes no picture."""
    save_image(blend.with_name("paper.png"), np.ones((2, 2, 4), np.float32))
    frames = AnimationSettings(frames=(1,), output=str(tmp_path / "frames"), existing="resume")
    for strict, rendered in ((False, 1), (True, 0), (False, 0)):
        told = run("animate", files=(), animation=frames, strict=strict)
        assert told[-1][1]["report"]["rendered"] == rendered


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="named pipes are POSIX's")
def test_a_file_that_was_replaced_by_a_pipe_is_not_waited_for(tmp_path):
    """Between the command line's look at it and Blender's."""
    pipe = tmp_path / "wall.blend"
    os.mkfifo(pipe)
    # Whoever reads it finds its end, so that this test ends in either case.
    writer = threading.Thread(target=lambda: os.close(os.open(pipe, os.O_WRONLY)))
    writer.start()
    try:
        with pytest.raises(BadInputError, match="no regular file"):
            open_session(pipe, supervisor.Session())
    finally:
        reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
        writer.join()
        os.close(reader)


def test_many_views_are_rendered_as_asked_and_as_wide_as_the_display(run, monkeypatch, tmp_path):
    """What renders them is stood in for: it says what it was given."""
    given = {}

    def render_views_files(scene, settings, views, work, *, load_seconds, onlooker, warn):
        given.update(settings=settings, views=views, work=work, seconds=load_seconds)
        given["pixels"] = scene.render.pixel_aspect_x, scene.render.pixel_aspect_y
        onlooker.on_stage("source")
        return {"views": [], "warnings": ["a view stands behind a wall"]}, ["report.json"]

    stand_in = SimpleNamespace(render_views_files=render_views_files)
    monkeypatch.setitem(sys.modules, "stereo_reproject.blender.commands.views", stand_in)
    views = views_settings(display="16-landscape")
    told = run("views", files=(), views=views)
    assert given["views"] == views
    assert given["settings"].scene.convergence_distance == 8.0
    assert given["work"] == tmp_path / "work"
    assert given["seconds"] > 0.0
    # Of a scene with 32 x 18 pixels, which are then square.
    assert given["pixels"] == pytest.approx((1.0, 1.0))
    for size, pixels in (((857, 857), (16 / 9, 1.0)), ((857, 241), (1.0, 2.0003))):
        monkeypatch.setattr(worker, "_settings", lambda _, size=size: StereoSettings(scene=SceneOverrides(size=size)))
        run("views", files=(), views=views)
        assert given["pixels"] == pytest.approx(pixels, rel=1e-3)
    assert [event for event, _, _ in told][-1] == "done"
    assert told[-1][1]["files"] == ["report.json"]
    messages = [fields["message"] for event, fields, _ in told if event == "warning"]
    assert messages[-1] == "a view stands behind a wall"
    assert {fields.get("stage") for _, fields, _ in told} >= {"load", "source"}
