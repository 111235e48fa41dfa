"""A run that is cancelled, or fails, at any of its stages: nothing is left of it, and the next one works."""

import re
import sys
import tempfile
from pathlib import Path

import bpy
import pytest

from stereo_reproject.blender.pictures import check_png
from tests.blender.snapshot import everything
from tests.blender.toolbox import add_compositor, mirror_before_wall

STAGES = ["load", "plan", "source", "warp", "fill", "refine", "composite", "account", "write"]

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
    return mirror_before_wall(96, 54, samples=4)


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
    monkeypatch.setattr(run, "module_in_blender", lambda _: command)
    with pytest.raises(RuntimeError, match=f"forced in {stage}"):
        bpy.ops.render.stereo_reproject_image()
    assert everything() == before
    assert (jobs.running(), list(place.iterdir())) == (None, [])
    monkeypatch.undo()
    monkeypatch.setattr(tempfile, "tempdir", str(place))
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}


def _add_file_output(scene, folder):
    """A compositor that hands the picture through and writes it beside the file too."""
    tree, layers, result = add_compositor(scene)
    writer = tree.nodes.new("CompositorNodeOutputFile")
    tree.links.new(layers.outputs["Image"], result)
    if hasattr(writer, "file_output_items"):
        writer.directory, writer.file_name = folder, "node_"
        writer.file_output_items.new("RGBA", "Image")
        writer.format.media_type = "IMAGE"
    else:
        writer.base_path = folder
        writer.file_slots[0].path = "node_"
    writer.format.file_format = "PNG"
    tree.links.new(layers.outputs["Image"], writer.inputs[0])


@pytest.fixture
def animated(scene, place):
    """A saved file of two frames that writes beside itself, and by a File Output node as well."""
    project = place / "project"
    project.mkdir()
    _add_file_output(scene, "//nodes/")
    scene.frame_start, scene.frame_end = 1, 2
    # The folder as a template came with 5.0.
    folder = "{blend_dir}/" if bpy.app.version >= (5, 0) else "//"
    scene.render.filepath = f"{folder}shots/{{blend_name}}_"
    if hasattr(scene.render.image_settings, "media_type"):
        scene.render.image_settings.media_type = "IMAGE"
    scene.render.image_settings.file_format = "PNG"
    bpy.ops.wm.save_as_mainfile(filepath=str(project / "film.blend"))
    return bpy.context.scene


def _files(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def test_what_an_animation_writes_lies_beside_the_file(extension, animated, place):
    before = everything()
    assert bpy.ops.render.stereo_reproject_animation() == {"FINISHED"}
    assert everything() == before
    written = [name for name in _files(place / "project") if not name.endswith(".blend")]
    shots = [name for name in written if re.match("shots/film_[0-9]", name)]
    assert shots == [f"shots/film_000{frame}_{view}.png" for frame in (1, 2) for view in "LR"]
    nodes = [name for name in written if name.startswith("nodes")]
    assert [name for name in nodes if "0001" in name]
    assert [name for name in nodes if "0002" in name]
    told = [name for name in written if name.startswith("shots") and not name.endswith((".png", ".svg"))]
    told = [name for name in told if not name.startswith("shots/journal/found-")]
    assert told == ["shots/film_animation.json", "shots/journal/film_0001.json", "shots/journal/film_0002.json"]
    assert {name.partition("/")[0] for name in written} == {"shots", "nodes"}
    assert sorted(path.name for path in place.iterdir()) == ["project"]


def test_a_preview_does_not_write_what_a_render_would(extension, animated, place):
    assert bpy.ops.render.stereo_reproject_image(preview=True) == {"FINISHED"}
    assert _files(place / "project") == ["film.blend"]
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert any(name.startswith("nodes") for name in _files(place / "project"))


@pytest.mark.parametrize("stage", ["source", "fill"])
def test_a_cancelled_animation_keeps_what_is_whole_and_the_next_one_goes_on(
    extension, animated, place, monkeypatch, stage
):
    from stereo_reproject_extension.operators import jobs, run

    told = run.Run._on_event

    def cancel_at_the_second(self, event):
        told(self, event)
        if event.get("stage") == stage and str(event.get("detail")).startswith("frame 2"):
            self.cancel()

    before = everything()
    monkeypatch.setattr(run.Run, "_on_event", cancel_at_the_second)
    assert bpy.ops.render.stereo_reproject_animation() == {"CANCELLED"}
    assert everything() == before
    shots = place / "project" / "shots"
    for picture in shots.glob("film_*.png"):
        check_png(picture)
    assert not list(shots.glob("film_0002*"))
    assert not list(place.rglob(".*"))
    assert (jobs.running(), [path.name for path in place.iterdir()]) == (None, ["project"])
    monkeypatch.setattr(run.Run, "_on_event", told)
    animated.render.use_overwrite = False
    assert bpy.ops.render.stereo_reproject_animation() == {"FINISHED"}
    assert sorted(path.name for path in shots.glob("film_0*")) == [
        f"film_000{frame}_{view}.png" for frame in (1, 2) for view in "LR"
    ]


def test_a_destination_that_is_taken_is_said_before_anything_is_rendered(extension, animated, place):
    (place / "project" / "shots" / "film_0002_R.png").mkdir(parents=True)
    with pytest.raises(RuntimeError, match=r"film_0002_R\.png is a folder"):
        bpy.ops.render.stereo_reproject_animation()
    assert _files(place / "project") == ["film.blend"]


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


def test_a_second_start_is_refused_with_a_word(extension, scene, place):
    from stereo_reproject_extension.operators import jobs
    from stereo_reproject_extension.operators.render import RENDER_OT_stereo_reproject_image as operator

    jobs._running.append(operator.start(_Image(), scene))
    for name in ("stereo_reproject_image", "stereo_reproject_animation"):
        with pytest.raises(RuntimeError, match="running already: Esc ends it"):
            getattr(bpy.ops.render, name)()
    jobs.stop_running()
    assert list(place.iterdir()) == []


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
