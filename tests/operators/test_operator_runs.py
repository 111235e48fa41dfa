"""A run that is cancelled, or fails, at any of its stages: nothing is left of it, and the next one works."""

import contextlib
import re
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import bpy
import pytest

from stereo_reproject.blender.output.pictures import check_png
from stereo_reproject.sequence.journal_folder import JOURNAL
from tests.blender.snapshot import everything
from tests.blender.toolbox import add_compositor, mirror_before_wall
from tests.operators.test_operators import Drawn

STAGES = ["load", "plan", "source", "warp", "fill", "refine", "composite", "account", "write"]

FAILING_WORKER = """
import sys
from stereo_reproject.programs import worker
from stereo_reproject.sequence.journal_folder import JOURNAL

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


@pytest.mark.parametrize("stage", STAGES)
def test_cancelled(extension, scene, place, monkeypatch, stage):
    from stereo_reproject_extension.operators import jobs, run

    told = run.BackgroundJob._on_event

    def cancel_there(self, event):
        told(self, event)
        if event.get("stage") == stage:
            self.cancel()

    before = everything()
    monkeypatch.setattr(run.BackgroundJob, "_on_event", cancel_there)
    assert bpy.ops.render.stereo_reproject_image() == {"CANCELLED"}
    assert everything() == before
    assert (jobs.running(), list(place.iterdir())) == (None, [])
    monkeypatch.setattr(run.BackgroundJob, "_on_event", told)
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert everything() == before


@pytest.mark.parametrize("stage", STAGES)
def test_failed(extension, scene, place, monkeypatch, stage):
    from stereo_reproject_extension.operators import jobs, results, second_blender

    before = everything()
    command = [sys.executable, "-c", FAILING_WORKER, stage]
    monkeypatch.setattr(second_blender, "worker_command", lambda: command)
    with pytest.raises(RuntimeError, match=f"forced in {stage}"):
        bpy.ops.render.stereo_reproject_image()
    assert everything() == before
    assert (jobs.running(), list(place.iterdir())) == (None, [])
    assert f"forced in {stage}" in results.result_of(scene).ended
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


def test_what_an_animation_writes_lies_beside_the_file(extension, animated, place, monkeypatch):
    from stereo_reproject_extension.operators import run
    from stereo_reproject_extension.operators.drawing import verdicts_on
    from stereo_reproject_extension.operators.results import result_of

    told, so_far = run.BackgroundJob._on_event, []
    monkeypatch.setattr(
        run.BackgroundJob, "_on_event", lambda self, event: (told(self, event), so_far.append(len(self.savings)))
    )
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
    told = [name for name in told if not name.startswith(f"shots/{JOURNAL}/found-")]
    records = [f"shots/{JOURNAL}/film_000{frame}.json" for frame in (1, 2)]
    assert sorted(told) == sorted(["shots/film_animation.json", *records])
    assert {name.partition("/")[0] for name in written} == {"shots", "nodes"}
    assert sorted(path.name for path in place.iterdir()) == ["project"]
    assert list(dict.fromkeys(so_far)) == [0, 1, 2]
    _, saved = verdicts_on(animated, result_of(animated))
    assert re.fullmatch(r"2 frames, (.* saved of .* %\)|No time saved.*)", saved.words)
    assert result_of(animated).delivery.content.name == "Slot 1"


def test_a_preview_does_not_write_what_a_render_would(extension, animated, place):
    assert bpy.ops.render.stereo_reproject_image(preview=True) == {"FINISHED"}
    assert _files(place / "project") == ["film.blend"]
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert any(name.startswith("nodes") for name in _files(place / "project"))


@pytest.mark.parametrize("stage", ["source", "fill"])
def test_a_cancelled_animation_keeps_what_is_whole_and_the_next_one_goes_on(
    extension, animated, place, monkeypatch, stage
):
    from stereo_reproject_extension.operators import jobs, results, run

    told = run.BackgroundJob._on_event

    def cancel_at_the_second(self, event):
        told(self, event)
        if event.get("stage") == stage and str(event.get("detail")).startswith("frame 2"):
            self.cancel()

    before = everything()
    monkeypatch.setattr(run.BackgroundJob, "_on_event", cancel_at_the_second)
    assert bpy.ops.render.stereo_reproject_animation() == {"CANCELLED"}
    assert everything() == before
    shots = place / "project" / "shots"
    for picture in shots.glob("film_*.png"):
        check_png(picture)
    assert not list(shots.glob("film_0002*"))
    # The first frame may be there before the run tells of it.
    recorded = len(list((shots / JOURNAL).glob("film_000?.json")))
    few = {0: "no frame was finished", 1: "1 frame is finished and stays. To go on with the others, switch off Over"}
    assert results.result_of(animated).ended.startswith(f"Cancelled: {few[recorded]}")
    assert {path.name for path in place.rglob(".*")} <= {JOURNAL}
    assert (jobs.running(), [path.name for path in place.iterdir()]) == (None, ["project"])
    monkeypatch.setattr(run.BackgroundJob, "_on_event", told)
    animated.render.use_overwrite = False
    assert bpy.ops.render.stereo_reproject_animation() == {"FINISHED"}
    assert sorted(path.name for path in shots.glob("film_0*")) == [
        f"film_000{frame}_{view}.png" for frame in (1, 2) for view in "LR"
    ]


def test_an_animation_that_goes_on_says_of_which_frames_its_numbers_are(extension, animated, place, monkeypatch, capfd):
    from stereo_reproject_extension.operators import results, run, run_words
    from stereo_reproject_extension.operators.drawing import verdicts_on

    assert bpy.ops.render.stereo_reproject_animation() == {"FINISHED"}
    result = results.result_of(animated)
    first_saved = result.new_totals["multiview_seconds"]
    assert verdicts_on(animated, result)[-1].words.startswith("2 frames, ")
    animated.frame_end, animated.render.use_overwrite = 3, False

    told, so_far = run.BackgroundJob._on_event, []

    def cancel_in_the_third(self, event):
        told(self, event)
        if event.get("stage") == "source":
            self.cancel()

    monkeypatch.setattr(run.BackgroundJob, "_on_event", cancel_in_the_third)
    assert bpy.ops.render.stereo_reproject_animation() == {"CANCELLED"}
    cancelled, others = "Cancelled: no frame was finished, 2 were there already.", "on with the others"
    assert f"{cancelled} Render Animation goes {others}." in drawn_outcome(animated)
    # The panel goes by what is set now.
    animated.render.use_overwrite = True
    assert f"{cancelled} To go {others}, switch off Overwrite in Output first." in drawn_outcome(animated)
    animated.render.use_overwrite = False

    monkeypatch.setattr(
        run.BackgroundJob,
        "_on_event",
        lambda self, event: (told(self, event), so_far.append(run_words.saved_so_far(self))),
    )
    capfd.readouterr()
    assert bpy.ops.render.stereo_reproject_animation() == {"FINISHED"}
    said = capfd.readouterr().out.replace("\n", " ")
    assert re.search(
        rf"1 stereo frame rendered, [^;]*; 2 were there already, in {re.escape(str(place / 'project' / 'shots'))}", said
    )
    assert so_far[-1].endswith(" so far by 1 frame")
    of_run, of_all = (verdict.words for verdict in verdicts_on(animated, result)[-2:])
    assert of_run.startswith("1 frame rendered now, ")
    assert of_all.startswith("3 frames in all, ")
    everything_saved = result.animation["totals"]["multiview_seconds"]
    assert everything_saved == pytest.approx(result.new_totals["multiview_seconds"] + first_saved)


def drawn_outcome(scene):
    """What the panel says below its buttons."""
    from stereo_reproject_extension.operators.drawing import draw_outcome

    layout = Drawn()
    context = SimpleNamespace(scene=scene, region=None, space_data=None, preferences=bpy.context.preferences)
    draw_outcome(layout, context)
    return " ".join(item[-1]["text"] for item in layout.items if item[0] == "label")


@pytest.mark.parametrize("stage", ["plan", "source", "fill"])
def test_nothing_is_left_of_an_animation_that_is_cancelled_in_its_first_frame(
    extension, animated, place, monkeypatch, stage
):
    from stereo_reproject_extension.operators import results, run

    told = run.BackgroundJob._on_event

    def cancel_there(self, event):
        told(self, event)
        if event.get("stage") == stage:
            self.cancel()

    monkeypatch.setattr(run.BackgroundJob, "_on_event", cancel_there)
    assert bpy.ops.render.stereo_reproject_animation() == {"CANCELLED"}
    assert sorted(path.name for path in (place / "project").iterdir()) == ["film.blend"]
    assert results.result_of(animated).ended == "Cancelled: no frame was finished"


def test_a_destination_that_is_taken_is_said_before_anything_is_rendered(extension, animated, place):
    (place / "project" / "shots" / "film_0002_R.png").mkdir(parents=True)
    with pytest.raises(RuntimeError, match=r"film_0002_R\.png is a folder"):
        bpy.ops.render.stereo_reproject_animation()
    assert _files(place / "project") == ["film.blend"]


def test_a_delivery_that_fails_leaves_the_scene_as_it_was(extension, scene, place, monkeypatch):
    from stereo_reproject_extension.operators import jobs
    from stereo_reproject_extension.stereo_reproject.blender.output import delivery

    def fails(*_args, **_how):
        raise RuntimeError("forced in delivery")

    before = everything()
    with monkeypatch.context() as patched:
        patched.setattr(delivery, "call_render", fails)
        with pytest.raises(RuntimeError, match="forced in delivery"):
            bpy.ops.render.stereo_reproject_image()
    assert everything() == before
    kept = place / "untitled_stereo_pair"
    assert (jobs.running(), list(place.iterdir())) == (None, [kept])
    assert {"left.exr", "right.exr", "report.json"} <= {path.name for path in kept.iterdir()}
    assert bpy.ops.stereo_reproject.open_kept() == {"FINISHED"}
    image = bpy.data.images["stereo.exr"]
    # It is read when its size is asked for.
    found = tuple(image.size), image.type, image.is_stereo_3d
    assert found[1:] == ("MULTILAYER", True)
    assert not bpy.ops.stereo_reproject.open_kept.poll()
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}


@pytest.fixture
def meanwhile(extension, monkeypatch):
    """Does something after a run is over, and before its result is taken."""
    from stereo_reproject_extension.operators.run import BackgroundJob

    wait = BackgroundJob.wait

    def have_done(action):
        monkeypatch.setattr(BackgroundJob, "wait", lambda self: (wait(self), action()))

    return have_done


def _saved_result(folder, name):
    """The Render Result as files, by their names' ends."""
    with contextlib.suppress(RuntimeError):
        bpy.data.images["Render Result"].save_render(str(folder / f"{name}.png"))
    return {path.stem.removeprefix(name): path.read_bytes() for path in folder.glob(f"{name}*.png")}


