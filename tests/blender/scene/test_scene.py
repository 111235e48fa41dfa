"""The scene that we work in: all that the user set, at the frame that was asked for, and not a trace of it left."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from stereo_reproject.blender.commands.frame import render_files
from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.scene import rendered as scene_module
from stereo_reproject.blender.scene.rendered import layers_to_render
from stereo_reproject.blender.scene.rig import frame_region
from stereo_reproject.blender.scene.working import make_small, working_scene
from stereo_reproject.errors import BadInputError, StereoReprojectError
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS
from stereo_reproject.pipeline.onlooker import Onlooker
from stereo_reproject.settings.frame import SceneOverrides, StereoSettings
from tests.blender.toolbox import (
    FINEST_FILTER,
    add,
    add_camera,
    add_cube,
    add_plane,
    emission,
    empty_scene,
    keyframes,
    pixel_centres,
    px_from_world,
    render_plain,
    set_border,
)

FRAME = 20

PIXELS = 0.01
"""As for the rig: a hundredth of a pixel."""


@pytest.fixture
def scene():
    """A shining box before a shining wall: no noise but that of edges."""
    scene = empty_scene(64, 36)
    add_plane(scene, emission("wall", (0.3, 0.5, 0.7)), size=(30, 20), location=(0, 0, -10))
    add_cube(scene, emission("box", (0.9, 0.4, 0.2)), size=1.5, location=(0.3, 0.2, -5)).name = "Box"
    add_camera(scene)
    return scene


# The user's settings reach the render


def moving_box(scene):
    keyframes(scene.objects["Box"], "location", {1: (-1.0, 0.0, -5.0), FRAME: (1.0, 0.3, -4.0)})


def moving_camera(scene):
    keyframes(scene.camera, "location", {1: (0.0, 0.0, 0.0), FRAME: (0.5, 0.2, 1.0)})


def zooming_lens(scene):
    keyframes(scene.camera.data, "lens", {1: 30.0, FRAME: 60.0})


def moving_parent(scene):
    parent = add(scene, bpy.data.objects.new("Parent", None))
    scene.camera.parent = parent
    keyframes(parent, "location", {1: (0.0, 0.0, 0.0), FRAME: (0.5, 0.2, 1.0)})


def widening_eyes(scene):
    data = scene.camera.data
    for frame, distance in ((1, 0.1), (FRAME, 0.5)):
        data.stereo.interocular_distance = distance
        data.keyframe_insert("stereo.interocular_distance", frame=frame)


@pytest.mark.parametrize("asked", ["by the settings", "by the scene"])
@pytest.mark.parametrize("change", [moving_box, moving_camera, zooming_lens, moving_parent, widening_eyes])
def test_the_frame_that_was_asked_for(scene, tmp_path, change, asked):
    """Depth is exact, without noise: equal depth is the same moment. And the rig is that of the moment."""
    change(scene)
    scene.cycles.filter_width = FINEST_FILTER
    scene.view_layers[0].use_pass_position = True
    scene.frame_set(1 if asked == "by the settings" else FRAME)
    overrides = SceneOverrides(frame=FRAME if asked == "by the settings" else None)
    with working_scene(scene, overrides) as working:
        assert working.frame_current == FRAME
        renderer = BlenderRenderer(working, tmp_path)
        ours = {view: renderer.render_source(view)[0] for view in ("left", "right")}
        cameras = renderer.cameras
    scene.frame_set(FRAME)
    plain = render_plain(scene, tmp_path)
    for view, passes in ours.items():
        np.testing.assert_array_equal(passes[DEPTH_PASS], plain[view][DEPTH_PASS])
        x, y, _ = px_from_world(cameras[view], passes["Position"])
        centre_x, centre_y = pixel_centres(x.shape)
        assert np.hypot(x - centre_x, y - centre_y).max() < PIXELS


def test_the_source_is_what_multiview_renders(scene, tmp_path):
    """The same seed, the same picture, to the last bit."""
    plain = render_plain(scene, tmp_path)["left"]
    with working_scene(scene, SceneOverrides()) as working:
        ours, _ = BlenderRenderer(working, tmp_path).render_source("left")
    assert set(ours) == set(plain)
    for name, values in plain.items():
        np.testing.assert_array_equal(ours[name], values)


def test_overrides_replace_what_the_scene_says(scene):
    scene.render.resolution_percentage = 50
    overrides = SceneOverrides(
        frame=7,
        size=(40, 30),
        samples=3,
        seed=9,
        interocular_distance=0.11,
        convergence_distance=3.0,
        convergence_mode="toe-in",
    )
    with working_scene(scene, overrides) as working:
        render, stereo = working.render, working.camera.data.stereo
        assert (render.resolution_x, render.resolution_y, render.resolution_percentage) == (40, 30, 100)
        assert (working.frame_current, working.cycles.samples, working.cycles.seed) == (7, 3, 9)
        # Blender keeps distances in single precision.
        assert stereo.interocular_distance == pytest.approx(0.11)
        assert (stereo.convergence_distance, stereo.convergence_mode) == (3.0, "TOE")


@pytest.mark.parametrize("own", ["none", 7.5])
def test_a_property_of_the_users_own_with_the_name_of_ours_is_none_of_ours(scene, own):
    scene["stereo_reproject_seed"] = own
    scene.cycles.seed = 11
    with working_scene(scene, SceneOverrides()) as working:
        assert working.cycles.seed == 11
    assert scene["stereo_reproject_seed"] == own


@pytest.mark.parametrize(("asked", "subframe"), [(None, 0.5), (3, 0.0), (4, 0.0)])
def test_a_frame_that_is_asked_for_has_no_subframe(scene, asked, subframe):
    scene.frame_set(3, subframe=0.5)
    with working_scene(scene, SceneOverrides(frame=asked)) as working:
        assert (working.frame_current, working.frame_subframe) == (asked or 3, subframe)
    assert (scene.frame_current, scene.frame_subframe) == (3, 0.5)


def test_a_scene_between_two_frames_before_0_stays_there(scene):
    scene.frame_set(-3, subframe=0.5)
    stood = scene.frame_current, scene.frame_subframe
    with working_scene(scene, SceneOverrides()) as working:
        assert (working.frame_current, working.frame_subframe) == stood
    assert (scene.frame_current, scene.frame_subframe) == stood


@pytest.mark.parametrize(
    ("border", "width", "expected"),
    [(None, 64, (64, 36)), ((0.4, 0.45, 0.5, 0.52), 8, (18, 4)), ((0.0, 0.5, 0.0, 1.0), 900, (160, 180))],
)
def test_a_small_render_is_no_smaller_than_blender_can(scene, tmp_path, border, width, expected):
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 1280, 720, 50
    if border:
        set_border(scene, border)
    with working_scene(scene, SceneOverrides(samples=1)) as working:
        before = frame_region(working.render).width
        scale = make_small(working, width)
        after = frame_region(working.render)
        assert (after.width, after.height) == pytest.approx(expected, abs=1)
        assert min(after.width, after.height) >= 4
        assert after.width / before == pytest.approx(scale, rel=0.2)


def test_samples_of_a_view_layer_give_way_too(scene, tmp_path):
    """With 1 sample a pixel of an edge shows one side of it; with 64 it shows both."""
    scene.view_layers[0].samples = 64
    with working_scene(scene, SceneOverrides(samples=1)) as working:
        red = BlenderRenderer(working, tmp_path).render_source("left")[0][COLOUR_PASS][..., 0]
    assert len(np.unique(red.round(4))) == 2


def camera_at(scene, name, x):
    camera = scene.camera.copy()
    camera.name, camera.location.x = name, x
    return add(scene, camera)


def mark(scene, frame, camera):
    scene.timeline_markers.new(camera.name, frame=frame).camera = camera


def rendered_from(scene, folder):
    """x of the place that the scene is rendered from, in a plain render."""
    scene.view_layers[0].use_pass_position = True
    scene.cycles.filter_width = FINEST_FILTER
    passes = render_plain(scene, folder, views=("left",))["left"]
    centre = passes["Position"][..., 0]
    return float(centre[:, 31:33].mean())


@pytest.mark.parametrize("frame", [1, 10, 15, 20, 30])
@pytest.mark.parametrize("hidden", [False, True])
def test_markers_choose_the_camera_as_in_a_render(scene, tmp_path, frame, hidden):
    bpy.data.objects.remove(scene.objects["Box"])
    first, second = camera_at(scene, "First", 1.0), camera_at(scene, "Second", -1.0)
    second.hide_render = hidden
    mark(scene, 20, second)
    mark(scene, 10, first)
    scene.frame_set(frame)
    with working_scene(scene, SceneOverrides()) as working:
        ours = working.camera.evaluated_get(working.view_layers[0].depsgraph).matrix_world.translation.x
    # Half a pixel is 0.08 units at the wall's distance.
    assert ours == pytest.approx(rendered_from(scene, tmp_path), abs=0.2)


def test_marker_serves_a_scene_without_a_camera_of_its_own(scene):
    mark(scene, 1, scene.camera)
    name = scene.camera.data.name
    scene.camera = None
    with working_scene(scene, SceneOverrides()) as working:
        assert working.camera.data.name.startswith(name)


# Nothing of it is left


def state_of(struct, path, seen):
    """Every value that RNA shows of a struct, by its path; other datablocks by their names."""
    key = (struct.bl_rna.identifier, struct.as_pointer())
    if key in seen:
        return
    seen.add(key)
    for prop in struct.bl_rna.properties:
        # What is computed anew whenever it is looked at is nobody's setting.
        if prop.identifier not in ("rna_type", "depsgraph"):
            yield from values_of(getattr(struct, prop.identifier), f"{path}.{prop.identifier}", seen)


def values_of(value, path, seen):
    if isinstance(value, bpy.types.ID):
        yield path, (type(value).__name__, value.name_full)
    elif isinstance(value, bpy.types.bpy_struct):
        yield from state_of(value, path, seen)
    elif isinstance(value, bpy.types.bpy_prop_collection):
        for index, item in enumerate(value):
            yield from values_of(item, f"{path}[{index}]", seen)
    elif isinstance(value, (bool, int, float, str, set, type(None))):
        yield path, value
    else:
        yield path, repr(value)


def datablocks():
    """Every datablock of the file, with how often it is used; render results come and go with any render."""
    for kind in dir(bpy.data):
        collection = getattr(bpy.data, kind)
        if isinstance(collection, bpy.types.bpy_prop_collection):
            for item in collection:
                if getattr(item, "type", "") != "RENDER_RESULT":
                    yield f"{kind}[{item.name_full!r}]", item.users


def whole_state(scene):
    """The scene with all its settings, its objects and cameras, and the names of everything in the file."""
    cameras = [item.data for item in scene.objects if item.type == "CAMERA"]
    state = dict(datablocks())
    for item in (scene, scene.world, *scene.objects, *cameras):
        state.update(state_of(item, f"{type(item).__name__} {item.name}", set()))
    return state


def changes(before, after):
    absent = "nothing"
    return {
        path: (before.get(path, absent), after.get(path, absent))
        for path in before.keys() | after.keys()
        if before.get(path, absent) != after.get(path, absent)
    }


@pytest.fixture
def rich_scene(scene):
    """A scene with settings of all kinds that we replace in our copy, and none of them at its default."""
    render = scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.1, 0.9, 0.2, 0.95
    render.resolution_percentage, render.pixel_aspect_x = 150, 1.5
    render.filepath, render.use_overwrite, render.use_placeholder = "//somewhere", False, True
    render.use_stamp = render.use_sequencer = render.use_compositing = True
    render.views_format = "MULTIVIEW"
    render.views["left"].use = False
    render.image_settings.file_format, render.image_settings.color_depth = "TIFF", "16"
    scene.cycles.filter_width, scene.cycles.samples, scene.cycles.seed = 1.7, 2, 11
    scene.cycles.pixel_filter_type, scene.cycles.time_limit = "GAUSSIAN", 100.0
    scene.cycles.transparent_max_bounces = 5
    scene.view_layers[0].cycles.use_denoising = True
    scene.view_layers[0].use_pass_z = False
    scene.view_layers.new("Other").use = False
    bpy.data.objects.new("Not in the scene", None)
    mark(scene, 1, scene.camera)
    keyframes(scene.camera, "location", {1: (0.0, 0.0, 0.0), 40: (0.5, 0.2, 1.0)})
    scene.camera.data.shift_x = 0.03
    scene.frame_set(3)
    scene.view_layers[0].update()
    return scene


@pytest.mark.parametrize("fill", ["packed", "card", "full"])
def test_success_leaves_the_scene_as_it_was(rich_scene, tmp_path, fill):
    before = whole_state(rich_scene)
    settings = StereoSettings(fill=fill, compare=True, scene=SceneOverrides(frame=FRAME, size=(48, 27)))
    report, _ = render_files(rich_scene, settings, tmp_path)
    assert report["fill"]["method"] == fill
    assert changes(before, whole_state(rich_scene)) == {}


class StoppedError(Exception):
    pass


@pytest.mark.parametrize("fill", ["packed", "card"])
@pytest.mark.parametrize("stage", ["source", "warp", "fill", "composite", "write", "compare"])
def test_a_stop_at_any_stage_leaves_the_scene_as_it_was(rich_scene, tmp_path, stage, fill):
    def stop(name):
        if name == stage:
            raise StoppedError

    before = whole_state(rich_scene)
    settings = StereoSettings(fill=fill, compare=True, scene=SceneOverrides(size=(48, 27)))
    with pytest.raises(StoppedError):
        render_files(rich_scene, settings, tmp_path, onlooker=Onlooker(stop))
    assert changes(before, whole_state(rich_scene)) == {}


@pytest.mark.parametrize("fill", ["packed", "card", "full"])
def test_a_render_that_fails_leaves_the_scene_as_it_was(rich_scene, tmp_path, fill):
    """A folder in the place of the file that Blender is to write, from the fill on."""

    def obstruct(name):
        if name == "fill":
            (tmp_path / "render.exr").mkdir()

    before = whole_state(rich_scene)
    settings = StereoSettings(fill=fill, scene=SceneOverrides(size=(48, 27)))
    with pytest.raises(StereoReprojectError) as failure:
        render_files(rich_scene, settings, tmp_path, onlooker=Onlooker(obstruct))
    assert "\n" not in str(failure.value)
    assert changes(before, whole_state(rich_scene)) == {}


def test_the_working_scene_is_the_users_own_copy(rich_scene):
    """Two at a time, as when multiview is rendered, each with a camera of its own."""
    before = whole_state(rich_scene)
    with working_scene(rich_scene, SceneOverrides()) as one, working_scene(rich_scene, SceneOverrides()) as other:
        assert len({rich_scene.name, one.name, other.name}) == 3
        assert len({item.camera.data.name for item in (rich_scene, one, other)}) == 3
    assert changes(before, whole_state(rich_scene)) == {}


def test_rigid_bodies_stay_what_they_are(scene, tmp_path):
    bpy.ops.rigidbody.world_add()
    with bpy.context.temp_override(object=scene.objects["Box"], active_object=scene.objects["Box"]):
        bpy.ops.rigidbody.object_add()
    before = whole_state(scene)
    render_files(scene, StereoSettings(scene=SceneOverrides(size=(32, 18))), tmp_path)
    assert scene.objects["Box"].rigid_body is not None
    assert changes(before, whole_state(scene)) == {}


# What cannot be rendered


def without_camera(scene):
    scene.camera = None


def looking_through_a_lamp(scene):
    lamp = add(scene, bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT")))
    scene.camera = lamp


def mirror_ball(scene):
    scene.camera.data.type, scene.camera.data.panorama_type = "PANO", "MIRRORBALL"


def custom(scene):
    scene.camera.data.type = "CUSTOM"


def panorama_in_eevee(scene):
    scene.camera.data.type = "PANO"
    scene.render.engine = "BLENDER_EEVEE_NEXT" if bpy.app.version < (5, 0) else "BLENDER_EEVEE"


def layers_off(scene):
    for layer in scene.view_layers:
        layer.use = False


def workbench(scene):
    scene.render.engine = "BLENDER_WORKBENCH"


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (without_camera, "no camera"),
        (looking_through_a_lamp, "'Lamp'"),
        (mirror_ball, "panoramic mirror ball"),
        (panorama_in_eevee, "panorama, which Cycles alone renders"),
        (custom, "custom"),
        (layers_off, "view layer"),
        (workbench, "BLENDER_WORKBENCH"),
    ],
)
def test_what_cannot_be_rendered_is_said_in_one_line(scene, change, part):
    change(scene)
    before = whole_state(scene)
    with pytest.raises(BadInputError, match=part) as refusal, working_scene(scene, SceneOverrides()):
        pass
    assert "\n" not in str(refusal.value)
    assert changes(before, whole_state(scene)) == {}


def test_compare_measures_against_blenders_own_multiview(scene, tmp_path):
    """A pair that is nothing but two plain renders has the noise of two plain renders."""
    scene.cycles.samples = 8
    settings = StereoSettings(fill="full", compare=True)
    report, _ = render_files(scene, settings, tmp_path)
    # A few hundred pixels on edges make all of the noise here.
    assert report["compare"]["noise_ratio"] == pytest.approx(1.0, abs=0.25)


def three_layers():
    scene = empty_scene()
    for name in ("Second", "Third"):
        scene.view_layers.new(name)
    scene.view_layers[0].use = False
    return scene


def test_a_single_layer_is_the_windows_affair(monkeypatch):
    """Blender: "Only affects rendering from the interface, ignored for rendering from command line"."""
    scene = three_layers()
    scene.render.use_single_layer = True
    assert layers_to_render(scene) == ["Second", "Third"]
    window = SimpleNamespace(scene=scene, view_layer=scene.view_layers[0])
    monkeypatch.setattr(
        scene_module, "bpy", SimpleNamespace(app=SimpleNamespace(background=False), context=window, types=bpy.types)
    )
    assert layers_to_render(scene) == ["ViewLayer"]
    scene.render.use_single_layer = False
    assert layers_to_render(scene) == ["Second", "Third"]


def test_a_working_scene_renders_the_layer_that_it_is_asked_for():
    scene = three_layers()
    add_camera(scene)
    for layer, expected in ((None, "Second"), ("Third", "Third")):
        with working_scene(scene, SceneOverrides(), layer=layer) as working:
            assert [one.name for one in working.view_layers if one.use] == [expected]


def test_samples_without_the_first_have_no_depth(scene):
    scene.cycles.use_sample_subset, scene.cycles.sample_offset = True, 16
    with pytest.raises(BadInputError, match="Offset to 0"), working_scene(scene, SceneOverrides()):
        pass
