"""A scene's own views: a camera for each, found as Blender finds it, rendered and traced as Blender renders it."""

import json
import math
from dataclasses import replace

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.commands.view_rigs import cameras_in, rig_of
from stereo_reproject.blender.commands.views import render_views_files
from stereo_reproject.blender.engines.scene_views_renderer import camera_of
from stereo_reproject.blender.output.pictures import read_png
from stereo_reproject.blender.scene.view_cameras import cameras_of_views
from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.errors import BadInputError
from stereo_reproject.images.exr import read_channels, read_eye, read_render
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS
from stereo_reproject.pipeline import many_views
from stereo_reproject.pipeline.view_plan import ViewCosts
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from stereo_reproject.settings.views import ViewsSettings
from stereo_reproject.trace.requests import TraceRequest
from tests.blender.snapshot import everything
from tests.blender.toolbox import add_compositor, rms
from tests.render.test_fill import NOISE, PACKED, defocus, lens_shift, shader_that_knows_the_camera
from tests.render.test_trace_requests import small_studio

FROM_SCENE = ViewsSettings(0, from_scene=True)

LINE = {"left": "_L", "mid dle": "_M", "RenderView.001": "_1", "right": "_R"}
"""Suffixes of the views, by name, in the scene's order."""


def with_views(scene, suffixes=LINE, step=0.15):
    """Give the scene these views, with a camera for each, side by side and turned a little towards each other; the
    scene's camera is that of the first."""
    render, first = scene.render, scene.camera
    render.use_multiview, render.views_format = True, "MULTIVIEW"
    for name, suffix in suffixes.items():
        view = render.views[name] if name in render.views else render.views.new(name)
        view.camera_suffix = suffix
    for name in [view.name for view in render.views if view.name not in suffixes]:
        render.views.remove(render.views[name])
    # In another order than they were added.
    for number, suffix in enumerate(suffixes.values()):
        camera = first if number == 0 else first.copy()
        camera.name = f"Rig{suffix}"
        if number:
            camera.data = first.data.copy()
            scene.collection.objects.link(camera)
        bpy.context.view_layer.update()
        across = first.matrix_world.to_3x3().normalized().col[0]
        camera.location = first.location + number * step * across
        camera.rotation_euler.rotate_axis("Y", 0.01 * number)
    bpy.context.view_layer.update()
    return scene


def test_cameras_stand_where_they_do_in_the_frame_that_is_asked_for(tmp_path):
    """The file was saved at another frame, and each camera has curves of its own."""
    scene, first = with_views(small_studio(tmp_path)), bpy.context.scene.frame_current
    for number, suffix in enumerate(LINE.values()):
        camera = scene.objects[f"Rig{suffix}"]
        for frame, x in ((first, 0.0), (first + 4, 4.0 * number)):
            camera.location = (x, 0.0, 0.0)
            camera.keyframe_insert("location", frame=frame)
    scene.frame_set(first)
    with (
        working_scene(scene, SceneOverrides(frame=first + 4)) as working,
        cameras_in(scene, working, FROM_SCENE) as copies,
    ):
        places = {round(camera_of(working, name).world_from_camera[0, 3]) for name in copies.values()}
    assert places == {0, 4, 8, 12}


def in_blenders_order(scene):
    return [view.name for view in scene.render.views]


def test_each_view_is_what_blender_renders(tmp_path):
    """The position of each pixel's first surface tells the camera."""
    scene = with_views(small_studio(tmp_path))
    scene.objects["Rig_M"].data.lens *= 1.3
    scene.view_layers[0].use_pass_position = scene.view_layers[0].use_pass_z = True
    settings = StereoSettings(scene=SceneOverrides(samples=1, denoise=False))
    render_views_files(scene, settings, FROM_SCENE, tmp_path)
    scene.cycles.samples = 1
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.color_depth, image.views_format = "OPEN_EXR_MULTILAYER", "32", "INDIVIDUAL"
    scene.render.filepath = str(tmp_path / "blender")
    bpy.ops.render.render(scene=scene.name, write_still=True)
    for name, suffix in LINE.items():
        ours = read_eye(tmp_path / "out" / "views" / f"{name}.exr")
        [passes] = ours.values()
        theirs, _ = read_render(tmp_path / f"blender{suffix}.exr", layer=scene.view_layers[0].name, view=name)
        known = passes[DEPTH_PASS][..., 0] < 1e9
        assert known.any()
        close = np.isclose(passes["Position"][known], theirs["Position"][known], atol=0.05)
        assert close.mean() > 0.95


