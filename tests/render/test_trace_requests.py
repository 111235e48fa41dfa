"""Pixels of several views, traced in one packed render: each is what a plain render of its view would show.

Where colours are compared everything shines by itself, so that all noise is that of the pixel filter, the lens and the
shutter.
"""

from dataclasses import replace

import bpy
import numpy as np
import pytest
from bpy.app.handlers import persistent
from mathutils import Euler, Matrix

from stereo_reproject.blender.engines.denoise import NORMAL
from stereo_reproject.blender.engines.eevee import MEAN_DEPTH, renderer_of
from stereo_reproject.blender.engines.packed_trace import CAMERAS, trace_packed
from stereo_reproject.blender.engines.packed_views import PackedPixels
from stereo_reproject.blender.engines.portal_camera import VOLUMES_GUIDED_FROM_VERSION
from stereo_reproject.blender.engines.renderer import BlenderRenderer
from stereo_reproject.blender.engines.shared_render import turns_in_shutter
from stereo_reproject.blender.scene.working import working_scene
from stereo_reproject.errors import BadInputError
from stereo_reproject.images.passes import COLOUR_PASS, DEPTH_PASS
from stereo_reproject.settings.frame import SceneOverrides
from stereo_reproject.trace.requests import TraceRequest
from tests.blender.toolbox import EYES, FINEST_FILTER, render_plain, rms
from tests.render.test_eevee import EEVEE
from tests.render.test_fill import (
    EDGE_PIXELS,
    NOISE,
    PACKED,
    PASS_VALUES,
    camera_in_fog,
    camera_in_the_world,
    defocus,
    defocus_on_an_object,
    lens_shift,
    moving_camera,
    moving_object,
    moving_parent_of_the_camera,
    near_clip_cuts,
    pixel_filter,
    shader_that_knows_the_camera,
    studio,
    toe_in,
)

SIZE = (48, 27)
SAMPLES = 32

SAME_NOISE = 1e-4
"""Difference of colours of the same rays, in single precision."""


def small_studio(folder, *changes, lit=False):
    scene = studio(folder, lit=lit)
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.cycles.samples = SAMPLES
    scene.camera.data.stereo.interocular_distance = 0.3
    for change in changes:
        change(scene)
    return scene


def whole(view, camera):
    return TraceRequest(view, np.ones((camera.height, camera.width), bool))


def traced(renderer, *views):
    """The passes (H, W, C) of whole views, traced packed and together."""
    cameras = [renderer.cameras[view] for view in views]
    answers = renderer.trace("packed", [whole(*pair) for pair in zip(views, cameras, strict=True)])
    return [
        {name: image.reshape(camera.height, camera.width, -1) for name, image in passes.items()}
        for camera, passes in zip(cameras, answers, strict=True)
    ]


@pytest.fixture(params=PACKED)
def packed_by(request):
    """Each packed camera."""
    return request.param


@pytest.fixture
def renders():
    """The scenes of finished renders."""
    finished = []

    @persistent
    def listen(scene, *_):
        finished.append(scene.name)

    bpy.app.handlers.render_complete.append(listen)
    yield finished
    bpy.app.handlers.render_complete.remove(listen)


def turned_around(scene):
    scene.camera.data.stereo.convergence_distance = 4.0
    toe_in(scene)


def focused_by_each_eye(scene):
    """On an object to the side: its depth is another one in each eye that is toed in."""
    defocus_on_an_object(scene)
    turned_around(scene)


def sliding_camera(scene):
    moving_parent_of_the_camera(scene)
    moving_object(scene)


def fog_around_the_right_eye(scene):
    """Of which Cycles would not know with a camera at the left one."""
    camera_in_fog(scene)
    fog = scene.objects[-1]
    fog.scale = (0.02,) * 3
    fog.location.x = 0.4


FOGS = {camera_in_fog, fog_around_the_right_eye}


def by_each_camera(*variants):
    """Parameters: each packed camera with each of the changes, but for those that a portal cannot render."""
    return [
        pytest.param(packed_by, changes, id="-".join([packed_by, *(change.__name__ for change in changes)]))
        for packed_by in PACKED
        for changes in variants
        if packed_by == "osl" or FOGS.isdisjoint(changes) or bpy.app.version < VOLUMES_GUIDED_FROM_VERSION
    ]


@pytest.mark.parametrize(
    ("packed_by", "changes"),
    by_each_camera(
        (pixel_filter("GAUSSIAN", 2.2),),
        (defocus, lens_shift),
        (focused_by_each_eye,),
        (sliding_camera,),
        (turned_around, camera_in_the_world, near_clip_cuts),
        (camera_in_fog,),
    ),
)
def test_both_eyes_in_one_render_are_as_rendered(packed_by, tmp_path, renders, changes):
    scene = small_studio(tmp_path, *changes)
    a, b = (render_plain(scene, tmp_path, seed=seed) for seed in (1, 2))
    scene.cycles.seed = 3
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, tmp_path, packed_by=packed_by)
        renders.clear()
        ours = traced(renderer, *EYES)
    assert len(renders) == 1
    for view, passes in zip(EYES, ours, strict=True):
        one, other = a[view][COLOUR_PASS], b[view][COLOUR_PASS]
        assert rms(passes[COLOUR_PASS] - one) < NOISE * rms(other - one), view
        swapped = a[EYES[view == "left"]][COLOUR_PASS]
        assert rms(swapped - one) > 1.5 * rms(other - one), "another view would be seen"


