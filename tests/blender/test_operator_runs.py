"""A run that is cancelled, or fails, at any of its stages: nothing is left of it, and the next one works."""

import sys
import tempfile
from pathlib import Path

import bpy
import pytest

from tests.blender.snapshot import everything
from tests.blender.toolbox import Material, add_camera, add_plane, add_sphere, add_sun, diffuse, empty_scene

STAGES = ["load", "source", "warp", "fill", "refine", "composite", "account", "write"]

FAILING_WORKER = """
import sys
from stereo_reproject import worker

stage = sys.argv[1]

def fails(job, emit, do=worker.run_job):
    def tell(event, **fields):
        emit(event, **fields)
        if fields.get("stage") == stage:
            raise RuntimeError(f"forced in {stage}")
    do(job, tell)

worker.run_job = fails
worker.main()
"""


@pytest.fixture
def scene():
    """A mirror ball before a matte wall: holes, probes and something to refine."""
    scene = empty_scene(96, 54, samples=4)
    add_plane(scene, diffuse("wall"), size=(30, 20), location=(0, 0, -9))
    mirror = Material("mirror")
    add_sphere(scene, mirror.surface(mirror.node("BsdfGlossy")), radius=1.4, location=(0.3, 0.2, -6.0))
    add_sun(scene)
    add_camera(scene)
    return scene


@pytest.fixture
def place(tmp_path, monkeypatch):
    """Where temporary files go; nothing but what the test itself writes may be left there."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


@pytest.mark.parametrize("stage", STAGES)
def test_cancelled(extension, scene, place, monkeypatch, stage):
    from stereo_reproject_extension.operators import jobs, run

    told = run.Run._on_event

    def cancel_there(self, event):
        told(self, event)
        if event.get("stage") == stage:
            self.cancel()

    before = everything()
    monkeypatch.setattr(run.Run, "_on_event", cancel_there)
    assert bpy.ops.render.stereo_reproject_image() == {"CANCELLED"}
    assert everything() == before
    assert (jobs.running(), list(place.iterdir())) == (None, [])
    monkeypatch.setattr(run.Run, "_on_event", told)
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert everything() == before


@pytest.mark.parametrize("stage", STAGES)
def test_failed(extension, scene, place, monkeypatch, stage):
    from stereo_reproject_extension.operators import jobs, run

    before = everything()
    command = [sys.executable, "-c", FAILING_WORKER, stage]
    monkeypatch.setattr(run, "worker_command", lambda: command)
    with pytest.raises(RuntimeError, match=f"forced in {stage}"):
        bpy.ops.render.stereo_reproject_image()
    assert everything() == before
    assert (jobs.running(), list(place.iterdir())) == (None, [])


def test_a_delivery_that_fails_leaves_the_scene_as_it_was(extension, scene, place, monkeypatch):
    from stereo_reproject_extension.operators import jobs
    from stereo_reproject_extension.stereo_reproject.blender import delivery

    def fails(*_args, **_how):
        raise RuntimeError("forced in delivery")

    before = everything()
    with monkeypatch.context() as patched:
        patched.setattr(delivery, "call_render", fails)
        with pytest.raises(RuntimeError, match="forced in delivery"):
            bpy.ops.render.stereo_reproject_image()
    assert everything() == before
    assert (jobs.running(), list(place.iterdir())) == (None, [])
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}


def test_a_second_start_is_refused(extension, scene, monkeypatch):
    from stereo_reproject_extension.operators import jobs

    monkeypatch.setattr(jobs, "_running", [object()])
    for operator in (bpy.ops.render.stereo_reproject_image, bpy.ops.stereo_reproject.check_scene):
        with pytest.raises(RuntimeError, match="running already"):
            operator()
    monkeypatch.setattr(jobs, "_running", [])


def test_switching_the_extension_off_ends_a_run(package, scene, place):
    package.register()
    from stereo_reproject_extension.operators import jobs
    from stereo_reproject_extension.operators.render import RENDER_OT_stereo_reproject_image as operator

    jobs._running.append(operator.start(_Image(), scene))
    assert any(Path(place).iterdir())
    package.unregister()
    assert (jobs.running(), list(place.iterdir())) == (None, [])


class _Image:
    preview = False