def on_a_dolly(scene, turn=0.0):
    """Have all cameras hang on an empty that moves while the shutter is open, and turns by so many radians a frame."""
    dolly, frame = bpy.data.objects.new("Dolly", None), scene.frame_current
    scene.collection.objects.link(dolly)
    for item in [item for item in scene.objects if item.type == "CAMERA"]:
        item.parent = dolly
    for step in (-1, 1):
        dolly.location.x, dolly.rotation_euler.z = 0.1 * step, turn * step
        for name in ("location", "rotation_euler"):
            dolly.keyframe_insert(name, frame=frame + step)
    scene.frame_set(frame)
    scene.render.use_motion_blur = True


def on_a_turning_dolly(scene):
    on_a_dolly(scene, turn=0.02)


@pytest.mark.parametrize("packed_by", PACKED)
@pytest.mark.parametrize("change", [lens_shift, defocus, shader_that_knows_the_camera, on_a_dolly, on_a_turning_dolly])
def test_traced_pixels_are_those_of_a_whole_render(tmp_path, change, packed_by):
    """Whether all views are traced in one render, or where that is not exact, each by its own camera."""
    scene = small_studio(tmp_path)
    if change in (lens_shift, defocus, shader_that_knows_the_camera):
        change(scene)
    with_views(scene)
    if change in (on_a_dolly, on_a_turning_dolly):
        change(scene)
    with working_scene(scene, SceneOverrides()) as working, cameras_in(scene, working, FROM_SCENE) as copies:
        rig = rig_of(scene, working, FROM_SCENE, copies)
        with rig.renderer(working, tmp_path, user_scene=scene, packed_by=packed_by) as renderer:
            assert renderer.fill_blockers(10.0)["packed"] is None
            names = [rig.asked[rig.made.index(name)] for name in ("right", "mid dle")]
            shape = working.render.resolution_y, working.render.resolution_x
            # Of the second trace, after whole renders, nothing of the first may be left in the scene.
            for _ in range(2):
                traced = renderer.trace("packed", [TraceRequest(name, np.ones(shape, bool)) for name in names])
                for name, passes in zip(names, traced, strict=True):
                    whole, _ = renderer.render_source(name, probed=False)
                    renderer.own_seeds = {**renderer.own_seeds, name: renderer.own_seeds[name] + 77}
                    again, _ = renderer.render_source(name, probed=False)
                    noise = rms(again[COLOUR_PASS] - whole[COLOUR_PASS])
                    assert noise > 0.0
                    colour = passes[COLOUR_PASS].reshape(whole[COLOUR_PASS].shape)
                    assert rms(colour - whole[COLOUR_PASS]) <= NOISE * noise
    assert scene.camera.name == "Rig_L"
    assert len(bpy.data.cameras) == len(LINE)
    assert not [item for item in bpy.data.objects if item.name.startswith("stereo_reproject")]


def test_what_a_portal_hangs_before_one_camera_is_seen_by_no_other(tmp_path):
    """One camera looks at another one's place, in a scene whose views are traced one by one."""
    scene = with_views(small_studio(tmp_path, shader_that_knows_the_camera))
    front, back = scene.objects["Rig_R"], scene.objects["Rig_M"]
    back.rotation_euler = front.rotation_euler
    bpy.context.view_layer.update()
    back.location = front.location + 0.5 * front.matrix_world.to_3x3().normalized().col[2]
    with working_scene(scene, SceneOverrides()) as working, cameras_in(scene, working, FROM_SCENE) as copies:
        rig = rig_of(scene, working, FROM_SCENE, copies)
        with rig.renderer(working, tmp_path, user_scene=scene, packed_by="portal") as renderer:
            before, behind = (rig.asked[rig.made.index(name)] for name in ("right", "mid dle"))
            shape = working.render.resolution_y, working.render.resolution_x
            first, _ = renderer.render_source(behind, probed=False)
            renderer.trace("packed", [TraceRequest(name, np.ones(shape, bool)) for name in (before, behind)])
            again, _ = renderer.render_source(behind, probed=False)
    np.testing.assert_array_equal(again[COLOUR_PASS], first[COLOUR_PASS])