def test_what_is_changed_and_rendered_meanwhile_costs_neither_the_pair_nor_the_render(
    extension, scene, tmp_path, meanwhile
):
    plain = {}

    def render_and_change():
        bpy.ops.render.render()
        plain.update(_saved_result(tmp_path, "before"))
        bpy.data.objects.remove(scene.camera)
        scene.view_layers[0].name = "Renamed"

    scene.render.image_settings.file_format = "PNG"
    add_compositor(scene)
    meanwhile(render_and_change)
    assert bpy.ops.render.stereo_reproject_image() == {"FINISHED"}
    assert (scene.camera, [layer.name for layer in scene.view_layers]) == (None, ["Renamed"])
    assert [item for item in bpy.data.objects if item.type == "CAMERA"] == []
    slots = bpy.data.images["Render Result"].render_slots
    assert slots.active.name == "Stereo Pair"
    scene.render.use_multiview = True
    assert set(_saved_result(tmp_path, "pair")) >= {"_L", "_R"}
    scene.render.use_multiview = False
    slots.active_index = 0
    assert _saved_result(tmp_path, "after") == plain


def test_a_pair_whose_scene_was_deleted_is_kept_beside_the_file(extension, animated, place, meanwhile):
    def delete():
        bpy.data.scenes.new("Other")
        bpy.data.scenes.remove(animated)

    meanwhile(delete)
    with pytest.raises(RuntimeError, match=r"'Scene' was deleted meanwhile\. The pair is kept in .*film_stereo_pair"):
        bpy.ops.render.stereo_reproject_image()
    kept = place / "project" / "film_stereo_pair"
    assert {"left.exr", "right.exr"} <= {path.name for path in kept.iterdir()}
    assert [path.name for path in place.iterdir()] == ["project"]


