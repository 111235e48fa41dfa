"""The second Blender that is started before there is a job for it: taken by the next job, and never left behind."""

import tempfile

import bpy
import pytest

from stereo_reproject.jobs.work_folder import is_running
from tests.blender.toolbox import mirror_before_wall
from tests.operators.conftest import PACKAGE


@pytest.fixture
def scene():
    return mirror_before_wall(64, 36, samples=1)


@pytest.fixture
def second(extension, place):
    """The module, as the extension has it."""
    from stereo_reproject_extension.operators import second_blender

    return second_blender


@pytest.fixture
def workers(second, monkeypatch):
    """The numbers of the processes that have done jobs, by what ends them."""
    from stereo_reproject_extension.stereo_reproject.jobs import supervisor

    listen, seen = supervisor._listen, []

    def note(worker, *args, **kwargs):
        seen.append(worker.process.pid)
        return listen(worker, *args, **kwargs)

    monkeypatch.setattr(supervisor, "_listen", note)
    return seen


def waiting(second):
    second.start()
    [one] = second._waiting
    assert one.worker.process.poll() is None
    return one


def test_the_next_job_is_done_by_the_one_that_waits_and_the_one_after_by_a_new_one(second, scene, place, workers):
    one = waiting(second)
    for _ in range(2):
        assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert workers[0] == one.worker.process.pid
    assert workers[1] != workers[0]
    assert second._waiting == []
    assert not one.folder.exists()


def test_an_animation_takes_it_too(second, scene, place, workers):
    one = waiting(second)
    scene.frame_end, scene.render.filepath = 2, str(place / "frames" / "name")
    scene.render.image_settings.file_format = "PNG"
    assert bpy.ops.render.stereo_reproject_animation() == {"FINISHED"}
    assert workers == [one.worker.process.pid]


def test_one_that_has_ended_is_not_taken(second, scene, place, workers):
    one = waiting(second)
    one.worker.process.kill()
    one.worker.process.wait()
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert workers != [one.worker.process.pid]
    assert not one.folder.exists()


def test_one_whose_folder_is_gone_is_not_taken(second, scene, place, workers):
    one = waiting(second)
    one.folder.rename(place / "elsewhere")
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert workers != [one.worker.process.pid]
    assert not is_running(one.worker.process.pid)


@pytest.mark.parametrize("changed", ["temporary folder", "environment", "command"])
def test_one_that_would_be_started_otherwise_now_is_not_taken(second, place, monkeypatch, changed):
    one = waiting(second)
    if changed == "temporary folder":
        (place / "other").mkdir()
        monkeypatch.setattr(tempfile, "tempdir", str(place / "other"))
    elif changed == "environment":
        monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "1")
    else:
        monkeypatch.setattr(second, "worker_command", lambda: ["another Blender"])
    assert second.take() is None
    assert not is_running(one.worker.process.pid)
    assert not one.folder.exists()


def test_where_the_job_cannot_start_it_is_ended(second, scene, place, monkeypatch):
    from stereo_reproject_extension.operators import run

    def fail(_folder):
        raise run.BadInputError("no copy")

    one = waiting(second)
    monkeypatch.setattr(run, "_saved_copy", fail)
    with pytest.raises(RuntimeError, match="No copy"):
        bpy.ops.render.stereo_reproject_image()
    assert not is_running(one.worker.process.pid)
    assert list(place.iterdir()) == []


def test_it_ends_with_the_extension(package, place):
    package.register()
    from stereo_reproject_extension.operators import second_blender

    one = waiting(second_blender)
    package.unregister()
    assert not is_running(one.worker.process.pid)
    assert list(place.iterdir()) == []


def test_it_ends_with_this_blender(second, place):
    one = waiting(second)
    one.worker.process.stdin.close()
    assert one.worker.process.wait(60.0) == 0


def test_it_ends_where_the_preferences_do_not_want_it_any_more(second, place):
    addon = bpy.context.preferences.addons.new()
    addon.module = PACKAGE
    try:
        one = waiting(second)
        addon.preferences.keep_ready = False
        assert not is_running(one.worker.process.pid)
        assert second._waiting == []
    finally:
        bpy.context.preferences.addons.remove(addon)


def test_where_it_cannot_be_started_nothing_is_left_and_nothing_said(second, place, monkeypatch, capfd):
    monkeypatch.setattr(second, "worker_command", lambda: [str(place / "no such program")])
    second.start()
    assert (second._waiting, list(place.iterdir())) == ([], [])
    assert capfd.readouterr() == ("", "")


@pytest.fixture
def in_a_window(second, monkeypatch):
    """Blender as it says that it has a window, and the extension's preferences."""

    class App:
        background = False
        timers = bpy.app.timers
        is_job_running = bpy.app.is_job_running

    class Bpy:
        app = App
        types = bpy.types

    monkeypatch.setattr(second, "bpy", Bpy)
    monkeypatch.setattr(second, "preferred", lambda _: True)
    yield
    second.end_waiting()


def test_one_that_could_not_be_started_is_not_tried_again_at_each_redraw(second, place, monkeypatch, in_a_window):
    monkeypatch.setattr(second, "worker_command", lambda: [str(place / "no such program")])
    second.keep_ready()
    assert bpy.app.timers.is_registered(second._start_soon)
    assert second._start_soon() is None
    bpy.app.timers.unregister(second._start_soon)
    second.keep_ready()
    assert not bpy.app.timers.is_registered(second._start_soon)


def test_none_is_started_while_a_job_runs(second, place, monkeypatch, in_a_window):
    from stereo_reproject_extension.operators import jobs

    monkeypatch.setattr(jobs, "running", lambda: "a job")
    assert second._start_soon() == second.BUSY_SECONDS
    assert second._waiting == []


def test_one_that_is_to_be_started_is_not_once_the_extension_is_off(package, place, monkeypatch):
    package.register()
    from stereo_reproject_extension.operators import second_blender

    bpy.app.timers.register(second_blender._start_soon, first_interval=60.0)
    package.unregister()
    assert not bpy.app.timers.is_registered(second_blender._start_soon)


def test_without_a_window_none_is_started(second):
    second.keep_ready()
    assert not bpy.app.timers.is_registered(second._start_soon)