@pytest.mark.parametrize("quilt", [False, True])
def test_views_keep_the_scenes_names_and_order(tmp_path, quilt):
    scene = with_views(small_studio(tmp_path, lit=True))
    grid = {"columns": 2, "rows": 2} if quilt else {}
    views = ViewsSettings(0, from_scene=True, **grid)
    settings = StereoSettings(compare=quilt, scene=SceneOverrides(size=(64, 48), samples=2, denoise=False, seed=3))
    report, files = render_views_files(scene, settings, views, tmp_path)
    out = tmp_path / "out"
    assert sorted(files) == sorted(path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file())
    assert report == json.loads((out / "report.json").read_text())
    assert [view["name"] for view in report["views"]] == in_blenders_order(scene)
    assert {view["camera"] for view in report["views"]} == {f"Rig{suffix}" for suffix in LINE.values()}
    assert any(name.startswith("quilt_") for name in files) == quilt
    assert "cone_degrees" not in report
    if quilt:
        # The leftmost camera is at the bottom left, whatever the scene's order.
        exr = read_channels(out / "quilt_qs2x2a1.3333.exr")
        for name, rows, columns in (("left", slice(48, 96), slice(0, 64)), ("right", slice(0, 48), slice(64, 128))):
            view = read_channels(out / "views" / f"{name}.exr")
            np.testing.assert_allclose(exr["R"][rows, columns], view["R"], rtol=1e-3, atol=1e-4)
        assert report["compare"]["views"][0] == "left"


def test_all_views_in_one_file(tmp_path):
    """Blender itself reads it as an image of many views."""
    scene = with_views(small_studio(tmp_path))
    settings = StereoSettings(scene=SceneOverrides(size=(32, 24), samples=1, denoise=False))
    _, files = render_views_files(scene, settings, replace(FROM_SCENE, layout="multi-view"), tmp_path)
    out = tmp_path / "out"
    assert sorted(files) == sorted(path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file())
    assert "views.exr" in files
    assert not any(name.startswith("views/") for name in files)
    image = bpy.data.images.load(str(out / "views.exr"))
    # Asked for its size, Blender opens it.
    assert len(tuple(image.size)) == 2
    assert (image.type, image.is_multiview) == ("MULTILAYER", True)


def test_holes_of_made_views_are_shown_and_told(tmp_path, monkeypatch):
    scene = with_views(small_studio(tmp_path, lit=True))
    monkeypatch.setattr(many_views, "_costs", lambda *_: ViewCosts(1.25, 0.05))
    settings = StereoSettings(scene=SceneOverrides(size=(160, 120), samples=16, denoise=False, seed=3))
    report, files = render_views_files(scene, settings, FROM_SCENE, tmp_path)
    made = [view for view in report["views"] if view["how"] == "made"]
    assert made
    assert {name for name in files if name.startswith("holes/")} == {f"holes/{view['name']}.png" for view in made}
    for view in report["views"]:
        assert set(view["shown_from"]) == set(view["from"])
        total = sum(view["shown_from"].values()) + view["traced"]
        assert total == pytest.approx(1.0)
    for view in made:
        assert set(view["from"]) <= set(LINE)
        assert read_png(tmp_path / "out" / "holes" / f"{view['name']}.png").shape[1] == 160


def darker(scene):
    """Have the scene's compositor halve the picture."""
    tree, layers, output = add_compositor(scene)
    layers.layer = scene.view_layers[0].name
    dark = tree.nodes.new("CompositorNodeExposure")
    dark.inputs["Exposure"].default_value = -1.0
    tree.links.new(layers.outputs["Image"], dark.inputs["Image"])
    tree.links.new(dark.outputs["Image"], output)
    scene.render.use_compositing = True
    # Set once, it has a colour space, as after any other choice of a format.
    scene.render.image_settings.file_format = "PNG"


def test_pictures_show_views_after_the_compositor(tmp_path):
    scene = with_views(small_studio(tmp_path, darker))
    views = ViewsSettings(0, from_scene=True, columns=2, rows=2)
    settings = StereoSettings(scene=SceneOverrides(size=(64, 48), samples=2, denoise=False))
    before = everything()
    report, files = render_views_files(scene, settings, views, tmp_path)
    assert everything() == before
    assert not any("compositor" in line for line in report["warnings"])
    out = tmp_path / "out"
    assert sorted(files) == sorted(path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file())
    quilt = read_channels(out / next(name for name in files if name.endswith(".exr")))
    view = read_channels(out / "views" / "left.exr")
    assert view["R"].max() > 0.1
    np.testing.assert_allclose(quilt["R"][48:, :64], 0.5 * view["R"], rtol=1e-3, atol=1e-4)


def test_two_views_that_are_neither_left_nor_right(tmp_path):
    scene = with_views(small_studio(tmp_path), {"one": "_1", "two": "_2"})
    settings = StereoSettings(scene=SceneOverrides(size=(32, 24), samples=1, denoise=False))
    report, _ = render_views_files(scene, settings, FROM_SCENE, tmp_path)
    assert [(view["name"], view["camera"]) for view in report["views"]] == [("one", "Rig_1"), ("two", "Rig_2")]
    assert in_blenders_order(scene) == ["one", "two"]


