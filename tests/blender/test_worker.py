"""The worker's own side of a run."""

import json
import threading
from pathlib import Path

import bpy
import pytest

from stereo_reproject import supervisor, worker
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
