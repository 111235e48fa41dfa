"""The worker's own side of a run."""

import json
import os
import threading
from pathlib import Path

import bpy
import pytest

from stereo_reproject import supervisor, worker
from stereo_reproject.blender.opening import open_session
from stereo_reproject.errors import BadInputError
from stereo_reproject.settings import SceneOverrides, StereoSettings
from tests.blender.toolbox import add_camera, add_plane, add_sun, diffuse, empty_scene

pytestmark = pytest.mark.blender


@pytest.fixture
def blend(tmp_path):
    scene = empty_scene(32, 18, samples=1)
    add_plane(scene, diffuse("wall"), size=(30, 20), location=(0, 0, -9))
    add_sun(scene)
    add_camera(scene)
    scene.cycles.use_denoising = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "wall.blend"))
    return tmp_path / "wall.blend"


@pytest.mark.parametrize("command", ["inspect", "render"])
def test_no_other_thread_runs_while_blender_does(blend, tmp_path, command):
    """4.5 dies where one takes Python's lock as an operator that was told its scene looks for it."""
    work = tmp_path / "work"
    (work / "out").mkdir(parents=True)
    (work / "tmp").mkdir()
    settings = StereoSettings(scene=SceneOverrides(interocular_distance=0.1, convergence_distance=8.0))
    job = supervisor.Job(Path(blend), tmp_path, settings, command=command)
    threads, told = set(threading.enumerate()), []
    worker.run_job(
        json.loads(supervisor._message(job, work)),
        lambda event, **fields: told.append((event, fields, set(threading.enumerate()))),
    )
    assert [event for event, _, _ in told][-1] == "done"
    assert {fields.get("stage") for _, fields, _ in told} >= {"load", "sketch" if command == "inspect" else "fill"}
    assert all(running == threads for _, _, running in told)


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