def test_an_animation_whose_scene_was_deleted_has_its_frames(extension, animated, place, meanwhile, capfd):
    animated.frame_end = 1
    meanwhile(lambda: (bpy.data.scenes.new("Other"), bpy.data.scenes.remove(animated)))
    assert bpy.ops.render.stereo_reproject_animation() == {"FINISHED"}
    assert len(list((place / "project" / "shots").glob("film_0001_?.png"))) == 2
    said = capfd.readouterr().out.replace("\n", " ")
    assert "last frame is not shown: the scene 'Scene' was deleted" in said
    assert "1 stereo frame rendered, " in said


def test_a_stereo_animation_is_found_without_stereoscopy(extension, scene, tmp_path):
    """Blender's own View Animation would look for shot_0001.png."""
    scene.render.image_settings.views_format = "INDIVIDUAL"
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath, scene.render.use_multiview = str(tmp_path / "shot_"), False
    player = bpy.context.preferences.filepaths
    # One that cannot be started: the message has what it would have been given.
    player.animation_player_preset, player.animation_player = "CUSTOM", str(tmp_path / "player")
    with pytest.raises(RuntimeError, match=r"There is no stereo animation to play: .*shot_0001_L\.png does not exist"):
        bpy.ops.render.stereo_reproject_view_animation()
    (tmp_path / "shot_0001_L.png").touch()
    before = everything()
    with pytest.raises(
        RuntimeError, match=r"Couldn't run external animation player .*player', '[^']*shot_0001_L\.png'"
    ):
        bpy.ops.render.stereo_reproject_view_animation()
    assert everything() == before