def no_multiview(scene):
    scene.render.use_multiview = False


def stereo_3d(scene):
    scene.render.views_format = "STEREO_3D"


def no_camera(scene):
    bpy.data.objects.remove(scene.objects["Rig_M"])


def no_suffix(scene):
    scene.camera.name = "Camera"


def one_view(scene):
    for view in list(scene.render.views)[1:]:
        view.use = False


def a_plane(scene):
    scene.objects["Rig_M"].name = "Other"
    plane = bpy.data.objects.new("Rig_M", bpy.data.meshes.new("Plane"))
    scene.collection.objects.link(plane)


def orthographic(scene):
    scene.objects["Rig_R"].data.type = "ORTHO"


def same_file(scene):
    scene.render.views["right"].name = "a:b"
    scene.render.views["left"].name = "A/b"


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (no_multiview, "no views of its own"),
        (stereo_3d, "no views of its own"),
        (no_camera, "view 'mid dle' has no camera: the scene needs one called 'Rig_M'"),
        (no_suffix, "ends with no view's suffix"),
        (one_view, "has 1 views"),
        (a_plane, "which is no camera"),
        (orthographic, "no perspective camera"),
        (same_file, "would have one file"),
    ],
)
def test_what_is_in_the_way_is_said_in_a_line(tmp_path, change, line):
    scene = with_views(small_studio(tmp_path))
    change(scene)
    with pytest.raises(BadInputError, match=line) as told:
        render_views_files(scene, StereoSettings(scene=SceneOverrides(samples=1)), FROM_SCENE, tmp_path)
    assert "\n" not in str(told.value)


def test_a_quilt_without_a_place_for_each_view(tmp_path):
    scene = with_views(small_studio(tmp_path))
    views = ViewsSettings(0, from_scene=True, columns=3, rows=1)
    with pytest.raises(BadInputError, match="a place for each of the 4 views"):
        render_views_files(scene, StereoSettings(scene=SceneOverrides(samples=1)), views, tmp_path)


def test_cameras_are_found_by_the_longest_suffix(tmp_path):
    scene = with_views(small_studio(tmp_path), {"a": "_R", "b": "L_R", "c": ""})
    first = scene.camera
    first.name, scene.objects["RigL_R"].name, scene.objects["Rig"].name = "camL_R", "cam_R", "cam"
    assert {view: camera.name for view, camera in cameras_of_views(scene, 1).items()} == {
        "a": "cam_R",
        "b": "camL_R",
        "c": "cam",
    }


def moved_apart(scene):
    camera, frame = scene.objects["Rig_M"], scene.frame_current
    scene.render.use_motion_blur = True
    for shift, at in ((-0.5, frame - 1), (0.5, frame + 1)):
        camera.location.z += shift
        camera.keyframe_insert("location", frame=at)


def other_clip(scene):
    scene.objects["Rig_M"].data.clip_start *= 2.0


@pytest.mark.parametrize(
    ("change", "reason"), [(moved_apart, "while the shutter is open"), (other_clip, "other clip distances")]
)
def test_cameras_that_are_too_unlike_are_all_rendered(tmp_path, change, reason):
    scene = with_views(small_studio(tmp_path))
    change(scene)
    settings = StereoSettings(scene=SceneOverrides(size=(32, 24), samples=1, denoise=False))
    report, _ = render_views_files(scene, settings, FROM_SCENE, tmp_path)
    assert {view["how"] for view in report["views"]} == {"rendered"}
    assert any(reason in line for line in report["plan"])


def test_cameras_around_a_thing_are_no_line(tmp_path):
    scene = with_views(small_studio(tmp_path))
    for number, suffix in enumerate(LINE.values()):
        angle = 0.2 * number
        camera = scene.objects[f"Rig{suffix}"]
        camera.location = (6.0 * math.sin(angle), -6.0 * math.cos(angle), 1.0)
        camera.rotation_euler = (math.radians(85.0), 0.0, angle)
    views = ViewsSettings(0, from_scene=True, columns=2, rows=2)
    settings = StereoSettings(scene=SceneOverrides(size=(32, 24), samples=1, denoise=False))
    report, files = render_views_files(scene, settings, views, tmp_path)
    assert "quilt_qs2x2a1.3333.png" in files
    assert any("do not stand on a line" in line for line in report["warnings"])