def data_passes(scene):
    for name in ("z", "normal", "object_index"):
        setattr(scene.view_layers[0], f"use_pass_{name}", True)
    scene.view_layers[0].cycles.denoising_store_passes = True
    scene.cycles.filter_width, scene.cycles.samples = FINEST_FILTER, 1


def positions(scene):
    scene.view_layers[0].use_pass_position = True


@pytest.mark.parametrize("changes", [(positions,), (turned_around, positions), (turned_around, camera_in_the_world)])
def test_data_passes_are_those_of_each_eye(packed_by, tmp_path, changes):
    scene = small_studio(tmp_path, data_passes, *changes, lit=True)
    plain = render_plain(scene, tmp_path)
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, tmp_path, packed_by=packed_by)
        ours = dict(zip(EYES, traced(renderer, *EYES), strict=True))
        again = traced(renderer, "left")[0]
    for view in EYES:
        assert set(ours[view]) == set(plain[view]) == set(again)
        assert ours[view][DEPTH_PASS].max() > 5.0
        for name in set(plain[view]) - {COLOUR_PASS}:
            with np.errstate(invalid="ignore"):
                # The box's side is seen at a grazing angle.
                differs = np.abs(ours[view][name] - plain[view][name]) > 2.0 * PASS_VALUES
            differs &= ours[view][name] != plain[view][name]
            assert differs.any(axis=-1).mean() <= EDGE_PIXELS, (view, name)


def between(cameras, count):
    """So many cameras by name from the left eye to the right one, on an arc, each turned and rolled a little more."""
    left, right = (cameras[view] for view in EYES)
    result = {}
    for number, share in enumerate(np.linspace(0.0, 1.0, count)):
        moved = left.world_from_camera.copy()
        moved[:3, 3] += share * (right.world_from_camera - left.world_from_camera)[:3, 3] + (0.0, share, -share)
        turn = Euler((-0.1 * share, 0.1 * share, 0.4 * share)).to_matrix().to_4x4()
        result[f"view {number:02}"] = replace(left, world_from_camera=moved @ np.array(turn))
    return result


def rendered_alone(scene, folder, camera):
    """A plain render of a view by Blender's own camera, put where it stands."""
    scene.camera.matrix_basis = Matrix(camera.world_from_camera.tolist())
    return render_plain(scene, folder, views=("left",))["left"]


def parallel(scene):
    scene.camera.data.stereo.convergence_mode = "PARALLEL"


@pytest.mark.parametrize("count", [3, 12])
def test_views_that_blender_does_not_have(packed_by, tmp_path, renders, count):
    scene = small_studio(tmp_path, parallel, data_passes)
    with working_scene(scene, SceneOverrides()) as working:
        views = between(BlenderRenderer(working, tmp_path, packed_by=packed_by).cameras, count)
        renderer = BlenderRenderer(working, tmp_path, views=views, packed_by=packed_by)
        renders.clear()
        ours = traced(renderer, *views)
        assert len(renders) == 1
        with pytest.raises(BadInputError, match="view 01"):
            renderer.trace("card", [whole("view 01", renderer.cameras["view 01"])])
        source, _ = renderer.render_source("left")
        assert "Position" not in source
    for number in (0, 1, count - 1):
        plain = rendered_alone(scene, tmp_path, views[f"view {number:02}"])
        for name in (COLOUR_PASS, DEPTH_PASS, "Normal"):
            with np.errstate(invalid="ignore"):
                differs = np.abs(ours[number][name] - plain[name]) > 10.0 * PASS_VALUES
            differs &= ours[number][name] != plain[name]
            assert differs.any(axis=-1).mean() <= 2.0 * EDGE_PIXELS, (number, name)


def test_the_lens_turns_with_its_view(packed_by, tmp_path):
    """Bokeh that is no disc lies in the plane of the view that it belongs to, and what is in focus by its depth."""
    scene = small_studio(tmp_path, parallel, defocus_on_an_object)
    parallel(scene)
    with working_scene(scene, SceneOverrides(seed=3)) as working:
        views = between(BlenderRenderer(working, tmp_path, packed_by=packed_by).cameras, 3)
        ours = traced(BlenderRenderer(working, tmp_path, views=views, packed_by=packed_by), *views)
    scene.camera.matrix_basis = Matrix(views["view 02"].world_from_camera.tolist())
    one, other = (render_plain(scene, tmp_path, seed=seed, views=("left",))["left"][COLOUR_PASS] for seed in (1, 2))
    assert rms(ours[2][COLOUR_PASS] - one) < NOISE * rms(other - one)