def test_a_stereo_animation_is_found_where_a_suffix_is_the_name_of_the_other_view(extension, scene, tmp_path):
    scene.render.image_settings.views_format = "INDIVIDUAL"
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = str(tmp_path / "shot_")
    scene.render.views["left"].file_suffix, scene.render.views["right"].file_suffix = "right", "_R"
    with pytest.raises(RuntimeError, match=r"to play: .*shot_0001right\.png does not exist"):
        bpy.ops.render.stereo_reproject_view_animation()


def test_a_second_start_is_refused_with_a_word(extension, scene, place):
    from stereo_reproject_extension.operators import jobs
    from stereo_reproject_extension.operators.render import RENDER_OT_stereo_reproject_image as operator

    jobs._running.append(operator.start(_Image(), scene))
    for name in ("stereo_reproject_image", "stereo_reproject_animation"):
        with pytest.raises(RuntimeError, match="running already: Esc ends it"):
            getattr(bpy.ops.render, name)()
    jobs.stop_running()
    assert list(place.iterdir()) == []


def test_the_second_click_of_a_double_click_does_not_cancel(extension, scene, place, monkeypatch):
    from stereo_reproject_extension.operators import jobs
    from stereo_reproject_extension.operators.render import RENDER_OT_stereo_reproject_image as operator

    cancel = jobs.STEREO_REPROJECT_OT_cancel
    button = SimpleNamespace(execute=lambda context: cancel.execute(button, context))
    run = operator.start(_Image(), scene)
    jobs._running.append(run)
    try:
        assert cancel.invoke(button, bpy.context, None) == {"CANCELLED"}
        assert not run.is_ending
        # The user's next click comes later.
        run.looks = round(2.0 / jobs.TICK_SECONDS)
        assert cancel.invoke(button, bpy.context, None) == {"FINISHED"}
        assert run.is_ending
    finally:
        jobs.stop_running()


def test_a_missing_denoiser_is_reported_once_and_other_warnings_each_time(extension, scene, place, monkeypatch):
    from stereo_reproject_extension.operators import jobs
    from stereo_reproject_extension.operators.render import RENDER_OT_stereo_reproject_image as operator

    told = []
    other = "a warning that is said each time"

    class Reporting(_Image):
        report = staticmethod(lambda kind, text: told.append((kind, text)))
        take = operator.take

    monkeypatch.setattr(jobs, "_said", set())
    for _ in range(2):
        job = operator.start(_Image(), scene)
        job.wait()
        job.warnings[:] = [jobs.NO_DENOISER, other]
        jobs._running.append(job)
        assert jobs.JobOperator._finish(Reporting()) == {"FINISHED"}
    warned = [text for kind, text in told if kind == {"WARNING"}]
    assert [text[:12] for text in warned] == ["This Blender", "A warning th", "A warning th"]


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
