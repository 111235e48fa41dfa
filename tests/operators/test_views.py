"""The panel's many views: settings, the cone that is drawn, and a quilt that is rendered, cancelled and refused."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.scene.depth import frame_pixels
from stereo_reproject.blender.scene.rig import MODES, convergence_of_screen, frame_region, stereo_cameras
from stereo_reproject.settings.frame import StereoSettings
from stereo_reproject.settings.views import views_settings
from stereo_reproject.views.cone import cone_baseline
from stereo_reproject.views.depth_range import frame_corners
from tests.blender.snapshot import everything
from tests.blender.toolbox import mirror_before_wall

SIZE = (48, 36)
SINGLE = 1e-5
"""Relative: Blender keeps its numbers in single precision."""


@pytest.fixture
def scene():
    return mirror_before_wall(*SIZE, samples=1)


@pytest.fixture
def four(scene, place):
    """A scene of which four small views go into a folder of their own; returns it and that folder."""
    chosen = scene.stereo_reproject.views
    chosen.display, chosen.count, chosen.columns, chosen.rows = "OTHER", 4, 2, 2
    chosen.cone = math.radians(8.0)
    scene.render.filepath = str(place / "out" / "shot_####")
    scene.frame_set(7)
    return scene, place / "out" / "shot_0007_views"


def views_of(scene):
    from stereo_reproject_extension.operators.views_properties import views_settings_of

    return views_settings_of(scene)


def test_at_first_they_are_those_of_a_display(extension, scene):
    assert vars(views_of(scene)) == vars(views_settings(display="portrait"))


def test_a_display_sets_number_and_cone_and_they_can_be_changed(extension, scene):
    chosen = scene.stereo_reproject.views
    chosen.count, chosen.spacing = 5, "BASELINE"
    chosen.display = "go"
    assert vars(views_of(scene)) == vars(views_settings(display="go"))
    chosen.count, chosen.cone = 12, math.radians(25.0)
    assert vars(views_of(scene)) == vars(views_settings(display="go", count=12, cone_degrees=25.0))


def test_without_a_display_all_numbers_count(extension, scene):
    chosen = scene.stereo_reproject.views
    chosen.display, chosen.count, chosen.columns, chosen.rows = "OTHER", 10, 4, 3
    chosen.spacing, chosen.baseline = "BASELINE", 0.5
    assert vars(views_of(scene)) == vars(views_settings(count=10, baseline=0.5, quilt=(4, 3)))


def test_each_picture_is_rendered_as_by_the_command_line(extension, scene):
    from stereo_reproject_extension.operators.views import frame_settings

    chosen = scene.stereo_reproject
    chosen.headset, chosen.source, chosen.fill, chosen.accuracy = "vr180", "right", "card", "high"
    found = frame_settings(scene, views_of(scene))
    plain = StereoSettings(accuracy="high")
    wanted = replace(plain, scene=replace(plain.scene, frame=scene.frame_current, size=(420, 560)))
    assert repr(found) == repr(wanted)


def test_a_quilt(extension, four):
    from stereo_reproject_extension.operators.results import result_of

    scene, folder = four
    before = everything()
    assert bpy.ops.render.stereo_reproject_views() == {"FINISHED"}
    quilt = bpy.data.images["Stereo Quilt"]
    assert tuple(quilt.size) == (2 * SIZE[0], 2 * SIZE[1])
    bpy.data.images.remove(quilt)
    assert everything() == before
    assert list(folder.parent.parent.iterdir()) == [folder.parent]
    assert list(folder.parent.iterdir()) == [folder]
    names = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    views = {f"views/view_{k:02}.exr" for k in range(4)}
    aspect = "quilt_qs2x2a1.3333"
    assert names == {*views, f"{aspect}.png", f"{aspect}.exr", "contact.png", "sweep.mp4", "report.json"}
    kept = result_of(scene).views
    assert kept.folder == folder
    assert kept.report == json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert (kept.report["frame"], kept.report["size"]) == (7, list(SIZE))


def test_the_next_quilt_takes_the_place_of_the_last(extension, four):
    scene, folder = four
    assert bpy.ops.render.stereo_reproject_views() == {"FINISHED"}
    scene.stereo_reproject.views.count, scene.stereo_reproject.views.rows = 2, 1
    assert bpy.ops.render.stereo_reproject_views() == {"FINISHED"}
    assert [image.name for image in bpy.data.images if image.name.startswith("Stereo Quilt")] == ["Stereo Quilt"]
    assert tuple(bpy.data.images["Stereo Quilt"].size) == (2 * SIZE[0], SIZE[1])
    assert len(list(folder.glob("quilt_*.png"))) == 1


def test_progress_tells_the_view(extension, four, monkeypatch):
    from stereo_reproject_extension.operators import run_words, views_job

    told, seen = views_job.ViewsJob._on_event, []

    def note(self, event):
        told(self, event)
        seen.append((run_words.frame_words(self), run_words.stage_alone(self), self.far()[0]))

    monkeypatch.setattr(views_job.ViewsJob, "_on_event", note)
    assert bpy.ops.render.stereo_reproject_views() == {"FINISHED"}
    words, stages, fractions = zip(*seen, strict=True)
    assert [text for text in dict.fromkeys(words) if text] == [f"View {k} of 4" for k in range(1, 5)]
    assert {"Rendering a view whole", "Writing the quilt"} <= set(stages)
    assert not any("eye" in stage for stage in stages)
    assert list(fractions) == sorted(fractions)


def test_the_texts_can_be_translated(extension, scene, monkeypatch):
    from stereo_reproject_extension.operators import run_words, text, views_panel
    from stereo_reproject_extension.operators.views_job import ViewsJob

    table = {
        "View {number} of {count}": "Ansicht {number} von {count}",
        "Rendering a view whole": "Eine ganze Ansicht",
        "{columns} x {rows} views of {width} x {height} pixels.": "{columns} x {rows} Ansichten",
    }
    monkeypatch.setattr(text, "pgettext_iface", lambda message: table.get(message, message))
    run = SimpleNamespace(detail="view 12 of 48", stage="source", savings=(), stage_words=ViewsJob.stage_words)
    assert text.shown(run_words.frame_words(run)) == "Ansicht 12 von 48"
    assert text.shown(run_words.stage_alone(run)) == "Eine ganze Ansicht"
    assert text.shown(views_panel.quilt_words(scene)) == "8 x 6 Ansichten"


@pytest.mark.parametrize("stage", ["load", "source", "warp", "write"])
def test_cancelled(extension, four, monkeypatch, stage):
    from stereo_reproject_extension.operators import jobs, results, run

    scene, folder = four
    told, before = run.BackgroundJob._on_event, everything()

    def cancel_there(self, event):
        told(self, event)
        if event.get("stage") == stage:
            self.cancel()

    monkeypatch.setattr(run.BackgroundJob, "_on_event", cancel_there)
    assert bpy.ops.render.stereo_reproject_views() == {"CANCELLED"}
    assert everything() == before
    assert (jobs.running(), list(folder.parent.parent.iterdir())) == (None, [])
    assert results.result_of(scene).ended == "Cancelled: nothing was changed"


def orthographic(scene):
    scene.camera.data.type = "ORTHO"


def by_eevee(scene):
    scene.stereo_reproject.source_engine = "eevee"


def too_few_places(scene):
    chosen = scene.stereo_reproject.views
    chosen.display, chosen.count, chosen.columns, chosen.rows = "OTHER", 13, 4, 3


def without_a_camera(scene):
    scene.camera = None


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (orthographic, "is no perspective camera, which many views need: change its type"),
        (by_eevee, "many views are rendered by Cycles alone: set Cycles as engine"),
        (too_few_places, "a quilt of 4 x 3 must have a place for each of the 13 views"),
        (without_a_camera, "the scene has no camera"),
    ],
)
def test_what_is_in_the_way_is_said_and_nothing_starts(extension, scene, spoil, said):
    from stereo_reproject_extension.operators.cone_view import cone_of
    from stereo_reproject_extension.operators.views import views_obstacle

    assert (views_obstacle(scene), cone_of(scene) is None) == (None, False)
    spoil(scene)
    assert said in str(views_obstacle(scene))
    assert not bpy.ops.render.stereo_reproject_views.poll()
    assert cone_of(scene) is None


# The cone in the 3D View


@pytest.mark.parametrize("fit", ["AUTO", "HORIZONTAL", "VERTICAL"])
@pytest.mark.parametrize("display", ["portrait", "16-landscape"])
def test_the_frame_is_what_the_outermost_views_show(extension, scene, fit, display):
    from stereo_reproject_extension.operators.cone_view import cone_of, frame_at

    data, chosen = scene.camera.data, scene.stereo_reproject.views
    data.sensor_fit, data.sensor_width, data.sensor_height, data.shift_x, data.shift_y = fit, 30.0, 20.0, 0.1, -0.2
    data.stereo.convergence_distance = focus = 2.5
    chosen.display = display
    cone = cone_of(scene)
    # As the worker has it: the display's shape, in square pixels here.
    scene.render.resolution_x, scene.render.resolution_y = 900, round(900 / views_of(scene).aspect)
    stereo = data.stereo
    stereo.convergence_mode, stereo.pivot = MODES["off-axis"], "CENTER"
    # Blender takes it for another depth where a camera is fitted to its sensor's height.
    stereo.convergence_distance = convergence_of_screen(data, focus)
    stereo.interocular_distance = baseline = cone_baseline(views_of(scene).cone_degrees, focus)
    eyes = stereo_cameras(scene.camera, scene.render)
    for end, name in enumerate(("left", "right")):
        corners = frame_corners(eyes[name], frame_pixels(frame_region(scene.render)), focus)
        np.testing.assert_allclose(cone.plane.corners, corners, atol=2e-3)
        np.testing.assert_allclose(cone.angle[end, 0], eyes[name].world_from_camera[:3, 3], atol=SINGLE)
    assert np.linalg.norm(np.diff(cone.angle[:, 0], axis=0)) == pytest.approx(baseline, rel=SINGLE)
    plain = frame_at(scene, replace(views_of(scene), aspect=None), focus)
    np.testing.assert_allclose(frame_at(scene, views_of(scene), focus), plain, atol=2e-3)


def test_there_is_a_mark_for_each_camera(extension, scene):
    from stereo_reproject_extension.operators.cone_view import cone_of

    scene.stereo_reproject.views.count = 5
    line, *marks = cone_of(scene).cameras
    middles = np.mean(marks, axis=1)
    np.testing.assert_allclose(middles, np.linspace(*line, 5), atol=SINGLE)
    assert len(cone_of(scene).sides) == 8


def test_the_drawing_ends_with_the_extension(package):
    from stereo_reproject_extension.operators import cone_view

    package.register()
    assert len(cone_view._handlers) == 2
    package.unregister()
    assert cone_view._handlers == []


class Noted:
    """A layout that notes labels, buttons and settings that are drawn into it, and stands for its parts too."""

    def __init__(self):
        self.seen = []

    def label(self, *, text, **_):
        self.seen.append(text)

    def prop(self, _owner, name, **_):
        self.seen.append(name)

    def operator(self, name, *, text="", **_):
        self.seen.append(text or name)
        return SimpleNamespace()

    def __getattr__(self, _name):
        return lambda *_, **__: self


def drawn(scene):
    from stereo_reproject_extension.operators.views_panel import Views

    panel, layout = Views(), Noted()
    panel.layout = layout
    wide = SimpleNamespace(region=SimpleNamespace(width=4000), preferences=bpy.context.preferences, scene=scene)
    panel.draw(wide)
    return layout.seen


def test_the_panel_has_the_grid_only_without_a_display(extension, scene):
    seen = drawn(scene)
    assert {"display", "count", "cone", "convergence_distance", "show_cone", "Render Quilt"} <= set(seen)
    assert not {"columns", "rows", "baseline"} & set(seen)
    assert "8 x 6 views of 420 x 560 pixels." in seen
    chosen = scene.stereo_reproject.views
    chosen.display, chosen.spacing, chosen.columns = "OTHER", "BASELINE", 10
    seen = drawn(scene)
    assert {"columns", "rows", "baseline"} <= set(seen)
    assert "10 x 6 places for 48 views of 48 x 36 pixels." in seen
    chosen.columns = 8
    assert "8 x 6 views of 48 x 36 pixels." in drawn(scene)


def test_the_list_of_displays_says_whose_they_are(extension, scene):
    names = [item.name for item in scene.stereo_reproject.views.bl_rna.properties["display"].enum_items]
    assert "Portrait" in names
    assert not any("Looking Glass" in name for name in names)


def test_the_panel_says_what_is_in_the_way_in_one_line(extension, scene):
    by_eevee(scene)
    assert "Many views are rendered by Cycles alone: set Cycles as engine." in drawn(scene)


def test_the_panel_has_the_verdict_and_the_folder(extension, four):
    scene, folder = four
    assert bpy.ops.render.stereo_reproject_views() == {"FINISHED"}
    seen = drawn(scene)
    assert any("rendered" in text for text in seen)
    assert {str(folder), "Open Folder"} <= set(seen)