def vectors(scene):
    scene.view_layers[0].use_pass_vector = True


def mist(scene):
    scene.view_layers[0].use_pass_mist = True


@pytest.mark.parametrize(
    ("packed_by", "changes"),
    by_each_camera((shader_that_knows_the_camera,), (moving_camera,), (vectors,), (mist,), (fog_around_the_right_eye,)),
)
def test_what_depends_on_the_camera_is_traced_view_by_view(packed_by, tmp_path, renders, changes):
    scene = small_studio(tmp_path, *changes)
    a, b = (render_plain(scene, tmp_path, seed=seed) for seed in (1, 2))
    scene.cycles.seed = 3
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, tmp_path, packed_by=packed_by)
        renders.clear()
        ours = traced(renderer, *EYES)
        assert len(renders) == 2
        if moving_camera in changes:
            return
        views = between(renderer.cameras, 3)
        with pytest.raises(BadInputError, match="view 00"):
            traced(BlenderRenderer(working, tmp_path, views=views, packed_by=packed_by), "view 00")
    for view, passes in zip(EYES, ours, strict=True):
        one, other = a[view][COLOUR_PASS], b[view][COLOUR_PASS]
        assert rms(passes[COLOUR_PASS] - one) < NOISE * rms(other - one), view


@pytest.mark.parametrize(("change", "turns"), [(moving_camera, True), (sliding_camera, False), (toe_in, False)])
def test_only_a_camera_that_turns_parts_its_views(tmp_path, change, turns):
    with working_scene(small_studio(tmp_path, change), SceneOverrides()) as working:
        frame = working.frame_current, working.frame_subframe
        assert turns_in_shutter(working) == turns
        assert (working.frame_current, working.frame_subframe) == frame


def test_answers_come_in_the_order_of_the_requests(packed_by, tmp_path):
    """And the pixels of each in the order of its masks, those that are traced twice last."""
    scene = small_studio(tmp_path, data_passes)
    some = np.random.default_rng(1).random(SIZE[::-1]) < 0.3
    few = some & (np.random.default_rng(2).random(SIZE[::-1]) < 0.3)
    with working_scene(scene, SceneOverrides()) as working:
        renderer = BlenderRenderer(working, tmp_path, packed_by=packed_by)
        left, right = (passes[DEPTH_PASS] for passes in traced(renderer, *EYES))
        requests = [TraceRequest("right", some, few), TraceRequest("left", few), TraceRequest("right", ~some)]
        answers = [passes[DEPTH_PASS] for passes in renderer.trace("packed", requests)]
        assert renderer.trace("packed", []) == []
    expected = [np.concatenate([right[some], right[few]]), left[few], right[~some]]
    for answer, wanted in zip(answers, expected, strict=True):
        np.testing.assert_allclose(answer, wanted, rtol=1e-4)


def test_eevee_has_the_holes_of_both_eyes_traced_together(packed_by, tmp_path, renders):
    """By Cycles, and what it learns of them is that of each eye."""
    scene = small_studio(tmp_path, turned_around, lit=True)
    scene.cycles.filter_width = scene.render.filter_size = FINEST_FILTER
    scene.render.engine, scene.cycles.samples = EEVEE, 1
    with (
        working_scene(scene, SceneOverrides()) as working,
        renderer_of(working, tmp_path, packed_by=packed_by) as renderer,
    ):
        renders.clear()
        together = traced(renderer, *EYES)
        assert len(renders) == 1
        apart = [traced(renderer, view)[0] for view in EYES]
    for ours, alone in zip(together, apart, strict=True):
        assert set(ours) == set(alone)
        for name in (DEPTH_PASS, MEAN_DEPTH, NORMAL):
            with np.errstate(invalid="ignore"):
                differs = (np.abs(ours[name] - alone[name]) > PASS_VALUES) & (ours[name] != alone[name])
            assert differs.any(axis=-1).mean() <= EDGE_PIXELS, name


@pytest.mark.parametrize("changes", [(), (defocus, moving_object)])
def test_an_eye_is_traced_alike_by_its_own_camera_and_by_the_other_eyes(packed_by, tmp_path, changes):
    """With the same noise: all that differs is the rounding of rays."""
    scene = small_studio(tmp_path, *changes, lit=True)
    scene.cycles.samples = 2
    with working_scene(scene, SceneOverrides()) as working:
        cameras = BlenderRenderer(working, tmp_path, packed_by=packed_by).cameras
        pixels = PackedPixels(cameras["right"], np.argwhere(np.ones(SIZE[::-1], bool)))
        own, other = (
            trace_packed(working, view, cameras[view], [pixels], tmp_path, seed=1, by=CAMERAS[packed_by])[1][0][
                COLOUR_PASS
            ]
            for view in EYES
        )
    assert np.ptp(own[:, 0]) > 0.1
    assert np.mean(np.abs(own - other).max(axis=1) > SAME_NOISE) <= EDGE_PIXELS
