"""Many views side by side: rendered whole by Blender's own eyes, traced as they are rendered, and delivered whole."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from stereo_reproject.blender.commands.view_rigs import cone_of
from stereo_reproject.blender.commands.views import render_views_files
from stereo_reproject.blender.engines.views_renderer import ViewsRenderer, set_up_middle, standing_beside
from stereo_reproject.blender.output.pictures import read_png
from stereo_reproject.blender.scene.cone_room import cone_warnings
from stereo_reproject.blender.scene.rig import stereo_cameras
from stereo_reproject.blender.scene.working import evaluated, working_scene
from stereo_reproject.errors import BadInputError
from stereo_reproject.images.exr import read_channels
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS
from stereo_reproject.pipeline import many_views
from stereo_reproject.pipeline.view_plan import ViewCosts
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from stereo_reproject.settings.views import ViewsSettings
from stereo_reproject.trace.requests import TraceRequest
from stereo_reproject.views.camera import disparity_per_nearness
from stereo_reproject.views.cone import beside
from tests.blender.toolbox import add_camera, add_plane, diffuse, empty_scene, rms
from tests.render.test_fill import (
    NOISE,
    camera_in_fog,
    defocus,
    lens_shift,
    moving_camera,
    shader_that_knows_the_camera,
)
from tests.render.test_trace_requests import small_studio

FOCUS = 6.0
OFFSETS = (-0.4, 0.0, 0.5)
VIEWS = ViewsSettings(4, baseline=0.3, focus_distance=FOCUS, columns=2, rows=2)


def vertical_sensor(scene):
    scene.camera.data.sensor_fit = "VERTICAL"
    scene.camera.data.sensor_height = 17.0


@pytest.mark.parametrize("change", [lens_shift, vertical_sensor])
def test_blenders_eye_is_the_camera_beside(tmp_path, change):
    scene = small_studio(tmp_path, change)
    with working_scene(scene, SceneOverrides()) as working:
        middle = set_up_middle(working, FOCUS)
        for offset in OFFSETS:
            with standing_beside(working, offset) as eye:
                blenders = stereo_cameras(evaluated(working.camera, working), working.render)[eye]
            ours = beside(middle, offset, FOCUS)
            np.testing.assert_allclose(blenders.world_from_camera, ours.world_from_camera, atol=1e-6)
            np.testing.assert_allclose(
                [blenders.plane.left, blenders.plane.right], [ours.plane.left, ours.plane.right], atol=1e-6
            )


def keyed_stereo(scene):
    """Eyes whose distances are animated, as the lens is: at the present frame each has another value than is set."""
    data = scene.camera.data
    for frame, factor in ((scene.frame_current - 10, 1.0), (scene.frame_current + 10, 1.5)):
        for owner, name in (
            (data.stereo, "interocular_distance"),
            (data.stereo, "convergence_distance"),
            (data, "lens"),
        ):
            setattr(owner, name, factor * getattr(owner, name))
            owner.keyframe_insert(name, frame=frame)


@pytest.mark.parametrize(
    "change", [lens_shift, defocus, moving_camera, shader_that_knows_the_camera, camera_in_fog, keyed_stereo]
)
def test_traced_pixels_are_those_of_a_whole_render(tmp_path, change):
    """Whether all views are traced in one render, or where that is not exact, each by itself."""
    scene = small_studio(tmp_path, change)
    with working_scene(scene, SceneOverrides()) as working:
        renderer = ViewsRenderer(working, tmp_path, OFFSETS, FOCUS)
        names = ["view_00", "view_02"]
        shape = working.render.resolution_y, working.render.resolution_x
        requests = [TraceRequest(name, np.ones(shape, bool)) for name in names]
        traced = renderer.trace("packed", requests)
        for name, passes in zip(names, traced, strict=True):
            whole, _ = renderer.render_source(name, probed=False)
            colour = passes[COLOUR_PASS].reshape(whole[COLOUR_PASS].shape)
            again, _ = renderer.render_source(name, probed=False)
            np.testing.assert_array_equal(again[COLOUR_PASS], whole[COLOUR_PASS])
            other = ViewsRenderer(working, tmp_path, [0.0, *OFFSETS], FOCUS)
            repeated, _ = other.render_source(f"view_{names.index(name) * 2 + 1:02}", probed=False)
            noise = rms(repeated[COLOUR_PASS] - whole[COLOUR_PASS])
            assert rms(colour - whole[COLOUR_PASS]) <= NOISE * noise
            if change is not lens_shift:
                # Depth is that of one ray, through any part of a wide lens and at any time of an open shutter.
                continue
            depth = passes[DEPTH_PASS].reshape(shape)
            known = np.isfinite(depth) & np.isfinite(whole[DEPTH_PASS][..., 0])
            close = np.isclose(depth[known], whole[DEPTH_PASS][..., 0][known], rtol=1e-3)
            assert close.mean() > 0.9


@pytest.mark.parametrize("fresh", [0.0, 0.25])
def test_the_views_of_a_scene_are_delivered(tmp_path, monkeypatch, fresh):
    scene = small_studio(tmp_path, lit=True)
    # On a fast machine so small a view would be rendered sooner than made.
    monkeypatch.setattr(many_views, "_costs", lambda *_: ViewCosts(1.25, 0.05))
    settings = StereoSettings(compare=True, scene=SceneOverrides(size=(160, 120), samples=64, denoise=False, seed=3))
    report, files = render_views_files(scene, settings, replace(VIEWS, fresh=fresh), tmp_path)
    out = tmp_path / "out"
    assert sorted(files) == sorted(str(path.relative_to(out)) for path in out.rglob("*") if path.is_file())
    assert report == json.loads((out / "report.json").read_text())
    assert [view["name"] for view in report["views"]] == list(VIEWS.names)
    assert {view["how"] for view in report["views"]} == {"rendered", "made"}
    assert report["compare"]["honest_ratio"] <= 1.10
    assert report["compare"]["views"][0] == "view_00"
    assert report["compare"]["flicker_ratio"] is None
    noise = report["neighbours"]
    assert (noise["count"], len(noise["worst_views"])) == (3, 3)
    assert 0.8 < noise["noise_ratio"] <= noise["worst_noise_ratio"] < math.sqrt(3.0)
    assert ("fresh" in report) == (fresh > 0.0)
    if fresh:
        assert report["fresh"]["share"] == fresh
        assert 0.0 < report["fresh"]["seconds"] <= report["seconds"]["fill"]
        assert report["fresh"]["predicted_seconds"] > 0.0
        assert 0.8 < report["fresh"]["noise_ratio_without"] < math.sqrt(3.0)
        assert min(view["traced"] for view in report["views"]) > 0.9 * fresh
    quilt = read_png(out / "quilt_qs2x2a1.3333.png")
    assert quilt.shape[:2] == (240, 320)
    # View 0 is at the bottom left.
    views = [read_channels(out / "views" / f"{name}.exr") for name in VIEWS.names]
    exr = read_channels(out / "quilt_qs2x2a1.3333.exr")
    np.testing.assert_allclose(exr["R"][120:, :160], views[0]["R"], rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(exr["R"][:120, 160:], views[3]["R"], rtol=1e-3, atol=1e-4)


def test_denoised_views_flicker_and_nothing_of_them_is_traced_anew(tmp_path):
    scene = small_studio(tmp_path)
    settings = StereoSettings(compare=True, scene=SceneOverrides(size=(64, 48), samples=1, denoise=True))
    report, _ = render_views_files(scene, settings, replace(VIEWS, fresh=0.25), tmp_path)
    assert any("nothing is traced anew" in line for line in report["warnings"])
    assert "fresh" not in report
    assert report["neighbours"] is None
    assert 0.0 < report["compare"]["flicker_ratio"] < 2.0


def test_the_cone_is_that_of_the_cameras_convergence_distance(tmp_path):
    scene = small_studio(tmp_path)
    scene.camera.data.stereo.convergence_distance = 2.5
    with working_scene(scene, SceneOverrides()) as working:
        cone = cone_of(working, ViewsSettings(3, cone_degrees=90.0))
        assert cone.focus_distance == pytest.approx(2.5)
        np.testing.assert_allclose(cone.offsets, [-2.5, 0.0, 2.5], rtol=1e-6)
        renderer = ViewsRenderer(working, tmp_path, cone.offsets, cone.focus_distance)
        assert disparity_per_nearness(renderer.cameras["view_00"], renderer.cameras["view_02"]) != 0.0


def orthographic(scene):
    scene.camera.data.type = "ORTHO"


def panorama(scene):
    scene.camera.data.type = "PANO"


@pytest.mark.parametrize("change", [orthographic, panorama])
def test_cameras_that_cannot_be_moved_aside(tmp_path, change):
    scene = small_studio(tmp_path, change)
    with pytest.raises(BadInputError, match="no perspective camera"):
        render_views_files(scene, StereoSettings(), VIEWS, tmp_path)


@pytest.mark.parametrize(("hidden", "lines"), [(False, 1), (True, 0)])
def test_views_behind_a_wall_are_warned_of(tmp_path, hidden, lines):
    scene = empty_scene()
    add_camera(scene)
    wall = add_plane(scene, diffuse(), size=(20.0, 20.0), location=(1.0, 0.0, 0.0), rotation=(0.0, math.pi / 2.0, 0.0))
    wall.name, wall.hide_render = "Wall", hidden
    with working_scene(scene, SceneOverrides()) as working:
        found = cone_warnings(working, [-3.0, -1.5, 0.0, 1.5, 3.0], 4.0)
    assert len(found) == lines
    if lines:
        assert "view_03 to view_04 stand behind 'Wall'" in found[0]
        assert f"at most {math.floor(math.degrees(2 * math.atan(1.0 / 4.0)))} degrees" in found[0]
